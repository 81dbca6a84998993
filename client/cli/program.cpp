#include "client/cli/program.h"

#include <fmt/format.h>

#include <exception>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/manual_pages.h"
#include "client/cli/option_checks.h"
#include "client/cli/quantity_text.h"
#include "common/options/config.h"
#include "common/version.h"
#include "common/wire/wire_arguments.h"

namespace cairn::client {

Result<wire::Bus*> Program::bus() {
  if (!bus_) {
    auto created = wire::Bus::Create(options.wire, "cairn");
    if (!created) return tl::unexpected(created.error());
    bus_ = std::move(*created);
  }
  return bus_.get();
}

Result<QueryClient*> Program::queries() {
  if (!queries_) {
    const auto opened = bus();
    if (!opened) return tl::unexpected(opened.error());
    auto created = QueryClient::Create(**opened, {.timeout_s = options.timeout_s});
    if (!created) return tl::unexpected(created.error());
    queries_ = std::move(*created);
  }
  return queries_.get();
}

ExitCode Program::Print(const std::string& text, const nlohmann::json& object) {
  // A name from a file or from the wire may hold bytes that are not UTF-8. They are replaced, so that dump() does not
  // throw.
  if (options.json) {
    out_ << object.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) << "\n";
  } else {
    out_ << text;
  }
  out_.flush();
  return ExitCode::kOk;
}

ExitCode Program::Refuse(const Status& status) {
  if (options.json) Print("", {{"error", status}});
  err_ << "cairn: " << status.message << " (" << StatusCodeName(status.code)
       << (status.request.empty() ? "" : ", request " + status.request) << ")\n";
  return ExitCode::kFailed;
}

namespace {

void AddGlobalOptions(CLI::App& app, Program& program, wire::WireArguments& wire) {
  GlobalOptions& options = program.options;
  app.add_option("--domain", wire.domain, "DDS domain of server and robots [CAIRN_DOMAIN, or 0]");
  app.add_option("--set", wire.assignments, "Set any option of the section wire, e.g. wire.interfaces=192.168.1.5")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  AddParsed(app, "--timeout", options.timeout_s, ParseDuration, "How long to wait for an answer [5]", "SECONDS");
  app.add_flag("--json", options.json, "Print JSON on standard output, one object per line");
}

// For those who make packages: not in the help. It ends the program, as --help does.
void AddManualPages(CLI::App& app) {
  app.add_option_function<std::string>(
         "--manual-pages",
         [&app](const std::string& directory) {
           if (const auto written = WriteManualPages(app, directory); !written)
             throw CLI::ValidationError("--manual-pages", written.error().message);
           throw CLI::Success();
         },
         "Write the manual pages into this directory")
      ->group("");
}

// The commands as `cairn --help` lists them: a table of contents, from looking to making robots up.
struct Chapter {
  const char* heading;
  std::vector<void (*)(CLI::App&, Program&)> commands;
};

void AddCommands(CLI::App& app, Program& program) {
  const std::vector<Chapter> chapters = {
      {"Watch", {AddStatus, AddTop, AddPose, AddPath, AddPing}},
      {"Robots", {AddRobot, AddSession, AddRos2}},
      {"Maps", {AddMap, AddTiles, AddJob}},
      {"Sites", {AddSite}},
      {"Logs and recordings", {AddReplay, AddRecord, AddCheckLog, AddCloud, AddEval}},
      {"Simulation", {AddSim}},
  };
  for (const Chapter& chapter : chapters) {
    for (const auto add : chapter.commands) {
      add(app, program);
      app.get_subcommands({}).back()->group(chapter.heading);
    }
  }
}

}  // namespace

ExitCode RunCairn(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err) {
  Program program(out, err);
  wire::WireArguments wire;
  CLI::App app("Stream robots to a Cairn server, ask it for poses and maps, and give it jobs.", "cairn");
  app.set_version_flag("--version", std::string("cairn ") + kVersion);
  app.footer(
      "Options above work with every command, before or after it. `cairn COMMAND --help` tells more, and so does\n"
      "`man cairn-COMMAND` where the package is installed.\n"
      "Exit codes: 0 done, 1 failed (one line on standard error says why), 2 wrong command line.");
  app.fallthrough();
  app.require_subcommand(1);
  app.failure_message([](const CLI::App*, const CLI::Error& error) {
    return "cairn: " + std::string(error.what()) +
           "\n`cairn --help` lists the commands, `cairn COMMAND --help` what one of them takes\n";
  });
  AddGlobalOptions(app, program, wire);
  AddCommands(app, program);
  AddManualPages(app);
  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));  // CLI11 takes them from the back.
  } catch (const CLI::ParseError& error) {
    // Where something is missing, a word that nobody knows is the likelier mistake: a mistyped command or option.
    const std::vector<std::string> unknown = app.remaining_for_passthrough(true);
    const bool mistyped = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr && !unknown.empty();
    const int code = mistyped ? app.exit(CLI::ExtrasError(unknown), out, err) : app.exit(error, out, err);
    return code == 0 ? ExitCode::kOk : ExitCode::kUsage;
  }
  const VisitOptions visit = [&options = program.options](OptionVisitor& visitor) {
    visitor.Section("wire", "The DDS side.", [&] { Visit(visitor, options.wire); });
  };
  auto valid = Apply(wire, visit);
  if (valid) valid = Validate(program.options.wire);
  if (!valid) {
    err << "cairn: " << valid.error().message << "\n";
    return ExitCode::kUsage;
  }
  return program.Run();
}

}  // namespace cairn::client
