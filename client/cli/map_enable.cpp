#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

struct EnableArguments {
  std::string site;
  std::uint32_t version = 0;  // 0: the version before the enabled one.
};

ExitCode Enable(Program& program, const EnableArguments& arguments) {
  const auto map = program.Ask([&](QueryClient& server) {
    return arguments.version == 0 ? server.RollBackMap(arguments.site)
                                  : server.EnableMap(arguments.site, arguments.version);
  });
  if (!map) return program.Refuse(map.error());
  return program.Print(FormatMap(*map), *map);
}

}  // namespace

void AddMapEnable(CLI::App& map, Program& program) {
  auto arguments = std::make_shared<EnableArguments>();
  auto* enable = map.add_subcommand("enable", "Switch the site to one of its map versions (see `cairn map info`)");
  enable->add_option("--site", arguments->site, "The site's name")->required();
  enable->add_option("--version", arguments->version, "The version to enable")->required()->check(InRange(1, 4e9));
  program.OnChosen(*enable, arguments, Enable);
  auto* rollback = map.add_subcommand("rollback", "Switch the site to the map version before the enabled one");
  rollback->add_option("--site", arguments->site, "The site's name")->required();
  program.OnChosen(*rollback, arguments, Enable);
}

}  // namespace cairn::client
