#include <fmt/format.h>

#include <algorithm>

#include "client/cli/commands.h"
#include "client/cli/fetch_map.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

struct EnableArguments {
  std::string site;
  std::uint32_t version = 0;
};

ExitCode Enable(Program& program, const std::string& site, std::uint32_t version) {
  Request request;
  request.kind = RequestKind::kMapEnable;
  request.site = site;
  request.map_version = version;
  if (const auto reply = program.Ask(request); !reply) return program.Refuse(reply.error());
  const auto info = FetchMapInfo(program, site);
  if (!info) return program.Refuse(info.error());
  return program.Print(FormatMap(*info), ToJson(*info));
}

ExitCode RollBack(Program& program, const std::string& site) {
  const auto info = FetchMapInfo(program, site);
  if (!info) return program.Refuse(info.error());
  std::uint32_t before = 0;
  for (const MapVersionInfo& version : info->versions) {
    if (version.version < info->enabled_version) before = std::max(before, version.version);
  }
  if (before == 0) {
    return program.Refuse({StatusCode::kFailedPrecondition,
                           fmt::format("site '{}' has no version before {}", site, info->enabled_version)});
  }
  return Enable(program, site, before);
}

}  // namespace

void AddMapEnable(CLI::App& map, Program& program) {
  auto arguments = std::make_shared<EnableArguments>();
  auto* enable = map.add_subcommand("enable", "Switch the site to one of its map versions (see map info)");
  enable->add_option("--site", arguments->site, "The site's name")->required();
  enable->add_option("--version", arguments->version, "The version to enable")->required()->check(InRange(1, 1e15));
  enable->callback([&program, arguments] {
    program.action = [&program, arguments] { return Enable(program, arguments->site, arguments->version); };
  });
  auto* rollback = map.add_subcommand("rollback", "Switch the site to the version before the enabled one");
  rollback->add_option("--site", arguments->site, "The site's name")->required();
  rollback->callback(
      [&program, arguments] { program.action = [&program, arguments] { return RollBack(program, arguments->site); }; });
}

}  // namespace cairn::client
