#include "server/jobs/job_list.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

namespace cairn::server {
namespace {

// Shortest time between two progress messages of one job. People do not need them more often.
constexpr auto kProgressPeriod = std::chrono::milliseconds(200);
// So many servers may die while a job runs. Kills have other causes as well, so one or two say nothing about the job.
constexpr std::uint32_t kMostAttempts = 8;

// It looked for something to join and found nothing. Servers submit such jobs by themselves, again and again.
bool IsVain(const Job& job) {
  return job.kind == JobKind::kJoin && job.state == JobState::kSucceeded && job.map_version == 0;
}

}  // namespace

JobList::JobList(const JobsOptions& options, Outbound& outbound, std::function<Stamp()> now, Journal* journal)
    : options_(options), outbound_(outbound), now_(std::move(now)), journal_(journal) {}

Result<std::vector<StoredJob>> JobList::Restore() {
  if (journal_ == nullptr) return std::vector<StoredJob>{};
  const auto ids = journal_->store().Owners(RecordKind::kJob);
  if (!ids) return tl::unexpected(ids.error());
  return AddStored(*ids);
}

Result<std::vector<StoredJob>> JobList::AddStored(const std::vector<std::uint64_t>& ids) {
  std::vector<StoredJob> unfinished;
  const MutexLock lock(mutex_);
  for (const std::uint64_t id : ids) {
    if (auto restored = RestoreOne(id, unfinished); !restored) return tl::unexpected(restored.error());
  }
  return unfinished;
}

Result<void> JobList::RestoreOne(std::uint64_t id, std::vector<StoredJob>& unfinished) {
  const auto take = [&](std::uint64_t, std::string_view bytes) CAIRN_NO_THREAD_SAFETY_ANALYSIS -> Result<void> {
    auto stored = JobOf(bytes);
    if (!stored) return tl::unexpected(stored.error());
    const bool ends_servers = stored->job.state == JobState::kRunning && stored->attempts >= kMostAttempts;
    if (ends_servers) {
      stored->job.state = JobState::kFailed;
      stored->job.ended = now_();
      stored->job.message = "the server ended " + std::to_string(stored->attempts) +
                            " times while this job ran, perhaps because it needs more memory than there is";
      spdlog::error("job {} of site {} is given up: {}", id, stored->job.site, stored->job.message);
    } else if (!IsFinal(stored->job.state)) {
      stored->job.state = JobState::kQueued;
      stored->job.progress = 0.0;
      unfinished.push_back(*stored);
    }
    Entry& entry = jobs_[id];
    entry.job = stored->job;
    entry.enable = stored->enable;
    entry.attempts = stored->attempts;
    entry.control = std::make_shared<JobControl>([this, id](double progress) { Progress(id, progress); });
    entry.unsent = true;
    next_ = std::max(next_, id + 1);
    if (ends_servers) ChangedLocked(entry);
    return {};
  };
  const auto unreadable = [&](std::uint64_t, const Status& why) CAIRN_NO_THREAD_SAFETY_ANALYSIS {
    spdlog::error("{}", journal_->set_aside().Add({}, "job " + std::to_string(id), why));
    next_ = std::max(next_, id + 1);  // No other job may be written over it.
  };
  return ReadEach(journal_->store(), {.kind = RecordKind::kJob, .owner = id}, take, unreadable);
}

std::uint64_t JobList::ReserveIds(std::uint64_t count) {
  const MutexLock lock(mutex_);
  return std::exchange(next_, next_ + count);
}

void JobList::RemoveSite(const std::string& site) {
  const MutexLock lock(mutex_);
  for (auto it = jobs_.begin(); it != jobs_.end();) {
    const Job& job = it->second.job;
    if (job.site != site || !IsFinal(job.state)) {
      ++it;
      continue;
    }
    replaced_.push_back(job);
    it = jobs_.erase(it);
  }
  RetireReplaced();
}

Result<Job> JobList::Add(const std::string& site, JobKind kind, bool enable, const JobSubject& about) {
  const MutexLock lock(mutex_);
  if (!MakeRoom()) return cairn::Fail(StatusCode::kResourceExhausted, std::string(kTooManyUnfinished));
  const std::uint64_t id = next_++;
  Entry& entry = jobs_[id];
  entry.job.id = id;
  entry.job.site = site;
  entry.job.kind = kind;
  entry.job.robot = about.robot;
  entry.job.places = about.places;
  entry.job.submitted = now_();
  entry.enable = enable;
  entry.control = std::make_shared<JobControl>([this, id](double progress) { Progress(id, progress); });
  ChangedLocked(entry);
  return entry.job;
}

bool JobList::HasRoom() const {
  const MutexLock lock(mutex_);
  return jobs_.size() < static_cast<std::size_t>(options_.max_kept) ||
         std::ranges::any_of(jobs_, [](const auto& one) { return IsFinal(one.second.job.state); });
}

bool JobList::Start(std::uint64_t id) {
  const MutexLock lock(mutex_);
  const auto found = jobs_.find(id);
  if (found == jobs_.end() || found->second.job.state != JobState::kQueued) return false;
  found->second.job.state = JobState::kRunning;
  found->second.job.started = now_();
  ++found->second.attempts;
  ChangedLocked(found->second);
  return true;
}

void JobList::Succeed(std::uint64_t id, const JobOutcome& outcome) {
  End(id, JobState::kSucceeded, [&outcome](Job& job) {
    job.progress = 1.0;
    job.cost_before = outcome.cost_before;
    job.cost_after = outcome.cost_after;
    job.map_version = outcome.map_version;
    job.message = outcome.message;
    job.places = outcome.places;
  });
}

void JobList::Fail(std::uint64_t id, const Status& status) {
  const JobState state = status.code == StatusCode::kCancelled ? JobState::kCancelled : JobState::kFailed;
  End(id, state, [&status](Job& job) { job.message = status.message; });
}

void JobList::End(std::uint64_t id, JobState state, const std::function<void(Job&)>& fill) {
  const MutexLock lock(mutex_);
  const auto found = jobs_.find(id);
  if (found == jobs_.end() || IsFinal(found->second.job.state)) return;
  Job& job = found->second.job;
  job.state = state;
  job.ended = now_();
  fill(job);
  ChangedLocked(found->second);
  if (IsVain(job)) RemoveVainBefore(job);
}

void JobList::RemoveVainBefore(const Job& last) {
  for (auto it = jobs_.begin(); it != jobs_.end();) {
    if (it->first >= last.id || it->second.job.site != last.site || !IsVain(it->second.job)) {
      ++it;
      continue;
    }
    if (journal_ != nullptr) journal_->Remove({.kind = RecordKind::kJob, .owner = it->first});
    replaced_.push_back(std::move(it->second.job));
    it = jobs_.erase(it);
  }
  RetireReplaced();
}

Result<Job> JobList::Cancel(std::uint64_t id) {
  const MutexLock lock(mutex_);
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) return cairn::Fail(StatusCode::kNotFound, "no job " + std::to_string(id));
  Job& job = found->second.job;
  if (IsFinal(job.state)) {
    return cairn::Fail(StatusCode::kFailedPrecondition,
                       "job " + std::to_string(id) + " has already ended: " + std::string(JobStateName(job.state)));
  }
  found->second.control->Cancel();
  if (job.state == JobState::kQueued) {
    job.state = JobState::kCancelled;
    job.ended = now_();
    job.message = "cancelled before it started";
    ChangedLocked(found->second);
  }
  return job;
}

