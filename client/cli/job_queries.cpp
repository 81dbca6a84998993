#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

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

}  // namespace

void AddJobQueries(CLI::App& job, Program& program) {
  auto site = std::make_shared<std::string>();
  auto* list = job.add_subcommand("list", "List the jobs of all sites, or of one");
  list->add_option("--site", *site, "Only this site's jobs");
  program.OnChosen(*list, site, ListJobs);
  AddJobCommand(job, program, "show", "Show one job", &QueryClient::GetJob);
  AddJobCommand(job, program, "cancel", "Cancel a job that has not ended; nothing of its work is kept",
                &QueryClient::CancelJob);
}

}  // namespace cairn::client
