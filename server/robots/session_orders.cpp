// What people and other parts of the server tell a session's estimator to do (session.h).
#include <cmath>
#include <string>
#include <utility>

#include "server/maps/localising_tiles.h"
#include "server/robots/session.h"

namespace cairn::server {
namespace {

// How often a robot that is only localised gets a map that others draw, or that people edit.
constexpr std::chrono::minutes kDrawnPeriod{10};
constexpr std::chrono::seconds kEditedPeriod{10};

tl::unexpected<Status> TooMany() {
  return cairn::Fail(StatusCode::kResourceExhausted, "too many commands wait for the robot's estimator");
}

}  // namespace

void Session::End(const Status& reason, std::shared_ptr<Receipt> receipt) {
  if (record_.phase() == SessionPhase::kEnded) {  // A repeated request gets the same answer.
    AnnounceState();
    if (receipt) receipt->Taken();
    return;
  }
  const bool first = !ending_.exchange(true);
  if (!first && !receipt) return;
  Finish finish;
  finish.final = first;
  finish.reason = reason;
  finish.done = [self = shared_from_this(), reason, first, receipt = std::move(receipt)] {
    if (first) self->Finished(SessionPhase::kEnded, reason);
    if (receipt && self->record_.phase() == SessionPhase::kEnded) receipt->Taken();
  };
  if (first) {
    EnqueueAll();
    queue_.Push(std::move(finish));
  } else if (!queue_.PushAgain(std::move(finish))) {
    return;  // The receipt says that it was not taken.
  }
  Schedule();
}

Result<void> Session::Relocalise(const std::optional<Pose2>& T_map_robot, std::shared_ptr<Receipt> receipt) {
  if (ending_) return cairn::Fail(StatusCode::kFailedPrecondition, "the session has ended");
  if (T_map_robot && record_.joining().fragment && !record_.localises())
    return cairn::Fail(StatusCode::kFailedPrecondition,
                       "the robot is not joined with the map of its site, so no pose in that map can be used");
  if (!queue_.Push(RelocaliseWanted{T_map_robot, std::move(receipt)})) return TooMany();
  Schedule();
  return {};
}

bool Session::Post(PlaceFound&& found) {
  if (!queue_.Push(std::move(found))) return false;
  Schedule();
  return true;
}

Result<void> Session::Localise(std::shared_ptr<const MapSnapshot> map, std::shared_ptr<Receipt> receipt) {
  if (ending_) return cairn::Fail(StatusCode::kFailedPrecondition, "the session has ended");
  if (!IsSmallEnoughToLocaliseIn(*map))
    return cairn::Fail(StatusCode::kFailedPrecondition, "the map of its site is wider than " +
                                                            std::to_string(std::lround(slam::KnownGrid::kMostM)) +
                                                            " m: robots are localised in smaller ones only");
  const KnownMap known{map->info.epoch, map->info.version, map->info.edits_version, SessionRecord::Clock::now()};
  const MutexLock lock(known_map_mutex_);
  if (!queue_.Push(LocaliseWanted{std::move(map), false, std::move(receipt)})) return TooMany();
  known_map_ = known;
  Schedule();
  return {};
}

Result<void> Session::MapAgain(std::shared_ptr<Receipt> receipt) {
  if (ending_) return cairn::Fail(StatusCode::kFailedPrecondition, "the session has ended");
  if (record_.joining().fragment)
    return cairn::Fail(StatusCode::kFailedPrecondition,
                       "the robot is not joined with the map of its site: it can only open a new session");
  if (record_.localises() && !record_.snapshot().status.pose.localized)
    return cairn::Fail(
        StatusCode::kFailedPrecondition,
        "the robot's place in the map is not known: it can map again once it is localized. Let it drive, "
        "or say where it is: cairn robot relocalise " +
            record_.state().robot + " --here X,Y,THETA");
  if (!queue_.Push(LocaliseWanted{nullptr, false, std::move(receipt)})) return TooMany();
  Schedule();
  return {};
}

void Session::KeepUpWith(const std::shared_ptr<const MapSnapshot>& map) {
  if (record_.phase() != SessionPhase::kActive) return;
  const auto now = SessionRecord::Clock::now();
  const MutexLock lock(known_map_mutex_);
  const bool moved = !known_map_ || known_map_->epoch != map->info.epoch;
  const auto since = known_map_ ? now - known_map_->given : now.time_since_epoch();
  const bool drawn = since > kDrawnPeriod && known_map_ && known_map_->version != map->info.version;
  const bool edited = since > kEditedPeriod && known_map_ && known_map_->edits_version != map->info.edits_version;
  if (!moved && !drawn && !edited) return;
  if (!IsSmallEnoughToLocaliseIn(*map)) return;         // It goes on in the map as it was while it was small enough.
  if (!queue_.Push(LocaliseWanted{map, true})) return;  // The next call tries again.
  known_map_ = {map->info.epoch, map->info.version, map->info.edits_version, now};
  Schedule();
}

}  // namespace cairn::server
