#include "server/jobs/lost_robots.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <string>
#include <utility>

#include "server/ops/log_context.h"

namespace cairn::server {
namespace {

constexpr auto kLookEvery = std::chrono::milliseconds(500);
constexpr auto kLongestWait = std::chrono::minutes(10);

bool IsLost(const SessionRecord& record) {
  if (record.phase() != SessionPhase::kActive || record.joining().fragment || record.localises()) return false;
  const PoseReport pose = record.snapshot().status.pose;
  return record.begun() && !pose.localized && pose.reason == PoseReason::kLost;
}

}  // namespace

void LostRobots::Tick(Clock::time_point now) {
  if (options_.relocalise_after_s <= 0.0 || now - looked_ < kLookEvery) return;
  looked_ = now;
  const auto first =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options_.relocalise_after_s));
  std::map<SessionId, Watched> lost;
  Watched* next = nullptr;  // That has waited longest.
  SessionState state_of_next;
  for (const auto& session : roster_.All()) {
    if (!IsLost(session->record())) continue;
    const auto known = lost_.find(session->id());
    Watched& one = lost[session->id()];
    one = known == lost_.end() ? Watched{first, now + first} : known->second;
    if (now < one.due || (next != nullptr && next->due <= one.due)) continue;
    SessionState state = session->record().state();
    if (!MayLookFor(state)) continue;
    next = &one;
    state_of_next = std::move(state);
  }
  if (next != nullptr) {
    LookFor(state_of_next);
    next->wait = std::min<Clock::duration>(2 * next->wait, kLongestWait);
    next->due = now + next->wait;
  }
  lost_ = std::move(lost);
}

void LostRobots::LookFor(const SessionState& state) {
  const LogContext context(AboutRobot(state.robot, state.site));
  if (const auto job = worker_.Submit(state.site, JobKind::kRelocalise, true, "", {state.robot}); !job)
    spdlog::warn("robot {}: no job to look for it could be submitted: {}", state.robot, job.error().message);
}

bool LostRobots::MayLookFor(const SessionState& state) const {
  const auto in_the_way = [&state](const Job& job) {
    return !IsFinal(job.state) && (OnlyLooks(job) || job.robot == state.robot);
  };
  return std::ranges::none_of(jobs_.OfSite({}), in_the_way) && !jobs_.EndsServers(state.site, JobKind::kRelocalise);
}

}  // namespace cairn::server
