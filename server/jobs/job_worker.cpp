#include "server/jobs/job_worker.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <exception>
#include <string>
#include <utility>

#include "server/ops/log_context.h"

namespace cairn::server {
namespace {

// On Linux the nice value is set per thread. A failure is ignored: the job then runs at normal priority.
void LowerOwnPriority(std::int64_t nice) {
  static_cast<void>(setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), static_cast<int>(nice)));
}

Status TooManyWait() {
  return {StatusCode::kResourceExhausted, "too many jobs are waiting (jobs.max_queued); try again later"};
}

}  // namespace

JobWorker::JobWorker(const JobsOptions& options, JobList& list, JobWork work)
    : options_(options),
      list_(list),
      work_(std::move(work)),
      // One more than may be submitted: after a restart the job that ran waits again as well.
      changes_(static_cast<std::size_t>(options.max_queued) + 1),
      looks_(static_cast<std::size_t>(options.max_queued) + 1) {}

JobWorker::~JobWorker() {
  Stop();
}

void JobWorker::Start() {
  changing_ = std::jthread([this] { Run(changes_); });
  looking_ = std::jthread([this] { Run(looks_); });
}

Result<Job> JobWorker::Submit(const std::string& site, JobKind kind, bool enable, const std::string& request,
                              const JobSubject& about) {
  auto job = list_.Add(site, kind, enable, about);
  if (!job) return job;
  Queue& queue = QueueOf(*job);
  if (IsFull(queue) || !queue.TryPush(Ticket{job->id, enable, request})) {
    list_.Fail(job->id, TooManyWait());
    return tl::unexpected(TooManyWait());
  }
  return job;
}

Result<void> JobWorker::CheckRoomToLook() const {
  if (IsFull(looks_)) return tl::unexpected(TooManyWait());
  if (!list_.HasRoom()) return Fail(StatusCode::kResourceExhausted, std::string(kTooManyUnfinished));
  return {};
}

void JobWorker::Requeue(std::uint64_t id, bool enable) {
  const auto job = list_.Find(id);
  if (job && !QueueOf(*job).TryPush(Ticket{id, enable, {}})) list_.Fail(id, TooManyWait());
}

void JobWorker::Cancel() {
  changes_.Close();
  looks_.Close();
  list_.CancelAll();
}

void JobWorker::Stop() {
  Cancel();
  for (std::jthread* const thread : {&changing_, &looking_})
    if (thread->joinable()) thread->join();
}

void JobWorker::Run(Queue& queue) {
  LowerOwnPriority(options_.nice);
  while (const auto ticket = queue.Pop()) {
    try {
      RunOne(*ticket);
    } catch (const std::exception& error) {  // Thrown by the list of jobs; what the work throws is caught in Work.
      spdlog::error("job {}: its state could not be changed because of an exception: {}", ticket->id, error.what());
      GiveUp(ticket->id);
    }
  }
}

// Otherwise it would be called running for ever, and others of its site would wait for it.
void JobWorker::GiveUp(std::uint64_t job) {
  try {
    list_.Fail(job, {StatusCode::kInternal, "an exception; see the server's log"});
  } catch (const std::exception& error) {
    spdlog::error("job {}: it could not be given up either: {}", job, error.what());
  }
}

void JobWorker::RunOne(const Ticket& ticket) {
  if (!list_.Start(ticket.id)) return;
  const auto job = list_.Find(ticket.id);
  const auto control = list_.ControlOf(ticket.id);
  LogSubject fields;
  fields.request = ticket.request;
  fields.site = job->site;
  fields.job = job->id;
  const LogContext context(std::move(fields));
  spdlog::info("job {}: started, {} of site {}", job->id, JobKindName(job->kind), job->site);
  const auto outcome = Work(*job, ticket.enable, *control);
  if (outcome) {
    std::string made;
    if (outcome->map_version > 0)
      made = fmt::format(", map version {}, disagreement {:.0f} -> {:.0f} mm", outcome->map_version,
                         1000.0 * std::sqrt(outcome->cost_before), 1000.0 * std::sqrt(outcome->cost_after));
    spdlog::info("job {}: succeeded{} ({})", job->id, made, outcome->message);
    list_.Succeed(ticket.id, *outcome);
  } else {
    spdlog::info("job {}: ended without a result: {}", job->id, outcome.error().message);
    list_.Fail(ticket.id, outcome.error());
  }
}

Result<JobOutcome> JobWorker::Work(const Job& job, bool enable, const JobControl& control) const {
  try {
    return work_(job, enable, control);
  } catch (const std::exception& error) {
    spdlog::error("job {} of site {} failed with an exception: {}", job.id, job.site, error.what());
    return Fail(StatusCode::kInternal, std::string("the job failed with an exception: ") + error.what());
  }
}

}  // namespace cairn::server
