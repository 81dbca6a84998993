// The programs a user runs, as processes: a cairnd on a DDS domain of this study's own, `cairn` commands to it, and a
// connection of this process beside them. The programs are those in the folder of the study's own executable. Throws
// std::runtime_error where one cannot be started or fails; the server is killed at the end.
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

// The whole path of a program that was built with this one.
[[nodiscard]] std::string ProgramPath(const std::string& name);

// The object that a command run with --json printed. Throws where it printed none or its exit code is not 0.
[[nodiscard]] nlohmann::json PrintedBy(const ChildProcess::Outcome& outcome);

class LiveServer {
 public:
  LiveServer();  // Returns once it answers.

  [[nodiscard]] client::QueryClient& queries() { return *queries_; }
  // `cairn ARGUMENTS --json`, started; PrintedBy(its outcome) is what it says.
  [[nodiscard]] std::unique_ptr<ChildProcess> Start(std::vector<std::string> arguments) const;
  // The same, waited for.
  nlohmann::json Run(std::vector<std::string> arguments) const;
  [[nodiscard]] std::string pid() const { return std::to_string(server_.pid()); }

  // No command takes longer than any study's.
  static constexpr std::chrono::seconds kDeadline{3600};

 private:
  ChildProcess server_;
  std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<client::QueryClient> queries_;
};

}  // namespace cairn::studies
