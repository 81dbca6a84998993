// The part of the mapper that follows a robot whose place is not certain.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/geometry/rotated_covariance.h"
#include "server/slam/mapper_state.h"
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

// Whether at least the share `least` of the beams shows the same range.
bool LookAlike(const Scan& a, const Scan& b, double least, const RecoveryOptions& options) {
  if (a.ranges_m.size() != b.ranges_m.size() || a.angle_first_rad != b.angle_first_rad) return false;
  std::size_t compared = 0, same = 0;
  for (std::size_t i = 0; i < a.ranges_m.size(); ++i) {
    const BeamClass class_a = ClassifyRange(a.ranges_m[i], a.range_min_m, a.range_max_m),
                    class_b = ClassifyRange(b.ranges_m[i], b.range_min_m, b.range_max_m);
    if (class_a != BeamClass::kHit && class_b != BeamClass::kHit) continue;
    ++compared;
    const double difference_m = std::abs(static_cast<double>(a.ranges_m[i]) - b.ranges_m[i]);
    const double allowed_m = options.same_range_m + options.same_range_per_m * a.ranges_m[i];
    same += class_a == class_b && difference_m < allowed_m ? 1 : 0;
  }
  return compared > 0 && static_cast<double>(same) >= least * static_cast<double>(compared);
}

}  // namespace

// Loses the robot's place where no scan can confirm it. Returns what lies before the scan; without odometry, a new
// odometry means no more than a pause of unknown length.
Passage Mapper::State::BeginAfter(Passage passage, bool tilted) {
  if (!options.front_end.use_odometry) passage = std::min(passage, Passage::kUnwatched);
  if (passage == Passage::kUnknown || (passage != Passage::kDriven && tilted)) LosePlace(passage != Passage::kUnknown);
  return passage;
}

// Doubts the robot's place where scans are missing before this one, unless the scan shows that the robot stood still or
// went on along its path.
void Mapper::State::CheckPlace(Passage passage, bool rolling, TrackedScan& tracked, const Pose2& T_odom_robot,
                               const ParallelFor& parallel_for) {
  auto& [still, view, step] = tracked;
  const bool driven = passage == Passage::kDriven;
  // A scan that was measured in a fast turn may be deformed, and no longer fit what the robot has just seen.
  const bool judged = driven && !(rolling && std::abs(LastTurn()) > kFastTurnRad);
  const auto before_carried = judged ? BeforeCarried(*still, view.points_robot, step) : std::nullopt;
  const bool watched = (driven && !before_carried) || StoodStill(*still, T_odom_robot, step) ||
                       (passage == Passage::kPaused && GoesOn(*still, view.points_robot, T_odom_robot, step));
  if (!watched && passage != Passage::kUnknown) step = DoubtPlace(view, T_odom_robot, step, parallel_for);
  if (before_carried && recovery.on_path()) {
    recovery.BeginDoubt(before_carried->before, step.score, before_carried->at_several_places);
  }
  last_scan = LastScan{still, T_odom_robot, step.T_track_robot};
}

// Between the last two scans.
double Mapper::State::LastTurn() const {
  const auto& scans = trail.scans();
  if (scans.size() < 2) return 0.0;
  const auto heading = [this](const MapperSnapshot::ScanPlace& place) {
    return (trail.shapes()[place.keyframe].T_track_robot * place.T_keyframe_robot).theta;
  };
  return AngleDiff(heading(scans.back()), heading(scans[scans.size() - 2]));
}

// If somebody may have carried the robot since the last scan: how that agreed with the last keyframes.
std::optional<Mapper::State::SignOfCarrying> Mapper::State::BeforeCarried(const Scan& scan,
                                                                          const std::vector<SurfacePoint>& points_robot,
                                                                          const TrackStep& step) const {
  if (!options.self_check.enabled || !HasMap() || recovery.active() || !last_scan) return std::nullopt;
  if (!MayBeCarried(LastScore(), step.score)) return std::nullopt;
  const std::vector<SurfacePoint> last_points = Look(*last_scan->scan, options.front_end).points_robot;
  const SeenScan last{*last_scan->scan, last_points, last_scan->T_track_robot, LastScore()};
  const SceneAgreement before = AgreementWithLast(trail, last);
  const SeenScan now{scan, points_robot, step.T_track_robot, step.score};
  if (!LooksCarried(trail, last, before, now)) return std::nullopt;
  return SignOfCarrying{before, DiffersAtSeveralPlaces(trail, now)};
}