void JobList::CancelAll() {
  {
    const MutexLock lock(mutex_);
    // This is no attempt that ended the server.
    for (auto& [id, entry] : jobs_) {
      if (stopping_ || entry.job.state != JobState::kRunning) continue;
      --entry.attempts;
      ChangedLocked(entry);
    }
    stopping_ = true;
  }
  for (const Job& job : OfSite({})) {
    if (!IsFinal(job.state)) static_cast<void>(Cancel(job.id));
  }
}

Result<Job> JobList::Find(std::uint64_t id) const {
  const MutexLock lock(mutex_);
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) return cairn::Fail(StatusCode::kNotFound, "no job " + std::to_string(id));
  return found->second.job;
}

std::vector<Job> JobList::OfSite(const std::string& site) const {
  const MutexLock lock(mutex_);
  std::vector<Job> jobs;
  for (const auto& [id, entry] : jobs_) {
    if (site.empty() || entry.job.site == site) jobs.push_back(entry.job);
  }
  return jobs;
}

bool JobList::EndsServers(const std::string& site, JobKind kind) const {
  const MutexLock lock(mutex_);
  return std::any_of(jobs_.begin(), jobs_.end(), [&](const auto& one) {
    const Entry& entry = one.second;
    return entry.job.site == site && entry.job.kind == kind && entry.job.state == JobState::kFailed &&
           entry.attempts >= kMostAttempts;
  });
}

std::shared_ptr<const JobControl> JobList::ControlOf(std::uint64_t id) const {
  const MutexLock lock(mutex_);
  const auto found = jobs_.find(id);
  return found == jobs_.end() ? nullptr : found->second.control;
}

void JobList::Tick() {
  const MutexLock lock(mutex_);
  for (auto& [id, entry] : jobs_) {
    if (entry.unsent) SendLocked(entry);
  }
  RetireReplaced();
}

void JobList::Progress(std::uint64_t id, double progress) {
  const MutexLock lock(mutex_);
  const auto found = jobs_.find(id);
  if (found == jobs_.end() || found->second.job.state != JobState::kRunning) return;
  Entry& entry = found->second;
  entry.job.progress = std::clamp(progress, entry.job.progress, 1.0);
  const auto now = std::chrono::steady_clock::now();
  if (now - entry.progress_sent < kProgressPeriod) return;
  entry.progress_sent = now;
  SendLocked(entry);
}

void JobList::ChangedLocked(Entry& entry) {
  // First to the journal: a client that learns of the change may save the site at once, and the change must be in the
  // file.
  if (journal_ != nullptr && !stopping_) {
    journal_->Put({RecordKind::kJob, entry.job.id, 0},
                  [stored = StoredJob{entry.job, entry.enable, entry.attempts}] { return BytesOf(stored); });
  }
  SendLocked(entry);
}

void JobList::SendLocked(Entry& entry) {
  entry.unsent = !outbound_.Send(entry.job);
}

bool JobList::MakeRoom() {
  if (jobs_.size() < static_cast<std::size_t>(options_.max_kept)) return true;
  // One that has ended servers goes last: while it is remembered, the server does not submit another by itself.
  auto oldest = std::find_if(jobs_.begin(), jobs_.end(), [](const auto& one) {
    return IsFinal(one.second.job.state) && one.second.attempts < kMostAttempts;
  });
  if (oldest == jobs_.end())
    oldest = std::find_if(jobs_.begin(), jobs_.end(), [](const auto& one) { return IsFinal(one.second.job.state); });
  if (oldest == jobs_.end()) return false;
  if (journal_ != nullptr) journal_->Remove({.kind = RecordKind::kJob, .owner = oldest->first});
  replaced_.push_back(std::move(oldest->second.job));
  jobs_.erase(oldest);
  RetireReplaced();
  return true;
}

void JobList::RetireReplaced() {
  while (!replaced_.empty() && outbound_.Send(Retired{replaced_.back()})) replaced_.pop_back();
}

}  // namespace cairn::server
