// The part of the mapper that follows a robot in the map of others, and maps nothing.
#include <algorithm>
#include <cmath>
#include <utility>

#include "server/slam/mapper_state.h"

namespace cairn::slam {
GridLocalisationOptions Mapper::State::LocalisationOptions() const {
  return {.recovery = options.recovery,
          .loop = options.loop,
          .self_check = options.self_check,
          .align = options.front_end.refine,
          .surface = options.front_end.surface,
          .gate = options.gate,
          .drift = options.filter.back_end.drift,
          .blind = options.blind,
          .odometry_walk = options.odometry_walk,
          .uses_odometry = options.front_end.use_odometry,
          .lost_after_m = options.lost_after_m};
}

// As Mapper::LocaliseIn, with a map.
void Mapper::State::LocaliseIn(std::shared_ptr<const KnownGrid> map, bool place_known) {
  if (localisation) return localisation->Replace(std::move(map));
  drawing.Finish(trail.keyframes(), believed_path());
  const bool said = place_known && !recovery.active() && (trail.empty() || level.outcome.localized);
  Recovery::Known known = LastKnown();
  if (trail.empty()) known = {filter->estimate().T_map_robot, {}, Eigen::Matrix3d::Zero()};
  if (last_scan) known.T_odom_robot = OdometryOrNone(last_scan->T_odom_robot);
  known.covariance = PoseCovariance(options.recovery.place.near_m, options.recovery.place.near_rad);
  recovery.End();
  localisation.emplace(LocalisationOptions());
  localisation->Begin(std::move(map), known, said);
  front_end.Restart();
}

// The robot maps again, from where it is in the known map. What it has mapped before must show that it is there.
Result<void> Mapper::State::MapAgain() {
  if (!localisation) return {};
  const GridLocalisation::Place place = localisation->place();
  if (localisation->looking() || !last_scan)
    return Fail(StatusCode::kFailedPrecondition, "the robot's place in the map is not known");
  localisation.reset();
  front_end.Restart();
  static_cast<void>(blind.TakeCovariance());
  speed.Forget();
  if (!trail.empty()) {
    recovery.BeginWhereSaid({place.T_map_robot, OdometryOrNone(last_scan->T_odom_robot), place.covariance});
    return {};
  }
  filter = MakeFilter(options.filter.kind, options.filter, place.T_map_robot, static_cast<std::uint64_t>(options.seed));
  last_scan.reset();
  return {};
}

// Returns what lies before the scan. A tilted scan shows nothing, so that what it was doubted for would be forgotten.
Passage Mapper::State::LocaliseAfter(Passage passage, bool tilted) {
  if (!options.front_end.use_odometry) passage = std::min(passage, Passage::kUnwatched);
  if (tilted && passage != Passage::kDriven) {
    localisation->Lose(passage != Passage::kUnknown && options.front_end.use_odometry);
    front_end.Restart();
  }
  return passage;
}

// If somebody may have carried the robot since the last scan: how that agreed with the known map.
std::optional<Mapper::State::SignOfCarrying> Mapper::State::BeforeCarriedInMap(
    const Scan& scan, const std::vector<SurfacePoint>& points_robot, const TrackStep& step) const {
  if (!options.self_check.enabled || localisation->looking() || !last_scan) return std::nullopt;
  if (!MayBeCarried(LastScore(), step.score)) return std::nullopt;
  const std::vector<SurfacePoint> last_points = Look(*last_scan->scan, options.front_end).points_robot;
  const SeenScan last{*last_scan->scan, last_points, last_scan->T_track_robot, LastScore()};
  const FollowedMap followed{*localisation->map(), localisation->T_map_track()};
  const SceneAgreement before = AgreementWithMap(followed, last);
  const SeenScan now{scan, points_robot, step.T_track_robot, step.score};
  if (!LooksCarried(followed, last, before, now)) return std::nullopt;
  return SignOfCarrying{before, DiffersAtSeveralPlaces(last, now)};
}

ScanOutcome Mapper::State::Localise(TrackedScan tracked, const Pose2& T_odom_robot, Passage passage, bool rolling,
                                    const ParallelFor& parallel_for) {
  auto& [still, view, step] = tracked;
  const auto goes_on = [&, &still = still, &view = view, &step = step] {
    return passage == Passage::kPaused && options.front_end.use_odometry && !localisation->looking() &&
           FollowsOdometry(*still, T_odom_robot, step) &&
           AgreesAsBefore(*still, view.points_robot, step,
                          {localisation->recovery(), *localisation->map(), localisation->T_map_track()});
  };
  const bool driven = passage == Passage::kDriven;
  const bool watched = driven || StoodStill(*still, T_odom_robot, step) || goes_on();
  // A scan that was measured in a fast turn may be deformed, and no longer fit what the robot has just seen.
  const bool deformed =
      rolling && last_scan && std::abs(AngleDiff(T_odom_robot.theta, last_scan->T_odom_robot.theta)) > kFastTurnRad;
  const auto before_carried = driven && !deformed ? BeforeCarriedInMap(*still, view.points_robot, step) : std::nullopt;
  if (before_carried && !StoodStill(*still, T_odom_robot, step))
    localisation->Doubt(before_carried->before, step.score, before_carried->at_several_places);
  learning.LearnUnless(!driven || localisation->looking() || !options.front_end.use_odometry, step);
  // The last scans do not belong together with this one.
  if (!watched || (!step.matched && localisation->looking())) {
    localisation->Lose(options.front_end.use_odometry && passage != Passage::kUnknown);
    front_end.Restart();
    step = front_end.Track(view, T_odom_robot, parallel_for);
  }
  last_scan = LastScan{still, T_odom_robot, step.T_track_robot};
  SetLastScore(step.score);
  const Keyframe seen{still, OdometryOrNone(T_odom_robot)};
  GridLocalisation::Followed followed = localisation->Take({seen, view.points_robot, step});
  if (step.T_track_held && !localisation->looking())
    followed.place.T_map_robot = followed.place.T_map_robot * Between(step.T_track_robot, *step.T_track_held);
  if (followed.is_reference) front_end.AddKeyframe(view);
  return ReportLocalised(still->stamp, T_odom_robot, followed.place, step.score);
}

ScanOutcome Mapper::State::ReportLocalised(Stamp stamp, const Pose2& T_odom_robot, const GridLocalisation::Place& place,
                                           double score) const {
  ScanOutcome outcome;
  outcome.stamp = stamp;
  outcome.T_map_robot = place.T_map_robot;
  outcome.T_map_odom = outcome.T_map_robot * T_odom_robot.Inverse();
  outcome.covariance = place.covariance;
  outcome.score = score;
  outcome.reason = place.reason;
  outcome.localized = place.localized();
  // It is followed, with too much doubt.
  if (!outcome.localized && outcome.reason == PoseReason::kTracking) outcome.reason = PoseReason::kOdometryOnly;
  return outcome;
}

Result<void> Mapper::LocaliseIn(std::shared_ptr<const KnownGrid> map, bool place_known) {
  if (map == nullptr) return state_->MapAgain();
  state_->LocaliseIn(std::move(map), place_known);
  return {};
}

bool Mapper::localises() const {
  return state_->localisation.has_value();
}

std::optional<std::uint32_t> Mapper::known_map_epoch() const {
  if (!state_->localisation) return std::nullopt;
  return state_->localisation->map()->source().epoch;
}

std::shared_ptr<const KnownGrid> Mapper::known_map() const {
  return state_->localisation ? state_->localisation->map() : nullptr;
}

void Mapper::ShareKnownMap(std::shared_ptr<const KnownGrid> same) {
  if (state_->localisation) state_->localisation->ShareMap(std::move(same));
}

}  // namespace cairn::slam