// Ends the doubt if the scan agrees again with the last keyframes, or if the scans since then contradict each other
// too, because then something moves past the robot. What was held is added to its path.
void Mapper::State::EndDoubt(const Scan& scan, const std::vector<SurfacePoint>& points_robot, const TrackStep& step,
                             const ParallelFor& parallel_for) {
  if (!step.matched || recovery.was_carried()) return;
  const SceneAgreement& before = recovery.doubt()->before;
  const SeenScan now{scan, points_robot, step.T_track_robot, step.score};
  // The first scan since then was matched with what it may not belong to.
  const std::vector<RecentScan>& recent = recovery.recent();
  const auto since = std::span(recent).subspan(std::min<std::size_t>(1, recent.size()));
  if (StaysDifferent(before, AgreementWithLast(trail, now), ConflictWith(since, now))) return;
  const std::vector<Recovery::Held> held = recovery.TakeHeld();
  recovery.End();
  AddHeld(held, parallel_for);
}

// From now on the robot has to be found again.
void Mapper::State::LosePlace(bool odometry_goes_on) {
  if (!HasMap()) return;
  if (!recovery.active()) {
    recovery.Begin(LastKnown(), odometry_goes_on);
  } else if (!odometry_goes_on) {
    recovery.OdometryBeganAnew();
  }
  recovery.ForgetScans();
  front_end.Restart();
}

// As Mapper::Relocalise.
void Mapper::State::Relocalise(const std::optional<Pose2>& T_map_robot) {
  if (localisation) {
    if (T_map_robot) {
      localisation->BeginWhereSaid(*T_map_robot);
    } else {
      localisation->Lose(false);
    }
    front_end.Restart();
    return;
  }
  if (!HasMap() || !last_scan) return;
  Recovery::Known known = LastKnown();
  if (T_map_robot) {
    known.T_map_robot = *T_map_robot;
    known.T_odom_robot = OdometryOrNone(last_scan->T_odom_robot);
    known.covariance = PoseCovariance(options.recovery.place.near_m, options.recovery.place.near_rad);
    recovery.BeginWhereSaid(known);
  } else {
    recovery.Begin(known, false);
  }
  front_end.Restart();
}

Mapper::LostView Mapper::SeenWhileLost() const {
  const State& s = *state_;
  const Recovery& recovery = s.localisation ? s.localisation->recovery() : s.recovery;
  const bool only_doubted = recovery.doubt() && !recovery.was_carried();
  LostView view{recovery.active() && !only_doubted, recovery.has_scans(), recovery.recent()};
  if (!view.lost) return {};
  if (recovery.was_said() && s.last_scan) {
    view.T_map_said =
        recovery.BeliefAt(s.OdometryOrNone(s.last_scan->T_odom_robot), s.last_scan->T_track_robot).T_map_robot;
  }
  if (!view.since_lost && s.last_scan) {
    view.scans = {{s.last_scan->scan, s.last_scan->T_track_robot, 0.0,
                   Look(*s.last_scan->scan, s.options.front_end).points_robot}};
  }
  return view;
}

bool Mapper::SuggestPlace(Stamp seen, const Pose2& T_map_robot, std::shared_ptr<const SearchedMap> map) {
  return !state_->localisation && state_->recovery.Suggest(seen, T_map_robot, std::move(map));
}

bool Mapper::has_suggestion() const {
  return state_->recovery.suggested();
}

void Mapper::ForgetSuggestion() {
  state_->recovery.ForgetSuggestion();
}

std::vector<WeightedPose> Mapper::UnconfirmedPlaces() const {
  const Recovery& recovery = state_->localisation ? state_->localisation->recovery() : state_->recovery;
  std::vector<WeightedPose> places;
  if (!recovery.active()) return places;
  const std::vector<Pose2> poses = recovery.Unconfirmed();
  for (const Pose2& pose : poses) places.push_back({pose, 1.0 / static_cast<double>(poses.size())});
  return places;
}

// Whether nothing at all has changed since the last scan: nobody has moved the robot.
bool Mapper::State::StoodStill(const Scan& scan, const Pose2& T_odom_robot, const TrackStep& step) const {
  if (!last_scan || !step.matched) return false;
  const Pose2 moved = options.front_end.use_odometry ? Between(last_scan->T_odom_robot, T_odom_robot) : Pose2{};
  const RecoveryOptions& limits = options.recovery;
  return moved.translation().norm() < limits.still_m && std::abs(moved.theta) < limits.still_rad &&
         LookAlike(*last_scan->scan, scan, step.degenerate ? limits.unchanged_along_corridor : limits.unchanged,
                   limits);
}

