#include <fmt/format.h>

#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/text_output.h"
#include "common/sensor/stamp.h"

namespace cairn::client {
namespace {

std::string Line(const SavedSite& saved) {
  const std::string site = saved.site.empty() ? "cannot be read" : "site " + saved.site;
  return fmt::format("saved {}: {}, {:.1f} KiB, at {}\n", saved.name, site, static_cast<double>(saved.bytes) / 1024.0,
                     FormatStamp(saved.saved));
}

struct SiteAndFile {
  std::string site;
  std::string name;
};

ExitCode SaveSite(Program& program, const SiteAndFile& arguments) {
  const auto saved = program.Ask([&](QueryClient& server) { return server.SaveSite(arguments.site, arguments.name); });
  if (!saved) return program.Refuse(saved.error());
  return program.Print(Line(*saved), *saved);
}

ExitCode LoadSite(Program& program, const SiteAndFile& arguments) {
  const auto loaded = program.Ask([&](QueryClient& server) { return server.LoadSite(arguments.name, arguments.site); });
  if (!loaded) return program.Refuse(loaded.error());
  return program.Print(fmt::format("{} loaded\n", arguments.name), {{"name", arguments.name}, {"loaded", true}});
}

ExitCode DeleteSite(Program& program, const SiteAndFile& arguments) {
  const bool file = arguments.site.empty();
  const auto deleted = program.Ask([&](QueryClient& server) {
    return file ? server.DeleteSavedSite(arguments.name) : server.DeleteSite(arguments.site);
  });
  if (!deleted) return program.Refuse(deleted.error());
  if (file)
    return program.Print(fmt::format("saved {} deleted\n", arguments.name),
                         {{"name", arguments.name}, {"deleted", true}});
  return program.Print(fmt::format("site {} deleted\n", arguments.site), {{"site", arguments.site}, {"deleted", true}});
}

}  // namespace

ExitCode ListSites(Program& program) {
  const auto maps = program.Ask([](QueryClient& server) { return server.Maps(); });
  if (!maps) return program.Refuse(maps.error());
  const auto saved = program.Ask([](QueryClient& server) { return server.SavedSites(); });
  // A server that keeps no state has sites, and no saved ones.
  const bool none = !saved && saved.error().code == StatusCode::kFailedPrecondition;
  if (!saved && !none) return program.Refuse(saved.error());
  const std::vector<SavedSite> files = none ? std::vector<SavedSite>{} : *saved;
  std::string text = maps->empty() && files.empty() ? "no site yet\n" : "";
  for (const MapInfo& map : *maps) text += FormatMap(map);
  for (const SavedSite& file : files) text += Line(file);
  return program.Print(text, {{"sites", *maps}, {"saved", files}});
}

void AddSite(CLI::App& app, Program& program) {
  auto* site = app.add_subcommand("site", "Whole sites: save, load, move to another server, merge, split, delete");
  site->require_subcommand(1);
  site->footer(
      "`save`, `load` and `delete` ask the running server; its files are in `saved/` of its state directory.\n"
      "`export` and `import` work on the state directory of a stopped server, `merge`, `split` and `delete-session`\n"
      "on that or on files of saved sites.\n"
      "EXAMPLES\n  cairn site save hall monday\n  cairn site load monday --as hall2\n"
      "  cairn site export hall -o hall.site --state /var/lib/cairn\n"
      "  cairn site merge hall.site annex.site --transform 12.5,0,90deg -o both.site");
  auto kept = std::make_shared<SiteAndFile>();
  auto* save = site->add_subcommand("save", "Write everything the server has stored of a site into a file of its own");
  save->add_option("site", kept->site, "The site's name")->required();
  save->add_option("name", kept->name, "The file's name; one that is there is replaced [the site's]");
  program.OnChosen(*save, kept, SaveSite);
  auto taken = std::make_shared<SiteAndFile>();
  auto* load = site->add_subcommand("load", "Load a saved site, with its sessions, while the server runs");
  load->add_option("name", taken->name, "The file's name")->required();
  load->add_option("--as", taken->site, "The site's name from now on [as in the file]");
  program.OnChosen(*load, taken, LoadSite);
  auto deleted = std::make_shared<SiteAndFile>();
  auto* remove =
      site->add_subcommand("delete", "Delete a site with everything the server has stored of it, or a saved one");
  auto* deleted_site = remove->add_option("site", deleted->site, "The site's name; no robot may be active in it");
  auto* deleted_file = remove->add_option("--saved", deleted->name, "Name of a saved site: only this file is deleted");
  deleted_site->excludes(deleted_file);
  remove->require_option(1);
  program.OnChosen(*remove, deleted, DeleteSite);
  AddStoredSites(*site, program);
}

}  // namespace cairn::client
