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
  for (const auto& session : roster_.All()) {
    if (!IsLost(session->record())) continue;
    const auto known = lost_.find(session->id());
    Watched& one = lost[session->id()];
    one = known == lost_.end() ? Watched{first, now + first} : known->second;
    const SessionState state = session->record().state();
    if (now < one.due || !MayLookFor(state.site)) continue;
    const LogContext context(AboutRobot(state.robot, state.site));
    if (const auto job = worker_.Submit(state.site, JobKind::kRelocalise, true, "", {state.robot}); !job)
      spdlog::warn("robot {}: no job to look for it could be submitted: {}", state.robot, job.error().message);
    one.wait = std::min<Clock::duration>(2 * one.wait, kLongestWait);
    one.due = now + one.wait;
  }
  lost_ = std::move(lost);
}

bool LostRobots::MayLookFor(const std::string& site) const {
  return std::ranges::all_of(jobs_.OfSite({}), [](const Job& job) { return IsFinal(job.state); }) &&
         !jobs_.EndsServers(site, JobKind::kRelocalise);
}

}  // namespace cairn::server