// Whether the scan shows the position after a short pause, and this is where odometry has taken the robot.
bool Mapper::State::FollowsOdometry(const Scan& scan, const Pose2& T_odom_robot, const TrackStep& step) const {
  if (!last_scan || !step.matched || step.degenerate) return false;
  const RecoveryOptions& limits = options.recovery;
  const std::uint64_t pause_ns = NanosBetween(last_scan->scan->stamp, scan.stamp);
  if (pause_ns > static_cast<std::uint64_t>(limits.short_pause_s * kNanosPerSecond)) return false;
  const Pose2 odometry = Between(last_scan->T_odom_robot, T_odom_robot);
  const Pose2 error = Between(odometry, Between(last_scan->T_track_robot, step.T_track_robot));
  const double allowed_m = limits.as_odometry_m + limits.as_odometry_per_m * odometry.translation().norm();
  return error.translation().norm() <= allowed_m && std::abs(error.theta) <= limits.as_odometry_rad;
}

// Whether the robot has certainly driven on by itself during a short pause: the scan shows its position, this is where
// odometry has taken it, and the scan agrees with the map there, or no worse than the last scan before the pause.
bool Mapper::State::GoesOn(const Scan& scan, const std::vector<SurfacePoint>& points_robot, const Pose2& T_odom_robot,
                           const TrackStep& step) const {
  if (!HasMap() || recovery.active() || !options.front_end.use_odometry) return false;
  const PosePath path = believed_path();
  const PathMap own_map(trail, path, options.recovery.place, options.self_check.near_m);
  return FollowsOdometry(scan, T_odom_robot, step) &&
         AgreesAsBefore(scan, points_robot, step, {recovery, own_map, T_map_track()});
}

// Whether the scan agrees with the map where the track leads, or hardly worse than the last scan.
bool Mapper::State::AgreesAsBefore(const Scan& scan, const std::vector<SurfacePoint>& points_robot,
                                   const TrackStep& step, const TrackInMap& track) const {
  using Agreement = PlaceSearch::Agreement;
  const Agreement now = track.recovery.Compare(scan, points_robot, track.T_map_track * step.T_track_robot, track.map);
  if (now != Agreement::kDoubtful) return now == Agreement::kAgrees;
  const std::vector<SurfacePoint> last_points = Look(*last_scan->scan, options.front_end).points_robot;
  const Pose2 T_map_last = track.T_map_track * last_scan->T_track_robot;
  if (track.recovery.Compare(*last_scan->scan, last_points, T_map_last, track.map) == Agreement::kDoubtful) return true;
  const auto conflict = [](const VisibilityCounts& counts) {
    return static_cast<double>(counts.contradicted) / std::max(counts.known(), 1);
  };
  const double least = 0.5 * options.recovery.place.max_conflict;
  return conflict(track.map.Compare(scan, points_robot, track.T_map_track * step.T_track_robot)) <
         conflict(track.map.Compare(*last_scan->scan, last_points, T_map_last)) + least;
}

// Scans are missing before this one. If it matches the last scans, the robot is probably still on its path, which must
// be confirmed; otherwise it has to be found.
TrackStep Mapper::State::DoubtPlace(const ScanView& view, const Pose2& T_odom_robot, const TrackStep& step,
                                    const ParallelFor& parallel_for) {
  if (!HasMap()) return step;
  if (!recovery.active() && step.matched) {
    recovery.BeginOnPath(LastKnown(), T_map_track());
    return step;
  }
  LosePlace(true);
  return front_end.Track(view, T_odom_robot, parallel_for);
}

// Follows a robot whose place is not certain, until its place is confirmed.
ScanOutcome Mapper::State::Recover(Keyframe keyframe, ScanView view, TrackStep step, const ParallelFor& parallel_for) {
  const Stamp stamp = keyframe.scan->stamp;
  const Pose2 T_odom_robot = keyframe.T_odom_robot;
  recovery.AgeSuggestion();
  if (!step.matched) {
    recovery.ForgetScans();
    front_end.Restart();
    step = front_end.Track(view, T_odom_robot, parallel_for);
    last_scan->T_track_robot = step.T_track_robot;
  }
  const bool first = !recovery.has_scans();
  const bool on_path = recovery.on_path();
  const Pose2 T_track_kept = on_path ? trail.shapes().back().T_track_robot : step.T_track_robot;
  const Pose2 T_track_last = recovery.LastKept(T_track_kept);
  // The second scan of a doubted robot is the first that is matched with what it belongs to.
  const bool second = recovery.doubt() && recovery.recent().size() == 1;
  const bool keep =
      second || MovedEnough(Between(T_track_last, step.T_track_robot), options.gate) || (first && !on_path);
  if (keep) front_end.AddKeyframe(view);
  if (on_path) {
    blind.Add(step, T_track_last);
    if (keep) recovery.Hold({keyframe, step, blind.TakeCovariance()});
  }
  if (keep || first) {
    const PosePath path = believed_path();
    const auto found = recovery.Take({keyframe.scan, OdometryOrNone(T_odom_robot)}, step, view.points_robot,
                                     PathMap(trail, path, options.recovery.place, options.self_check.near_m));
    if (found && found->on_path) return GoOnAlongPath(parallel_for);
    if (!found && keep && recovery.doubted_in_vain()) return GoOnAlongPath(parallel_for);
    if (found) return GoOnAt(*found, std::move(keyframe), std::move(view), step, parallel_for);
  }
  return ReportRecovery(stamp, T_odom_robot, step.T_track_robot);
}

