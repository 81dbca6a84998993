#include "client/cli/commands.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

ExitCode AskJobs(Program& program, const Request& request) {
  const auto reply = program.Ask(request);
  if (!reply) return program.Refuse(reply.error());
  std::string text = reply->jobs.empty() ? "no job\n" : "";
  nlohmann::json jobs = nlohmann::json::array();
  for (const Job& job : reply->jobs) {
    text += FormatJob(job) + "\n";
    jobs.push_back(ToJson(job));
  }
  return program.Print(text, {{"jobs", jobs}});
}

void Run(CLI::App& command, Program& program, const std::shared_ptr<Request>& request) {
  command.callback(
      [&program, request] { program.action = [&program, request] { return AskJobs(program, *request); }; });
}

}  // namespace

void AddJobQueries(CLI::App& job, Program& program) {
  auto list = std::make_shared<Request>();
  list->kind = RequestKind::kJobList;
  auto* list_command = job.add_subcommand("list", "All jobs, or one site's");
  list_command->add_option("--site", list->site, "Only this site's");
  Run(*list_command, program, list);

  auto show = std::make_shared<Request>();
  show->kind = RequestKind::kJobGet;
  auto* show_command = job.add_subcommand("show", "One job");
  show_command->add_option("id", show->job, "The job's number")->required()->check(InRange(1, 1e15));
  Run(*show_command, program, show);

  auto cancel = std::make_shared<Request>();
  cancel->kind = RequestKind::kJobCancel;
  auto* cancel_command = job.add_subcommand("cancel", "End a job that has not ended; nothing of it is kept");
  cancel_command->add_option("id", cancel->job, "The job's number")->required()->check(InRange(1, 1e15));
  Run(*cancel_command, program, cancel);
}

}  // namespace cairn::client
