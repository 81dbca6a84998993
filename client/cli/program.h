// One run of `cairn`: the options that every subcommand shares, where output goes, and the way to the server.
// A subcommand adds its options to the command line and names, with OnChosen, the function that does its work. Nothing
// runs while arguments are parsed, and no DDS participant exists before the first question. Use it from one thread.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "client/lib/query_client.h"
#include "common/wire/bus.h"

namespace cairn::client {

// The exit codes of the program. Scripts may rely on these numbers.
enum class ExitCode : int {
  kOk = 0,
  kFailed = 1,  // The command was understood but failed: refused, not found, no server, unexplained scans.
  kUsage = 2,   // The command line is wrong.
};

struct GlobalOptions {
  wire::WireOptions wire;
  double timeout_s = 5.0;  // For one answer of the server.
  bool json = false;       // One JSON object on `out` instead of text.
};

class Program {
 public:
  Program(std::ostream& out, std::ostream& err) : out_(out), err_(err) {}

  GlobalOptions options;

  // Where the command line chooses `command`, its work is `run(program, *arguments)`, which returns an ExitCode.
  // `arguments` are what the command's options fill.
  template <typename Arguments, typename Run>
  void OnChosen(CLI::App& command, std::shared_ptr<Arguments> arguments, Run run) {
    command.callback([this, arguments, run] { action_ = [this, arguments, run] { return run(*this, *arguments); }; });
  }
  // Does the work of the chosen command. REQUIRES: the command line was parsed without an error.
  [[nodiscard]] ExitCode Run() { return action_(); }

  [[nodiscard]] std::ostream& out() { return out_; }
  [[nodiscard]] std::ostream& err() { return err_; }

  // The domain's bus, opened at the first call.
  [[nodiscard]] Result<wire::Bus*> bus();
  // Asks one question, a function of a QueryClient, and returns its Result.
  template <typename Question>
  [[nodiscard]] auto Ask(const Question& question) -> decltype(question(std::declval<QueryClient&>())) {
    const auto client = queries();
    if (!client) return tl::unexpected(client.error());
    return question(**client);
  }

  // Text for people, or the object for machines.
  ExitCode Print(const std::string& text, const nlohmann::json& object);
  // Says in one line on `err` why the command failed, and under --json also as an object with `error` on `out`. Of a
  // request that has failed, it gives the id.
  ExitCode Refuse(const Status& status);

 private:
  [[nodiscard]] Result<QueryClient*> queries();

  std::ostream& out_;
  std::ostream& err_;
  std::function<ExitCode()> action_;
  std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<QueryClient> queries_;
};

// Parses and runs one command line, without the program's name.
[[nodiscard]] ExitCode RunCairn(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err);

}  // namespace cairn::client