// The robot has been found on its path: the keyframes since then are added to it.
ScanOutcome Mapper::State::GoOnAlongPath(const ParallelFor& parallel_for) {
  const std::vector<Recovery::Held> held = recovery.TakeHeld();
  recovery.End();
  const Recovery::Held& now = held.back();
  AddHeld(std::span(held).first(held.size() - 1), parallel_for);
  AddKeyframe(now.keyframe, Look(*now.keyframe.scan, options.front_end), now.step, now.step_covariance, parallel_for);
  return Report(now.keyframe.scan->stamp, now.keyframe.T_odom_robot, now.step, true);
}

void Mapper::State::AddHeld(std::span<const Recovery::Held> held, const ParallelFor& parallel_for) {
  for (const Recovery::Held& one : held) {
    AddKeyframe(one.keyframe, Look(*one.keyframe.scan, options.front_end), one.step, one.step_covariance, parallel_for);
    trail.AddScan(one.keyframe.scan->stamp, {});
  }
}

// By how much a step from the last keyframe to a place of the map is uncertain because the pose of that keyframe in the
// map is: the covariance of (x, y, theta) in the frame in which the step starts.
Eigen::Matrix3d Mapper::State::DoubtOfStep(const Pose2& T_prev_curr) const {
  const FilterEstimate last = filter->estimate();
  const Eigen::Matrix3d J =
      J_compose_right(last.T_map_robot, T_prev_curr).inverse() * J_compose_left(last.T_map_robot, T_prev_curr);
  return J * last.covariance * J.transpose();
}

// The place found as seen from the nearest keyframe. Each hypothesis has a map of its own, in which that place is not
// where the best one has it.
RevisitObservation Mapper::State::SeenFromNearest(const FoundPlace& place) const {
  const PosePath path = believed_path();
  std::size_t nearest = 0;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < trail.size(); ++k) {
    const double distance_m = (path[k].translation() - place.T_map_robot.translation()).norm();
    if (!trail.keyframes()[k].localized || distance_m >= nearest_m) continue;
    nearest = k;
    nearest_m = distance_m;
  }
  return {nearest, Between(path[nearest], place.T_map_robot), Rotated(place.covariance, -path[nearest].theta)};
}

// The robot has been found: the path goes on there, with a step from the last keyframe that no scan or odometry shows.
// A place that only the map of others shows is not told as seen from a keyframe: by this the error of the map of one
// hypothesis would become that of the place in all others.
ScanOutcome Mapper::State::GoOnAt(const Recovery::Found& found, Keyframe keyframe, ScanView view, TrackStep step,
                                  const ParallelFor& parallel_for) {
  const FoundPlace& place = found.place;
  const Stamp stamp = keyframe.scan->stamp;
  const Pose2 T_odom_robot = keyframe.T_odom_robot;
  const Pose2 T_map_last = believed_path()[trail.size() - 1];
  const Pose2 T_track_robot = trail.shapes().back().T_track_robot * Between(T_map_last, place.T_map_robot);
  front_end.MoveTo(T_track_robot * step.T_track_robot.Inverse());
  step.T_track_robot = T_track_robot;
  step.T_track_held.reset();
  step.found = true;
  blind.Found(Rotated(place.covariance, -T_map_last.theta));
  recovery.End();
  self_check.Forget();
  loops.ForgetUnconfirmed();
  Regained regained;
  if (found.elsewhere) {
    regained.elsewhere = {place.T_map_robot, place.covariance};
  } else {
    regained.revisit = SeenFromNearest(place);
  }
  AddKeyframe(std::move(keyframe), std::move(view), step, blind.TakeCovariance(), parallel_for, std::move(regained));
  speed.Forget();
  return Report(stamp, T_odom_robot, step, true);
}

ScanOutcome Mapper::State::ReportRecovery(Stamp stamp, const Pose2& T_odom_robot, const Pose2& T_track_robot) const {
  const Recovery::Belief belief = recovery.BeliefAt(OdometryOrNone(T_odom_robot), T_track_robot);
  ScanOutcome outcome;
  outcome.stamp = stamp;
  outcome.T_map_robot = belief.T_map_robot;
  outcome.T_map_odom = outcome.T_map_robot * T_odom_robot.Inverse();
  outcome.covariance = belief.covariance;
  outcome.reason = belief.reason;
  return outcome;
}

}  // namespace cairn::slam
