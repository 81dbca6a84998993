// The commands on sites that no server uses at the moment: in the state directory of a stopped server (--state), or in
// files of saved sites. A directory is changed in one commit; files are read, and new ones are written.
#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/cli/commands.h"
#include "client/cli/option_checks.h"
#include "common/service/start_pose.h"
#include "server/store/site_edit.h"
#include "server/store/sqlite_store.h"

namespace cairn::client {
namespace {

using server::Store;

struct SiteArguments {
  std::string state;
  std::vector<std::string> names;  // Names of sites, files or sessions, as the command says.
  std::string output;
  std::string rest;
  std::string as;
  std::vector<std::string> renames;
  Pose2 T_into_from;
};

// The store of a stopped server. A directory without one is an error where the command needs what is in it.
Result<std::unique_ptr<Store>> OpenState(const std::string& state, bool must_exist) {
  std::error_code error;
  if (must_exist && !std::filesystem::exists(std::filesystem::path(state) / "cairn.db", error))
    return Fail(StatusCode::kNotFound, "there is no state of a server in '" + state + "'");
  return server::OpenStore(state);
}

// To change it. First what an earlier deletion has left is removed, which a running server does little by little.
Result<std::unique_ptr<Store>> OpenToEdit(const std::string& state, bool must_exist) {
  auto store = OpenState(state, must_exist);
  if (!store) return store;
  if (auto removed = server::RemoveRests(**store); !removed) return tl::unexpected(removed.error());
  return store;
}

Result<std::map<std::string, std::string>> RenamesOf(const std::vector<std::string>& texts) {
  std::map<std::string, std::string> renames;
  for (const std::string& text : texts) {
    const auto equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
      return Fail(StatusCode::kInvalidArgument, "'" + text + "' is not OLD=NEW");
    renames[text.substr(0, equals)] = text.substr(equals + 1);
  }
  return renames;
}

nlohmann::json JsonOf(const server::SiteFileSummary& summary) {
  nlohmann::json sessions = nlohmann::json::array();
  for (const auto& [id, robot] : summary.sessions) sessions.push_back({{"session", id}, {"robot", robot}});
  return {{"site", summary.site.name}, {"sessions", sessions}, {"entries", summary.entries}};
}

std::string TextOf(const server::SiteFileSummary& summary) {
  return fmt::format("site {}: {} sessions, {} journal entries, {} jobs\n", summary.site.name, summary.sessions.size(),
                     summary.entries, summary.jobs.size());
}

ExitCode PrintSummary(Program& program, const Result<server::SiteFileSummary>& summary) {
  if (!summary) return program.Refuse(summary.error());
  return program.Print(TextOf(*summary), JsonOf(*summary));
}

ExitCode ListStored(Program& program, const std::string& state) {
  const auto store = OpenState(state, true);
  if (!store) return program.Refuse(store.error());
  const auto names = server::SiteNames(**store);
  if (!names) return program.Refuse(names.error());
  const auto unreadable = server::UnreadableSessions(**store);
  if (!unreadable) return program.Refuse(unreadable.error());
  std::string text;
  nlohmann::json sites = nlohmann::json::array();
  for (const std::string& name : *names) {
    const auto contents = server::ReadSite(**store, name);
    if (!contents) return program.Refuse(contents.error());
    text += fmt::format("{}: {} sessions\n", name, contents->sessions.size());
    nlohmann::json sessions = nlohmann::json::array();
    for (const auto& [id, session] : contents->sessions) {
      text += fmt::format("  session {} of robot {}\n", id, session.request.robot);
      sessions.push_back({{"session", id}, {"robot", session.request.robot}});
    }
    for (const std::uint64_t id : contents->layers) {
      const bool merged = contents->site.merged.contains(id);
      text += fmt::format("  session {}, of which only the map is left{}\n", id,
                          merged ? ", together with that of earlier sessions" : "");
      sessions.push_back({{"session", id}, {"with_earlier", merged}});
    }
    sites.push_back({{"site", name}, {"sessions", sessions}});
  }
  for (const std::uint64_t id : *unreadable)
    text += fmt::format("session {}, which cannot be read: its site is not known\n", id);
  return program.Print(text.empty() ? "no site yet\n" : text, {{"sites", sites}, {"unreadable", *unreadable}});
}

ExitCode List(Program& program, const SiteArguments& arguments) {
  return arguments.state.empty() ? ListSites(program) : ListStored(program, arguments.state);
}

ExitCode ExportStored(Program& program, const SiteArguments& arguments) {
  const auto store = OpenState(arguments.state, true);
  if (!store) return program.Refuse(store.error());
  return PrintSummary(program, server::WriteSiteFile(**store, arguments.names[0], arguments.output));
}

ExitCode Import(Program& program, const SiteArguments& arguments) {
  const auto renames = RenamesOf(arguments.renames);
  if (!renames) return program.Refuse(renames.error());
  const auto store = OpenToEdit(arguments.state, false);
  if (!store) return program.Refuse(store.error());
  return PrintSummary(program,
                      server::ImportSite(**store, arguments.names[0], {.site = arguments.as, .robots = *renames}));
}

// Reads files into a store in memory, one site each. The second gets another name there if it has the first one's.
Result<std::unique_ptr<Store>> OpenFiles(const std::vector<std::string>& files, std::vector<std::string>& sites,
                                         const std::map<std::string, std::string>& renames = {}) {
  auto store = server::OpenStore(std::string(server::kInMemory));
  if (!store) return store;
  for (const std::string& file : files) {
    const auto summary = server::SurveySiteFile(file);
    if (!summary) return tl::unexpected(summary.error());
    server::ImportOptions options;
    if (!sites.empty() && sites.front() == summary->site.name)
      options.site = "second." + summary->site.name.substr(0, 50);
    if (!sites.empty()) options.robots = renames;
    const auto imported = server::ImportSite(**store, file, options);
    if (!imported) return Fail(imported.error().code, file + ": " + imported.error().message);
    sites.push_back(imported->site.name);
  }
  return store;
}

ExitCode Merge(Program& program, const SiteArguments& arguments) {
  const auto renames = RenamesOf(arguments.renames);
  if (!renames) return program.Refuse(renames.error());
  const bool files = arguments.state.empty();
  std::vector<std::string> sites;
  if (!files) sites = arguments.names;
  const auto store = files ? OpenFiles(arguments.names, sites, *renames) : OpenToEdit(arguments.state, true);
  if (!store) return program.Refuse(store.error());
  if (auto merged = server::MergeSites(**store, sites[0], sites[1], arguments.T_into_from); !merged)
    return program.Refuse(merged.error());
  if (files) return PrintSummary(program, server::WriteSiteFile(**store, sites[0], arguments.output));
  return program.Print(fmt::format("site {} is part of {} now\n", sites[1], sites[0]),
                       {{"site", sites[0]}, {"merged", sites[1]}});
}

// The site that a command changes, in the state directory or read from a file, and the sessions that it names.
struct NamedSessions {
  std::unique_ptr<Store> store;
  std::string site;
  std::vector<std::uint64_t> sessions;
};

Result<NamedSessions> OpenSessions(const SiteArguments& arguments) {
  const auto& names = arguments.names;  // The site or its file, then the sessions.
  std::vector<std::string> sites;
  auto store = arguments.state.empty() ? OpenFiles({names[0]}, sites) : OpenToEdit(arguments.state, true);
  if (!store) return tl::unexpected(store.error());
  NamedSessions named{std::move(*store), sites.empty() ? names[0] : sites[0], {}};
  const auto contents = server::ReadSite(*named.store, named.site);
  if (!contents) return tl::unexpected(contents.error());
  for (std::size_t i = 1; i < names.size(); ++i) {
    const auto found = server::FindSession(*contents, names[i]);
    if (!found) return tl::unexpected(found.error());
    named.sessions.push_back(*found);
  }
  return named;
}

bool AreOneFile(const std::string& one, const std::string& other) {
  std::error_code error;
  const auto whole = [&error](const std::string& path) {
    return std::filesystem::weakly_canonical(std::filesystem::absolute(path, error), error);
  };
  return whole(one) == whole(other) && !error;
}

ExitCode Split(Program& program, const SiteArguments& arguments) {
  const std::string& output = arguments.output;
  if (arguments.state.empty() && (AreOneFile(output, arguments.names[0]) || AreOneFile(output, arguments.rest))) {
    program.err() << "cairn: the new site would replace the rest of the old one; write it into another file\n";
    return ExitCode::kUsage;
  }
  const auto named = OpenSessions(arguments);
  if (!named) return program.Refuse(named.error());
  Store& store = *named->store;
  const std::string& site = named->site;
  if (auto split = server::SplitSite(store, site, named->sessions, arguments.as); !split)
    return program.Refuse(split.error());
  if (arguments.state.empty()) {
    // The rest may replace the file that was read. By then, what it lacks is on the disk.
    const auto written = server::WriteSiteFile(store, arguments.as, arguments.output);
    if (written && !arguments.rest.empty()) {
      const auto rest = server::WriteSiteFile(store, site, arguments.rest);
      if (!rest) return program.Refuse(rest.error());
    }
    return PrintSummary(program, written);
  }
  return program.Print(
      fmt::format("{} sessions of site {} are site {} now\n", named->sessions.size(), site, arguments.as),
      {{"site", site}, {"new_site", arguments.as}, {"sessions", named->sessions}});
}

// By the number of a session that cannot be read: no site lists it. Nothing if it is none of those.
std::optional<ExitCode> DeleteUnreadable(Program& program, const SiteArguments& arguments) {
  std::uint64_t session = 0;
  const std::string& text = arguments.names[1];
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), session);
  if (arguments.state.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  const auto store = OpenToEdit(arguments.state, true);
  if (!store) return std::nullopt;
  if (auto deleted = server::DeleteUnreadable(**store, session); !deleted) {
    if (deleted.error().code == StatusCode::kNotFound) return std::nullopt;
    return program.Refuse(deleted.error());
  }
  if (auto removed = server::RemoveRests(**store); !removed) return program.Refuse(removed.error());
  return program.Print(fmt::format("session {} deleted, which could not be read\n", session),
                       {{"session", text}, {"deleted", true}});
}

ExitCode DeleteSession(Program& program, const SiteArguments& arguments) {
  if (const auto done = DeleteUnreadable(program, arguments)) return *done;
  const auto named = OpenSessions(arguments);
  if (!named) return program.Refuse(named.error());
  Store& store = *named->store;
  const std::string& site = named->site;
  for (const std::uint64_t session : named->sessions) {
    if (auto deleted = server::DeleteSession(store, site, session); !deleted) return program.Refuse(deleted.error());
  }
  if (arguments.state.empty()) return PrintSummary(program, server::WriteSiteFile(store, site, arguments.output));
  if (auto removed = server::RemoveRests(store); !removed) return program.Refuse(removed.error());
  return program.Print(fmt::format("{} of site {} deleted\n", arguments.names[1], site),
                       {{"site", site}, {"session", arguments.names[1]}, {"deleted", true}});
}

ExitCode DeleteJob(Program& program, const SiteArguments& arguments, std::uint64_t job) {
  const auto store = OpenToEdit(arguments.state, true);
  if (!store) return program.Refuse(store.error());
  if (auto deleted = server::DeleteJob(**store, job); !deleted) return program.Refuse(deleted.error());
  return program.Print(fmt::format("job {} deleted\n", job), {{"job", job}, {"deleted", true}});
}

// A command whose result goes either into the state directory or into a new file.
CLI::App* AddEdit(CLI::App& site, SiteArguments& arguments, const std::string& name, const std::string& help,
                  const std::string& names_help) {
  auto* command = site.add_subcommand(name, help);
  command->add_option("names", arguments.names, names_help)->required();
  auto* state =
      command->add_option("--state", arguments.state, "State directory of a stopped server; without it, files");
  auto* output = command->add_option("-o,--output", arguments.output, "File to write, where files are given");
  output->excludes(state);
  return command;
}

// Either --state or -o is needed, which CLI11 can not say of options that exclude each other.
template <typename Run>
void OnEdit(Program& program, CLI::App& command, std::shared_ptr<SiteArguments> arguments, Run run) {
  program.OnChosen(command, arguments, [run](Program& chosen, const SiteArguments& given) {
    if (given.state.empty() && given.output.empty()) {
      chosen.err() << "cairn: name the state directory with --state, or the file to write with -o\n";
      return ExitCode::kUsage;
    }
    return run(chosen, given);
  });
}

void AddTransfer(CLI::App& site, Program& program) {
  auto listed = std::make_shared<SiteArguments>();
  auto* list =
      site.add_subcommand("list", "All sites and saved sites of the server, or the sites of a state directory");
  list->add_option("--state", listed->state, "State directory of a stopped server; its sessions are listed as well");
  program.OnChosen(*list, listed, List);
  auto exported = std::make_shared<SiteArguments>();
  auto* write = site.add_subcommand("export", "Write a site of a stopped server into a file");
  write->add_option("site", exported->names, "The site's name")->required()->expected(1);
  write->add_option("-o,--output", exported->output, "The file to write")->required()->type_name("FILE");
  write->add_option("--state", exported->state, "State directory of the stopped server")->required();
  program.OnChosen(*write, exported, ExportStored);
  auto imported = std::make_shared<SiteArguments>();
  auto* read = site.add_subcommand("import", "Add the site of a file to the state of a stopped server");
  read->add_option("file", imported->names, "The file of a saved site")->required()->expected(1);
  read->add_option("--state", imported->state, "State directory; it is made where it is missing")->required();
  read->add_option("--as", imported->as, "The site's name from now on [as in the file]");
  read->add_option("--rename", imported->renames, "New name of a robot that has a session in another site")
      ->type_name("OLD=NEW")
      ->allow_extra_args(false);
  program.OnChosen(*read, imported, Import);
}

}  // namespace

