#include "client/cli/commands.h"
#include "client/cli/job_wait.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

struct SmoothArguments {
  std::string site;
  bool wait = false;
  bool no_enable = false;
};

ExitCode Smooth(Program& program, const SmoothArguments& arguments) {
  auto job = program.Ask(
      [&](QueryClient& server) { return server.SubmitJob(arguments.site, JobKind::kSmooth, !arguments.no_enable); });
  if (job && arguments.wait) job = WaitForEnd(program, *job);
  if (!job) return program.Refuse(job.error());
  program.Print(FormatJob(*job) + "\n", *job);
  return !arguments.wait || job->state == JobState::kSucceeded ? ExitCode::kOk : ExitCode::kFailed;
}

ExitCode PrintJobs(Program& program, const Result<std::vector<Job>>& jobs) {
  if (!jobs) return program.Refuse(jobs.error());
  std::string text = jobs->empty() ? "no job\n" : "";
  for (const Job& job : *jobs) text += FormatJob(job) + "\n";
  return program.Print(text, {{"jobs", *jobs}});
}

ExitCode ListJobs(Program& program, const std::string& site) {
  return PrintJobs(program, program.Ask([&](QueryClient& server) { return server.Jobs(site); }));
}

// A command about the job of one number; `ask` is a method of QueryClient.
void AddJobCommand(CLI::App& job, Program& program, const std::string& name, const std::string& help,
                   Result<Job> (QueryClient::*ask)(std::uint64_t)) {
  auto id = std::make_shared<std::uint64_t>();
  auto* command = job.add_subcommand(name, help);
  command->add_option("id", *id, "The job's number")->required()->check(InRange(1, 1e15));
  program.OnChosen(*command, id, [ask](Program& p, std::uint64_t number) {
    const auto answer = p.Ask([&](QueryClient& server) { return (server.*ask)(number); });
    return PrintJobs(p, answer.map([](const Job& one) { return std::vector<Job>{one}; }));
  });
}

void AddJobSmooth(CLI::App& job, Program& program) {
  auto* command = job.add_subcommand("smooth", "Smooth the site's whole trajectories and redraw its map from them");
  command->footer(
      "The job makes a new map version. It is enabled at once (a new epoch), unless --no-enable; `cairn map rollback`\n"
      "goes back. Robots stream on meanwhile. With --wait the exit code says whether the job succeeded; interrupting\n"
      "only stops the waiting.\n"
      "EXAMPLES\n  cairn job smooth --site hall --wait\n  cairn job smooth --site hall --no-enable --json");
  auto arguments = std::make_shared<SmoothArguments>();
  command->add_option("--site", arguments->site, "The site's name")->required();
  command->add_flag("--wait", arguments->wait, "Wait until the job has ended");
  command->add_flag("--no-enable", arguments->no_enable, "Only make the version; enable it later by map enable");
  program.OnChosen(*command, arguments, Smooth);
}

void AddJobQueries(CLI::App& job, Program& program) {
  auto site = std::make_shared<std::string>();
  auto* list = job.add_subcommand("list", "List the jobs of all sites, or of one");
  list->add_option("--site", *site, "Only this site's jobs");
  program.OnChosen(*list, site, ListJobs);
  AddJobCommand(job, program, "show", "Show one job", &QueryClient::GetJob);
  AddJobCommand(job, program, "cancel", "Cancel a job that has not ended; nothing of its work is kept",
                &QueryClient::CancelJob);
}

}  // namespace

void AddJob(CLI::App& app, Program& program) {
  auto* job = app.add_subcommand("job", "Work that the server does in the background: submit, list, show, cancel");
  job->require_subcommand(1);
  AddJobSmooth(*job, program);
  AddJobQueries(*job, program);
}

}  // namespace cairn::client
