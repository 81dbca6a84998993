// One run of `cairn`: the options every subcommand shares, where output goes, and the way to the server.
// A subcommand registers itself with the command line and sets `action`; nothing runs while arguments are parsed, and
// no DDS participant exists before the first question. One thread.
#pragma once

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <ostream>
#include <string>
#include <vector>

#include "client/cli/exit_code.h"
#include "client/lib/query_client.h"
#include "common/service/request.h"
#include "common/wire/bus.h"

namespace cairn::client {

struct GlobalOptions {
  wire::WireOptions wire;
  double timeout_s = 5.0;  // For one answer of the server.
  bool json = false;       // One JSON object on `out` instead of text.
};

class Program {
 public:
  Program(std::ostream& out, std::ostream& err) : out_(out), err_(err) {}

  GlobalOptions options;
  std::function<ExitCode()> action;  // What the chosen subcommand does.

  [[nodiscard]] std::ostream& out() { return out_; }
  [[nodiscard]] std::ostream& err() { return err_; }

  // The domain's bus, opened at the first call.
  [[nodiscard]] Result<wire::Bus*> bus();
  // The server's whole answer within the timeout; an answer that says no is an error.
  [[nodiscard]] Result<Reply> Ask(const Request& request);

  // Text for people, or the object for machines.
  ExitCode Print(const std::string& text, const nlohmann::json& object);
  // One clear line on `err`, and under --json an object with `error` on `out`.
  ExitCode Refuse(const Status& status);

 private:
  std::ostream& out_;
  std::ostream& err_;
  std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<QueryClient> queries_;
};

// Parses and runs one command line, without the program's name.
[[nodiscard]] ExitCode RunCairn(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err);

}  // namespace cairn::client
