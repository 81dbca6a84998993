// What people see at a terminal, against cairnd as a process: `cairn top` on a terminal of its own, and the names that
// bash completes from the running server.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <sstream>
#include <stdexcept>

#include "tests/system/cli/cairn_program.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;

std::vector<std::string> LinesIn(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// A program on a terminal of its own, killed when the test leaves it.
class Terminal {
 public:
  Terminal(std::vector<std::string> arguments, unsigned short rows, unsigned short columns) {
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    winsize size = SizeOf(rows, columns);
    std::array<char, 256> name{};
    pid_ = forkpty(&screen_, name.data(), nullptr, &size);
    if (pid_ == 0) {
      execv(argv[0], argv.data());
      _exit(127);
    }
    if (pid_ < 0) throw std::runtime_error("no terminal");
    // While this is open, the terminal keeps its modes and what was written to it.
    keyboard_ = open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  }
  ~Terminal() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    close(keyboard_);
    close(screen_);
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  void Resize(unsigned short rows, unsigned short columns) const {
    const winsize size = SizeOf(rows, columns);
    ioctl(screen_, TIOCSWINSZ, &size);
  }
  void Type(const std::string& keys) const {
    EXPECT_EQ(write(screen_, keys.data(), keys.size()), static_cast<ssize_t>(keys.size()));
  }
  // Whether keys are handed over one by one and not shown.
  [[nodiscard]] bool SingleKeys() const {
    termios modes{};
    EXPECT_EQ(tcgetattr(keyboard_, &modes), 0);
    return (modes.c_lflag & static_cast<tcflag_t>(ICANON | ECHO)) == 0;
  }

  // Reads what it draws until `good` holds for the last picture that is complete.
  [[nodiscard]] bool Shows(const std::function<bool(const std::string& picture)>& good) {
    return test::Eventually([&] {
      Read();
      return good(picture());
    });
  }
  // -1 where it does not end, or a signal ended it.
  int Wait() {
    int status = 0;
    const bool ended = test::Eventually([&] {
      Read();
      return waitpid(pid_, &status, WNOHANG) == pid_;
    });
    if (!ended) return -1;
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  // From the upper left corner to where the rest of the screen is cleared, without what controls the terminal.
  [[nodiscard]] std::string picture() const {
    const std::size_t end = output_.rfind("\x1b[J");
    const std::size_t begin = end == std::string::npos ? end : output_.rfind("\x1b[H", end);
    if (begin == std::string::npos) return "";
    std::string text = output_.substr(begin + 3, end - begin - 3);
    std::erase(text, '\r');
    for (std::size_t at; (at = text.find("\x1b[K")) != std::string::npos;) text.erase(at, 3);
    return text;
  }
  [[nodiscard]] const std::string& output() const { return output_; }

 private:
  static winsize SizeOf(unsigned short rows, unsigned short columns) {
    winsize size{};
    size.ws_row = rows;
    size.ws_col = columns;
    return size;
  }
  void Read() {
    pollfd readable{.fd = screen_, .events = POLLIN, .revents = 0};
    std::array<char, 4096> buffer{};
    while (poll(&readable, 1, 0) > 0 && (readable.revents & POLLIN) != 0) {
      const ssize_t count = read(screen_, buffer.data(), buffer.size());
      if (count <= 0) return;
      output_.append(buffer.data(), static_cast<std::size_t>(count));
    }
  }

  pid_t pid_ = -1;
  int screen_ = -1;
  int keyboard_ = -1;
  std::string output_;
};

class CairnTerminal : public CairnProgram {
 protected:
  // The questions are asked once: what is drawn later is the same answer.
  static std::vector<std::string> Top() {
    return {CAIRN_PATH,   "--domain", std::to_string(test::TestDomain()), "--timeout", "20s", "top",
            "--interval", "3600"};
  }
  static bool IsComplete(const std::string& picture) { return picture.find("robot2 ") != std::string::npos; }
};

TEST_F(CairnTerminal, TopFitsTheTerminalFollowsItsSizeAndEndsWithQ) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  StreamFleet();
  Terminal terminal(Top(), 24, 90);
  ASSERT_TRUE(terminal.Shows(IsComplete)) << terminal.output();
  const auto whole = LinesIn(terminal.picture());
  EXPECT_GE(whole.size(), 6U) << "the server, a site and two robots, with two headings";
  EXPECT_LT(whole.size(), 24U);
  for (const std::string& line : whole) EXPECT_LE(line.size(), 90U);
  EXPECT_THAT(terminal.picture(), HasSubstr("SITE  ROBOTS  VERSION  EPOCH  TILES  MEMORY (MiB)  JOBS\nhall "));
  EXPECT_THAT(terminal.picture(), HasSubstr("\nrobot1  hall "));

  terminal.Resize(4, 30);
  ASSERT_TRUE(terminal.Shows([](const std::string& picture) { return LinesIn(picture).size() == 3; }))
      << terminal.output();
  for (const std::string& line : LinesIn(terminal.picture())) EXPECT_LE(line.size(), 30U);
  terminal.Resize(24, 90);
  ASSERT_TRUE(terminal.Shows(IsComplete)) << terminal.output();
  EXPECT_EQ(LinesIn(terminal.picture()), whole);

  ASSERT_TRUE(test::Eventually([&] { return terminal.SingleKeys(); }));
  terminal.Type("xq");
  EXPECT_EQ(terminal.Wait(), 0);
  EXPECT_FALSE(terminal.SingleKeys()) << "the terminal is left as it was";
}

TEST_F(CairnTerminal, TopEndsWithControlC) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  StreamFleet();
  Terminal terminal(Top(), 24, 90);
  ASSERT_TRUE(terminal.Shows(IsComplete)) << terminal.output();
  terminal.Type("\x03");
  EXPECT_EQ(terminal.Wait(), 0);
  EXPECT_FALSE(terminal.SingleKeys()) << "the terminal is left as it was";
}

