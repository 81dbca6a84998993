#include "tests/studies/fleet/live_server.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "tests/must.h"
#include "tests/test_domain.h"

namespace cairn::studies {
namespace {

std::unique_ptr<wire::Bus> JoinDomain() {
  wire::WireOptions options;
  options.domain = test::TestDomain();
  return test::Must(wire::Bus::Create(options, "cairn-study"));
}

std::vector<std::string> CommandLine(const std::vector<std::string>& arguments,
                                     const std::vector<std::string>& environment) {
  std::vector<std::string> line = {"/usr/bin/env"};
  line.insert(line.end(), environment.begin(), environment.end());
  line.insert(line.end(), {ProgramPath("cairnd"), "--domain", std::to_string(test::TestDomain()), "--set",
                           "server.log_level=warn"});
  if (std::ranges::find(arguments, "--state") == arguments.end()) line.insert(line.end(), {"--state", ":memory:"});
  line.insert(line.end(), arguments.begin(), arguments.end());
  return line;
}

}  // namespace

std::string ProgramPath(const std::string& name) {
  const auto path = std::filesystem::read_symlink("/proc/self/exe").parent_path() / name;
  if (!std::filesystem::exists(path)) throw std::runtime_error(path.string() + " is not built");
  return path.string();
}

nlohmann::json PrintedBy(const ChildProcess::Outcome& outcome) {
  // The output also contains progress and error messages, one per line.
  const std::size_t start = outcome.output.rfind("\n{");
  const std::size_t begin = start == std::string::npos ? 0 : start + 1;
  const std::string line = outcome.output.substr(begin, outcome.output.find('\n', begin) - begin);
  auto object = nlohmann::json::parse(line, nullptr, false);
  if (outcome.exit_code != 0 || !object.is_object())
    throw std::runtime_error("exit code " + std::to_string(outcome.exit_code) + ": " + outcome.output);
  return object;
}

LiveServer::LiveServer(const std::vector<std::string>& arguments, const std::vector<std::string>& environment)
    : server_(CommandLine(arguments, environment)),
      bus_(JoinDomain()),
      queries_(test::Must(client::QueryClient::Create(*bus_, {.timeout_s = 20.0}))) {
  if (const auto version = queries_->Ping(); !version) throw std::runtime_error("cairnd: " + version.error().message);
}

std::unique_ptr<ChildProcess> LiveServer::Start(std::vector<std::string> arguments) const {
  arguments.insert(arguments.begin(), ProgramPath("cairn"));
  arguments.insert(arguments.end(), {"--domain", std::to_string(test::TestDomain()), "--json"});
  return std::make_unique<ChildProcess>(std::move(arguments));
}

nlohmann::json LiveServer::Run(std::vector<std::string> arguments) const {
  return PrintedBy(Start(std::move(arguments))->Wait(kDeadline));
}

}  // namespace cairn::studies
