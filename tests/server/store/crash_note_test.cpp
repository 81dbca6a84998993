#include "server/store/crash_note.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <functional>

#include "tests/temp_directory.h"

namespace cairn::server {
namespace {

// Does this in a process of its own. Returns whether it died of it (a sanitizer's handler exits with an error).
bool DiesElsewhere(const std::function<void()>& act) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit none{0, 0};
    setrlimit(RLIMIT_CORE, &none);
    act();
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return !WIFEXITED(status) || WEXITSTATUS(status) != 0;
}

TEST(CrashNote, HoldsWhatTheCrashedThreadWorkedOn) {
  const TempDirectory directory;
  const auto file = directory / "note";
  for (const int signal : {SIGABRT, SIGSEGV}) {
    EXPECT_TRUE(DiesElsewhere([&] {
      const CrashNote note(file);
      const CrashNote::Working outer(41);
      { const CrashNote::Working inner(42); }
      raise(signal);
    }));
    EXPECT_EQ(CrashNote::Of(file), 41U);
  }
}

TEST(CrashNote, ThereIsNoneOfAProcessThatWasKilledFromOutside) {
  const TempDirectory directory;
  const auto file = directory / "note";
  for (const int signal : {SIGKILL, SIGABRT}) {
    EXPECT_TRUE(DiesElsewhere([&] {
      const CrashNote note(file);
      const CrashNote::Working working(41);
      const pid_t parent = getpid();
      if (fork() == 0) _exit(kill(parent, signal));
      pause();
    }));
    EXPECT_EQ(CrashNote::Of(file), std::nullopt);
  }
}

TEST(CrashNote, ThereIsNoneOfACrashOfSomethingElse) {
  const TempDirectory directory;
  const auto file = directory / "note";
  EXPECT_TRUE(DiesElsewhere([&] {
    const CrashNote note(file);
    { const CrashNote::Working working(41); }
    std::abort();
  }));
  EXPECT_EQ(CrashNote::Of(file), std::nullopt);
}

TEST(CrashNote, AProcessThatGoesOnLeavesNoFile) {
  const TempDirectory directory;
  const auto file = directory / "note";
  {
    const CrashNote note(file);
    EXPECT_TRUE(std::filesystem::exists(file));
  }
  EXPECT_FALSE(std::filesystem::exists(file));
  const CrashNote nowhere(directory / "no" / "such" / "place");
  const CrashNote nothing{std::filesystem::path()};
}

}  // namespace
}  // namespace cairn::server