TEST_F(CairnTerminal, TopForProgramsHasSitesAndLoad) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  StreamFleet();
  const auto top = MustJson({"top", "-n", "1"});
  EXPECT_EQ(top["robots"].size(), 2U);
  ASSERT_EQ(top["sites"].size(), 1U);
  EXPECT_EQ(top["sites"][0]["site"], "hall");
  EXPECT_TRUE(top["sites"][0].contains("memory_bytes"));
  EXPECT_TRUE(top["load"].contains("strand_wait_p99_ms"));
  EXPECT_FALSE(top.contains("ros2")) << "the server does not serve ROS 2 robots";
  EXPECT_FALSE(MustJson({"status"}).contains("ros2"));
}

TEST_F(CairnTerminal, StatusAndTopAskAboutRos2RobotsWhereTheServerServesThem) {
  server_.emplace(std::vector<std::string>{
      CAIRND_PATH, "--domain", std::to_string(test::TestDomain()), "--set", "ros2.enabled=true", "--set",
      "ros2.domain=" + std::to_string(test::AnotherTestDomain()), "--log-level", "warn"});
  ASSERT_EQ(Cairn({"ping"}).code, ExitCode::kOk);
  nlohmann::json status;
  ASSERT_TRUE(test::Eventually([&] {
    status = MustJson({"status"});
    return status.contains("ros2");
  })) << status;
  EXPECT_EQ(status["ros2"]["robots"], 0);
  EXPECT_EQ(status["ros2"]["not_on_map"], 0);
  EXPECT_TRUE(MustJson({"top", "-n", "1"}).contains("ros2"));
}

class CairnCompletion : public CairnProgram {
 protected:
  // What bash offers for the last of these words of a command line of cairn.
  static std::vector<std::string> Offered(const std::vector<std::string>& words) {
    const std::string script = R"(
      . "$1"
      program=$2
      COMP_WORDS=(cairn "${@:3}")
      COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
      COMPREPLY=()
      _cairn "$program" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
      [ ${#COMPREPLY[@]} -eq 0 ] || printf '%s\n' "${COMPREPLY[@]}")";
    const char* root = std::getenv("CAIRN_SOURCE_DIR");
    EXPECT_NE(root, nullptr);
    std::vector<std::string> line = {
        "/bin/bash", "-c", script, "bash", std::string(root == nullptr ? "." : root) + "/deploy/completion.bash",
        CAIRN_PATH};
    line.insert(line.end(), words.begin(), words.end());
    return LinesIn(ChildProcess(line).Wait().output);
  }
};

TEST_F(CairnCompletion, NamesComeFromTheRunningServer) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  StreamFleet();
  const auto job = MustJson({"job", "smooth", "--site", "hall", "--wait"});
  const std::string domain = std::to_string(test::TestDomain());
  const std::vector<std::pair<std::vector<std::string>, std::vector<std::string>>> lines = {
      {{"--domain", domain, "pose", "r"}, {"robot1", "robot2"}},
      {{"--domain", "=", domain, "map", "draw", "--robots", ""}, {"robot1", "robot2"}},
      {{"--set", "wire.domain", "=", domain, "map", "info", "--site", ""}, {"hall"}},
      {{"--domain", domain, "job", "show", ""}, {std::to_string(job["id"].get<int>())}}};
  for (const auto& [words, names] : lines) {
    std::vector<std::string> offered;
    // On a busy machine the server may not be found within the second that completion waits.
    EXPECT_TRUE(test::Eventually([&words = words, &names = names, &offered] {
      offered = Offered(words);
      return offered == names;
    })) << ::testing::PrintToString(words)
        << ::testing::PrintToString(offered);
  }
}

TEST_F(CairnCompletion, SaysNothingWithoutAServer) {
  EXPECT_TRUE(Offered({"--domain", std::to_string(test::AnotherTestDomain()), "pose", ""}).empty());
}

}  // namespace
}  // namespace cairn::client
