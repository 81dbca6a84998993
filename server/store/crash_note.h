// Notes on the disk what a thread was working on when it crashed, so that the next process knows what not to try again
// for ever. A process that is killed from outside (SIGKILL, a power failure) leaves no note.
#pragma once

#include <csignal>
#include <cstdint>
#include <filesystem>
#include <optional>

namespace cairn::server {

class CrashNote {
 public:
  // While it exists, SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT are noted in this file before they do what they did
  // before. If the file cannot be made, or another note of this process exists, nothing is noted. An empty path:
  // nothing is noted.
  explicit CrashNote(const std::filesystem::path& file);
  CrashNote(const CrashNote&) = delete;
  CrashNote& operator=(const CrashNote&) = delete;
  ~CrashNote();  // Removes the file.

  // While it exists, the calling thread works on this; a crash of the thread notes the number, which is not 0.
  class Working {
   public:
    explicit Working(std::uint64_t number);
    Working(const Working&) = delete;
    Working& operator=(const Working&) = delete;
    ~Working();

   private:
    const std::uint64_t before_;
    stack_t stack_before_{};  // Where nothing was worked on before.
  };

  // What the last process has noted; nothing if it did not crash.
  [[nodiscard]] static std::optional<std::uint64_t> Of(const std::filesystem::path& file);

 private:
  std::filesystem::path file_;  // Empty: nothing is noted.
};

}  // namespace cairn::server
