// Runs the programs as a user does, as processes: a cairnd on a DDS domain of its own, `cairn` commands that
// connect to it, and a connection from this process. The programs are taken from the folder of the study's
// own executable. Throws std::runtime_error if a program cannot be started or fails. The server is killed at
// the end.
#pragma once

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/lib/query_client.h"
#include "common/wire/bus.h"
#include "tests/child_process.h"

namespace cairn::studies {

// The full path of a program that was built with this one.
[[nodiscard]] std::string ProgramPath(const std::string& name);

// The JSON object that a command with --json printed. Throws if there is none or if the exit code is not 0.
[[nodiscard]] nlohmann::json PrintedBy(const ChildProcess::Outcome& outcome);

class LiveServer {
 public:
  // Returns once it answers. `arguments` of cairnd come last; without a `--state` among them, its state
  // is kept in memory. `environment`: NAME=VALUE, beside this program's own.
  explicit LiveServer(const std::vector<std::string>& arguments = {}, const std::vector<std::string>& environment = {});

  [[nodiscard]] client::QueryClient& queries() { return *queries_; }
  // Starts `cairn ARGUMENTS --json`. PrintedBy(its outcome) is its output.
  [[nodiscard]] std::unique_ptr<ChildProcess> Start(std::vector<std::string> arguments) const;
  // Does the same and waits for the end.
  nlohmann::json Run(std::vector<std::string> arguments) const;
  [[nodiscard]] std::string pid() const { return std::to_string(server_.pid()); }

  // The time limit of a command; no command of a study takes longer.
  static constexpr std::chrono::seconds kDeadline{3600};

 private:
  ChildProcess server_;
  std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<client::QueryClient> queries_;
};

}  // namespace cairn::studies