void AddStoredSites(CLI::App& site, Program& program) {
  AddTransfer(site, program);
  auto merged = std::make_shared<SiteArguments>();
  auto* merge = AddEdit(site, *merged, "merge", "Make one site of two, with all sessions of both",
                        "The site that stays, and the one that becomes part of it");
  merge->get_option("names")->expected(2);
  AddParsed(*merge, "--transform", merged->T_into_from, ParseStart,
            "Where the origin of the second site is in the map of the first one [0,0,0]", "X,Y,THETA");
  merge->add_option("--rename", merged->renames, "New name of a robot of the second file that both have")
      ->type_name("OLD=NEW")
      ->allow_extra_args(false);
  OnEdit(program, *merge, merged, Merge);
  auto split = std::make_shared<SiteArguments>();
  auto* divide = AddEdit(site, *split, "split", "Move sessions with their part of the map into a new site",
                         "The site, and robots or numbers of sessions");
  divide->get_option("names")->expected(2, 1024);
  divide->add_option("--to", split->as, "Name of the new site")->required();
  divide->add_option("--rest", split->rest, "File to write with what is left of the site, where files are given");
  OnEdit(program, *divide, split, Split);
  auto deleted = std::make_shared<SiteArguments>();
  auto* remove = AddEdit(site, *deleted, "delete-session", "Remove a session with its scans and its part of the map",
                         "The site, and a robot or the number of a session");
  remove->get_option("names")->expected(2);
  OnEdit(program, *remove, deleted, DeleteSession);
  auto of_job = std::make_shared<SiteArguments>();
  auto job = std::make_shared<std::uint64_t>(0);
  auto* forget =
      site.add_subcommand("delete-job", "Remove a job from a stopped server, such as one that cannot be read");
  forget->add_option("job", *job, "The job's number")->required();
  forget->add_option("--state", of_job->state, "State directory of the stopped server")->required();
  program.OnChosen(*forget, of_job,
                   [job](Program& chosen, const SiteArguments& given) { return DeleteJob(chosen, given, *job); });
}

}  // namespace cairn::client
