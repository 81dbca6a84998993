#include "client/cli/recorder.h"

#include <fmt/format.h>

#include <algorithm>

namespace cairn::client {
namespace {

using bag::LogLevel;

constexpr std::int64_t kTellAgain = 1'000'000'000;  // Between two lines about the losses of one stream.
constexpr std::size_t kMaxStreams = 8192;
constexpr std::size_t kMaxJobs = 16384;

bool Holds(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}
bool IsNameOf(NameId id, const std::string& name) {
  return HashName(name) == id && ValidateName("a name", name).has_value();
}

}  // namespace

Result<void> Recorder::Take(RecordEvent&& event) {
  if (!IsNamed(event)) {
    waiting_bytes_ += event.bytes();
    waiting_.push_back(std::move(event));
    while (waiting_bytes_ > kMaxWaitingBytes) {
      waiting_bytes_ -= waiting_.front().bytes();
      waiting_.pop_front();
      ++account_.nameless;
    }
    return {};
  }
  auto taken = std::visit([&](auto& value) { return On(value, event.time); }, event.value);
  return taken && named_ ? TakeWaiting() : taken;
}

bool Recorder::IsNamed(const RecordEvent& event) const {
  if (const auto* const scan = std::get_if<ScanSample>(&event.value))
    return robots_.count(scan->stream.robot_id) > 0 && sensors_.count(scan->stream.sensor_id) > 0;
  if (const auto* const odometry = std::get_if<OdometrySample>(&event.value))
    return robots_.count(odometry->stream.robot_id) > 0;
  return true;
}

Result<void> Recorder::TakeWaiting() {
  named_ = false;
  Result<void> taken;
  std::deque<RecordEvent> waiting = std::exchange(waiting_, {});
  waiting_bytes_ = 0;
  for (RecordEvent& event : waiting) {
    if (taken && IsNamed(event)) {
      taken = std::visit([&](auto& value) { return On(value, event.time); }, event.value);
    } else {
      waiting_bytes_ += event.bytes();
      waiting_.push_back(std::move(event));
    }
  }
  return taken;
}

Recorder::Robot* Recorder::Learn(NameId id, const std::string& name, const std::string& site) {
  auto known = robots_.find(id);
  if (known == robots_.end()) {
    if (robots_.size() >= kMaxRobots || !IsNameOf(id, name)) return nullptr;
    known = robots_.emplace(id, Robot{.name = name, .site = {}, .state = {}}).first;
    named_ = true;
  }
  if (!site.empty() && known->second.site != site && ValidateName("a site", site)) {
    known->second.site = site;
    if (Wants(known->second)) AddSite(site);
  }
  return &known->second;
}

bool Recorder::Wants(const Robot& robot) const {
  if (!options_.robots.empty()) return Holds(options_.robots, robot.name);
  return options_.sites.empty() || Holds(options_.sites, robot.site);
}

bool Recorder::WantsSite(const std::string& site) const {
  if (!options_.sites.empty()) return Holds(options_.sites, site);
  return options_.robots.empty() || sites_.count(site) > 0;
}

void Recorder::AddSite(const std::string& site) {
  if (sites_.size() < kMaxSites && (options_.sites.empty() || Holds(options_.sites, site))) sites_.insert(site);
}

Result<bool> Recorder::IsNew(const StreamId& id, std::uint64_t sequence, const std::string& robot, const char* what,
                             std::int64_t time) {
  if (streams_.size() >= kMaxStreams && streams_.count({id.robot_id, id.sensor_id}) == 0) return false;
  Stream& stream = streams_[{id.robot_id, id.sensor_id}];
  if (stream.session != id.session) {
    stream.session = id.session;
    stream.last = 0;
  }
  if (sequence <= stream.last) {  // They begin with 1.
    ++account_.repeated;
    return false;
  }
  const bool begins = stream.last == 0;
  const std::uint64_t missing = sequence - stream.last - 1;
  stream.last = sequence;
  if (missing == 0) return true;
  if (!begins) account_.missing += missing;
  auto logged = begins
                    ? file_.AddLog(LogLevel::kInfo, robot, fmt::format("{} from number {} on", what, sequence), time)
                    : file_.AddLog(LogLevel::kWarning, robot,
                                   fmt::format("{} {} before number {} did not arrive", missing, what, sequence), time);
  if (!logged) return tl::unexpected(logged.error());
  return true;
}

Result<void> Recorder::On(ScanSample& sample, std::int64_t time) {
  Robot& robot = robots_.at(sample.stream.robot_id);
  if (!Wants(robot)) return {};
  const auto is_new = IsNew(sample.stream, sample.scan.sequence, robot.name, "scans", time);
  if (!is_new || !*is_new) return is_new ? Result<void>{} : tl::unexpected(is_new.error());
  robot.recorded = true;
  return file_.Add(robot.name, sensors_.at(sample.stream.sensor_id), sample.stream.session, sample.scan, time);
}

Result<void> Recorder::On(OdometrySample& sample, std::int64_t time) {
  Robot& robot = robots_.at(sample.stream.robot_id);
  if (!Wants(robot)) return {};
  const auto is_new = IsNew(sample.stream, sample.odometry.sequence, robot.name, "samples of odometry", time);
  if (!is_new || !*is_new) return is_new ? Result<void>{} : tl::unexpected(is_new.error());
  robot.recorded = true;
  return file_.Add(robot.name, sample.stream.session, sample.odometry, time);
}

Result<void> Recorder::On(PoseReport& pose, std::int64_t time) {
  Robot* const robot = Learn(pose.robot_id, pose.robot, pose.site);
  if (robot == nullptr || !Wants(*robot) || pose.site != robot->site) return {};
  if (!pose.T_map_robot.IsFinite() || !pose.T_map_odom.IsFinite()) return {};
  robot->recorded = true;
  pose.robot = robot->name;
  if (std::exchange(robot->reason, pose.reason) != pose.reason) {
    auto logged =
        file_.AddLog(pose.localized ? LogLevel::kInfo : LogLevel::kWarning, robot->name,
                     std::string(PoseReasonName(pose.reason)) + (pose.localized ? "" : ", not localized"), time);
    if (!logged) return logged;
  }
  return file_.Add(pose, time);
}

Result<void> Recorder::On(SessionState& state, std::int64_t time) {
  if (auto noted = NoteGeneration(state.generation, time); !noted) return noted;
  Robot* const robot = Learn(state.robot_id, state.robot, state.site);
  if (robot == nullptr || !Wants(*robot)) return {};
  const SessionState before = std::exchange(robot->state, state);
  // A session that had ended before the recorder came is no news.
  if (before.session == 0 && state.phase == SessionPhase::kEnded) return {};
  if (before.phase == state.phase && before.session == state.session && before.stale == state.stale) return {};
  std::string text = fmt::format("session {} in site {}", SessionPhaseName(state.phase), robot->site);
  if (state.stale) text += ", a stream stands still";
  if (!state.status.message.empty()) text += ": " + state.status.message;
  const bool good = !state.stale && (state.phase == SessionPhase::kActive || state.phase == SessionPhase::kEnded);
  return file_.AddLog(good ? LogLevel::kInfo : LogLevel::kWarning, robot->name, text, time);
}

Result<void> Recorder::On(Ledger& ledger, std::int64_t time) {
  Robot* const robot = Learn(ledger.robot_id, ledger.robot, ledger.site);
  if (robot == nullptr) return {};
  if (sensors_.size() < kMaxSensors && IsNameOf(ledger.sensor_id, ledger.sensor))
    named_ = sensors_.emplace(ledger.sensor_id, ledger.sensor).second || named_;
  if (!Wants(*robot)) return {};
  const auto known = streams_.find({ledger.robot_id, ledger.sensor_id});
  if (known == streams_.end()) return {};
  Stream& stream = known->second;
  if (ledger.dropped_total() <= stream.dropped || time - stream.told < kTellAgain) return {};
  stream.told = time;
  stream.dropped = ledger.dropped_total();
  std::string text = fmt::format("the server has dropped {} of {} samples of {}:", stream.dropped, ledger.received,
                                 sensors_.count(ledger.sensor_id) > 0 ? sensors_[ledger.sensor_id] : "a sensor");
  for (int i = 0; i < kDropReasonCount; ++i) {
    const std::uint64_t count = ledger.dropped[static_cast<std::size_t>(i)];
    if (count > 0) text += fmt::format(" {} {}", count, DropReasonName(static_cast<DropReason>(i)));
  }
  return file_.AddLog(LogLevel::kWarning, robot->name, text, time);
}

Result<void> Recorder::On(Job& job, std::int64_t time) {
  if (!WantsSite(job.site) || !ValidateName("a site", job.site)) return {};
  const auto known = jobs_.find(job.id);
  if (known == jobs_.end() && jobs_.size() >= kMaxJobs) return {};
  if (known != jobs_.end() && known->second == job.state) return {};
  jobs_[job.id] = job.state;
  if (known == jobs_.end() && IsFinal(job.state)) return {};  // The server tells the jobs of days.
  std::string text = fmt::format("job {} ({}): {}", job.id, JobKindName(job.kind), JobStateName(job.state));
  if (!job.message.empty()) text += ": " + job.message;
  return file_.AddLog(job.state == JobState::kFailed ? LogLevel::kError : LogLevel::kInfo, job.site, text, time);
}

Result<void> Recorder::On(MapInfo& info, std::int64_t time) {
  if (auto noted = NoteGeneration(info.generation, time); !noted) return noted;
  if (!IsNameOf(info.site_id, info.site) || !WantsSite(info.site)) return {};
  AddSite(info.site);
  if (sites_.count(info.site) == 0) return {};
  const auto [epoch, is_new] = epochs_.try_emplace(info.site, info.epoch);
  if (is_new || std::exchange(epoch->second, info.epoch) == info.epoch) return {};
  return file_.AddLog(LogLevel::kInfo, info.site,
                      fmt::format("the whole map has changed: version {} is enabled", info.enabled_version), time);
}

Result<void> Recorder::NoteGeneration(Generation generation, std::int64_t time) {
  if (generation <= generation_) return {};
  if (std::exchange(generation_, generation) == 0) return {};
  return file_.AddLog(LogLevel::kWarning, "recorder", "the server was started again", time);
}

std::vector<std::string> Recorder::robots() const {
  std::vector<std::string> names;
  for (const auto& [id, robot] : robots_)
    if (robot.recorded) names.push_back(robot.name);
  std::sort(names.begin(), names.end());
  return names;
}

Recorder::Account Recorder::account() const {
  Account account = account_;
  account.nameless += waiting_.size();
  return account;
}

}  // namespace cairn::client
