#include "server/jobs/job_worker.h"

#include <sys/resource.h>
#include <unistd.h>

#include <utility>

namespace cairn::server {
namespace {

// On Linux, niceness belongs to the thread. Failing is harmless: the job is only less polite.
void LowerOwnPriority(std::int64_t nice) {
  static_cast<void>(setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), static_cast<int>(nice)));
}

}  // namespace

JobWorker::JobWorker(const JobsOptions& options, JobList& list, std::map<JobKind, JobWork> works)
    : options_(options), list_(list), works_(std::move(works)), queue_(static_cast<std::size_t>(options.max_queued)) {}

JobWorker::~JobWorker() {
  Stop();
}

void JobWorker::Start() {
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

Result<Job> JobWorker::Submit(const std::string& site, JobKind kind, bool enable) {
  if (!works_.contains(kind)) {
    return Fail(StatusCode::kUnimplemented, "no job of kind '" + std::string(JobKindName(kind)) + "' is offered");
  }
  auto job = list_.Add(site, kind);
  if (job && !queue_.TryPush(Ticket{job->id, enable})) {
    const Status full{StatusCode::kResourceExhausted, "too many jobs are waiting (jobs.max_queued)"};
    list_.Fail(job->id, full);
    return tl::unexpected(full);
  }
  return job;
}

void JobWorker::Stop() {
  queue_.Close();
  list_.CancelAll();
  if (thread_.joinable()) {
    thread_.request_stop();
    thread_.join();
  }
}

void JobWorker::Run(const std::stop_token& stop) {
  LowerOwnPriority(options_.nice);
  while (const auto ticket = queue_.Pop(stop)) {
    if (!list_.Start(ticket->id)) continue;
    const auto job = list_.Find(ticket->id);
    const auto control = list_.ControlOf(ticket->id);
    const auto outcome = works_.at(job->kind)(*job, ticket->enable, *control);
    if (outcome) {
      list_.Succeed(ticket->id, *outcome);
    } else {
      list_.Fail(ticket->id, outcome.error());
    }
  }
}

}  // namespace cairn::server
