// A program of ours as a process: started at once, its output (both streams) collected, killed when the test leaves it.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/eventually.h"

extern char** environ;

namespace cairn {

class ChildProcess {
 public:
  struct Outcome {
    int exit_code = -1;  // -1 where a signal ended it.
    std::string output;
  };

  explicit ChildProcess(std::vector<std::string> arguments) {
    std::array<int, 2> pipe_ends{};
    if (pipe2(pipe_ends.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, pipe_ends[1], STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, pipe_ends[1], STDERR_FILENO);
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const int error = posix_spawn(&pid_, argv[0], &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    close(pipe_ends[1]);
    output_ = pipe_ends[0];
    if (error != 0) throw std::runtime_error("cannot start " + arguments[0]);
  }
  ~ChildProcess() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    close(output_);
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }
  void Signal(int signal) const { kill(pid_, signal); }

  // Whether it still runs after at most this long. Its output must fit into the pipe until Wait reads it (64 KiB).
  bool RunningAfter(std::chrono::microseconds time) const {
    siginfo_t info{};
    const auto end = std::chrono::steady_clock::now() + time;
    while (waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid == 0) {
      if (std::chrono::steady_clock::now() >= end) return true;
      usleep(500);
    }
    return false;
  }

  // Reads on until its output holds the text; false if it ends, or the deadline passes, without.
  bool Says(const std::string& text, std::chrono::seconds deadline = test::kDeadline) {
    const auto end = std::chrono::steady_clock::now() + deadline;
    while (said_.find(text) == std::string::npos)
      if (Read(end) != Output::kMore) return false;
    return true;
  }

  // Reads to the end of its output, then its exit code; killed where it takes longer than the deadline.
  Outcome Wait(std::chrono::seconds deadline = test::kDeadline) {
    const auto end = std::chrono::steady_clock::now() + deadline;
    Output output = Output::kMore;
    while (output == Output::kMore) output = Read(end);
    if (output == Output::kLate) kill(pid_, SIGKILL);
    Outcome outcome;
    outcome.output = std::exchange(said_, {});
    int status = 0;
    waitpid(std::exchange(pid_, -1), &status, 0);
    if (WIFEXITED(status)) outcome.exit_code = WEXITSTATUS(status);
    return outcome;
  }

 private:
  enum class Output { kMore, kEnded, kLate };

  // Waits for the next piece of output, and keeps it.
  Output Read(std::chrono::steady_clock::time_point end) {
    pollfd readable{.fd = output_, .events = POLLIN, .revents = 0};
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0 || poll(&readable, 1, static_cast<int>(left.count())) == 0) return Output::kLate;
    std::array<char, 4096> buffer{};
    const ssize_t count = read(output_, buffer.data(), buffer.size());
    if (count <= 0) return Output::kEnded;
    said_.append(buffer.data(), static_cast<std::size_t>(count));
    return Output::kMore;
  }

  pid_t pid_ = -1;
  int output_ = -1;
  std::string said_;  // Read, and not yet handed over.
};

}  // namespace cairn
