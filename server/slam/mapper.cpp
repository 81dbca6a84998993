#include "server/slam/mapper.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/slam/blind_motion.h"
#include "server/slam/loops/loop_search.h"
#include "server/slam/loops/revisit_search.h"
#include "server/slam/loops/self_check.h"
#include "server/slam/map_drawing.h"
#include "server/slam/methods.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/recovery.h"
#include "server/slam/scan/beam_points.h"
#include "server/slam/scan/stamp_gate.h"
#include "server/slam/tracking/front_end.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {
namespace {

bool IsLocalized(PoseReason reason) {
  return reason != PoseReason::kLost && reason != PoseReason::kDiverged;
}

// A robot stood still if its odometry has changed by less, and so many of the beams show what they showed before.
constexpr double kStillM = 0.02;
constexpr double kStillRad = 0.02;
constexpr double kSameRangeM = 0.1;
constexpr double kSameRangePerM = 0.01;
constexpr double kUnchanged = 0.95;
constexpr double kUnchangedAlongCorridor = 0.98;  // Most beams show the same everywhere along it.

bool LookAlike(const Scan& a, const Scan& b, double least) {
  if (a.ranges_m.size() != b.ranges_m.size() || a.angle_first_rad != b.angle_first_rad) return false;
  std::size_t compared = 0, same = 0;
  for (std::size_t i = 0; i < a.ranges_m.size(); ++i) {
    const BeamClass class_a = ClassifyRange(a.ranges_m[i], a.range_min_m, a.range_max_m),
                    class_b = ClassifyRange(b.ranges_m[i], b.range_min_m, b.range_max_m);
    if (class_a != BeamClass::kHit && class_b != BeamClass::kHit) continue;
    ++compared;
    const double difference_m = std::abs(static_cast<double>(a.ranges_m[i]) - b.ranges_m[i]);
    same += class_a == class_b && difference_m < kSameRangeM + kSameRangePerM * a.ranges_m[i] ? 1 : 0;
  }
  return compared > 0 && static_cast<double>(same) >= least * static_cast<double>(compared);
}

}  // namespace

struct Mapper::State {
  State(const MapperOptions& given, const Pose2& T_map_robot_start, std::uint64_t seed)
      : options(given),
        front_end(given.front_end, MakeMatcher(given.matcher, given.matching)),
        blind(given.blind, given.front_end.use_odometry, given.lost_after_m),
        trail(given.filter.back_end.drift),
        revisits(given.revisit, given.front_end.refine),
        filter(MakeFilter(given.filter.kind, given.filter, T_map_robot_start, seed)),
        loops(given.loop, given.front_end.refine),
        self_check(given.self_check),
        recovery(given.loop, given.self_check, given.front_end.refine, given.blind, given.lost_after_m),
        drawing(given.grid) {}

  ScanOutcome Coast(Stamp stamp, const Pose2& T_odom_robot);
  void LosePlace(bool odometry_goes_on);
  // Before, the next scan defines the start, or the filter itself looks for the robot's place.
  [[nodiscard]] bool HasMap() const { return !trail.empty() && filter->placed(); }
  [[nodiscard]] Recovery::Known LastKnown() const {
    return {level.outcome.T_map_robot, level.T_odom_robot, level.outcome.covariance};
  }
  // Without odometry the robot is expected where it was.
  [[nodiscard]] Pose2 OdometryOrNone(const Pose2& T_odom_robot) const {
    return options.front_end.use_odometry ? T_odom_robot : level.T_odom_robot;
  }
  [[nodiscard]] bool StoodStill(const Scan& scan, const Pose2& T_odom_robot, const TrackStep& step) const;
  TrackStep DoubtPlace(const ScanView& view, const Pose2& T_odom_robot, const TrackStep& step,
                       const ParallelFor& parallel_for);
  ScanOutcome Recover(Keyframe keyframe, ScanView view, TrackStep step, const ParallelFor& parallel_for);
  [[nodiscard]] ScanOutcome ReportRecovery(Stamp stamp, const Pose2& T_odom_robot, const Pose2& T_track_robot) const;
  ScanOutcome GoOnAlongPath(const ParallelFor& parallel_for);
  ScanOutcome GoOnAt(const FoundPlace& place, Keyframe keyframe, ScanView view, TrackStep step,
                     const ParallelFor& parallel_for);
  void AddKeyframe(Keyframe keyframe, ScanView view, const TrackStep& step, const Eigen::Matrix3d& step_covariance,
                   const ParallelFor& parallel_for);
  StepMotion MotionTo(const Keyframe& keyframe, const TrackStep& step, const Eigen::Matrix3d& covariance);
  void CloseLargeLoop();
  void Draw(const TrackStep& step, bool placed_before);
  ScanOutcome Report(Stamp stamp, const Pose2& T_odom_robot, const TrackStep& step, bool keyframe);
  [[nodiscard]] PoseReason ReasonOf(const TrackStep& step) const;
  [[nodiscard]] SharedSequence<Pose2> believed_path() const { return filter->hypothesis(0).path; }

  // All but the filter, which is behind an interface.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.recovery, self.trail, self.front_end, self.blind, self.speed, self.loops, self.self_check,
            self.drawing, self.level, self.last_scan);
  }

  // The last scan that was not tilted.
  struct LevelScan {
    ScanOutcome outcome;
    Pose2 T_keyframe_robot;
    Pose2 T_odom_robot;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.outcome, self.T_keyframe_robot, self.T_odom_robot);
    }
  };

  // The last scan of all that was not tilted.
  struct LastScan {
    std::shared_ptr<const Scan> scan;
    Pose2 T_odom_robot;
    Pose2 T_track_robot;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.scan, self.T_odom_robot, self.T_track_robot);
    }
  };

  // Whether the parts fit together after reading.
  [[nodiscard]] bool IsConsistent() const;

  const MapperOptions options;
  FrontEnd front_end;
  BlindMotion blind;
  ConstantSpeed speed;  // Speed of the motion from keyframe to keyframe.
  Trail trail;
  RevisitSearch revisits;
  std::unique_ptr<Filter> filter;
  LoopSearch loops;
  SelfCheck self_check;
  Recovery recovery;
  MapDrawing drawing;
  LevelScan level;
  std::optional<LastScan> last_scan;
};

Mapper::Mapper(const MapperOptions& options, const Pose2& T_map_robot_start, std::uint64_t seed)
    : state_(std::make_unique<State>(options, T_map_robot_start, seed)) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

ScanOutcome Mapper::Process(std::shared_ptr<const Scan> scan, const Pose2& T_odom_robot,
                            const ParallelFor& parallel_for, Passage passage) {
  State& s = *state_;
  const Stamp stamp = scan->stamp;
  const bool tilted = IsTilted(*scan, s.options.max_tilt_rad);
  if (!s.options.front_end.use_odometry) passage = std::min(passage, Passage::kPaused);
  if (passage == Passage::kUnknown || (passage == Passage::kPaused && tilted)) s.LosePlace(passage == Passage::kPaused);
  if (tilted) return s.Coast(stamp, T_odom_robot);

  if (s.drawing.redrawing()) s.drawing.Continue(s.trail.keyframes(), s.believed_path());

  ScanView view = Look(*scan, s.options.front_end);
  TrackStep step = s.front_end.Track(view, T_odom_robot, parallel_for);
  if (passage == Passage::kPaused && !s.StoodStill(*scan, T_odom_robot, step))
    step = s.DoubtPlace(view, T_odom_robot, step, parallel_for);
  s.last_scan = State::LastScan{scan, T_odom_robot, step.T_track_robot};
  if (s.recovery.active()) return s.Recover({std::move(scan), T_odom_robot}, std::move(view), step, parallel_for);

  s.blind.Add(step, s.trail.empty() ? Pose2{} : s.trail.shapes().back().T_track_robot);
  const bool keyframe = s.trail.empty() || MovedEnough(s.trail.FromLast(step.T_track_robot), s.options.gate);
  if (keyframe) {
    s.front_end.AddKeyframe(view);
    s.AddKeyframe({std::move(scan), T_odom_robot}, std::move(view), step, s.blind.TakeCovariance(), parallel_for);
  }
  return s.Report(stamp, T_odom_robot, step, keyframe);
}

// Adds a scan with enough new content to the filter, the loops and the map.
void Mapper::State::AddKeyframe(Keyframe keyframe, ScanView view, const TrackStep& step,
                                const Eigen::Matrix3d& step_covariance, const ParallelFor& parallel_for) {
  const double travelled_m = trail.TravelledTo(step.T_track_robot);
  const bool placed_before = filter->placed();

  std::optional<RevisitObservation> revisit;
  if (!trail.empty()) {
    filter->Predict(MotionTo(keyframe, step, step_covariance));
    revisit = revisits.Find(view.points_robot, trail, travelled_m, *filter, parallel_for);
    if (revisit && !filter->Observe(*revisit)) revisit.reset();
  }
  filter->Observe(KeyframeSight{*keyframe.scan, view, step.T_track_robot, travelled_m}, parallel_for);
  filter->Commit();

  trail.Append(std::move(keyframe), step.T_track_robot, std::move(view.points_robot), step_covariance, revisit);

  CloseLargeLoop();
  self_check.Look(trail, believed_path());
  Draw(step, placed_before);
}

// The measured step from the last keyframe to this one. `covariance` is that of the part of the step that no
// scan measured.
StepMotion Mapper::State::MotionTo(const Keyframe& keyframe, const TrackStep& step, const Eigen::Matrix3d& covariance) {
  const Keyframe& last = trail.keyframes().back();
  const double seconds = 1e-9 * static_cast<double>(NanosBetween(last.scan->stamp, keyframe.scan->stamp));
  StepMotion motion{trail.FromLast(step.T_track_robot), covariance};
  if (options.front_end.use_odometry && !step.found)
    motion.T_prev_curr_odom = Between(last.T_odom_robot, keyframe.T_odom_robot);
  motion.lambda_m = std::abs(speed.Forecast(seconds).x);
  speed.Moved(motion.T_prev_curr, seconds);
  return motion;
}

// Possibly no particle agrees with the large loop: then the loop's error is distributed over the whole path.
void Mapper::State::CloseLargeLoop() {
  if (!filter->rebases()) return;
  const SharedSequence<Pose2> believed = believed_path();
  const auto loop = loops.Find(trail, believed);
  if (!loop) return;
  const auto path = trail.PathWithLoop(loop->relation(), believed.values(), options.pose_graph);
  if (!path) return;  // The loop is not stored, so that it will be searched for again.
  filter->Rebase(*path);
  trail.AddLoop(loop->relation());
  trail.ConfirmTentative();
  drawing.StartAgain(trail.size());
  self_check.Forget();
}

// A robot that does not know where it is would draw noise over its map, and the map would grow without end.
void Mapper::State::Draw(const TrackStep& step, bool placed_before) {
  const bool begins = filter->placed() && !placed_before;
  if (begins) {
    self_check.Forget();
    trail.ConfirmTentative();
  }
  trail.MarkLast(IsLocalized(ReasonOf(step)), !blind.Lost());
  if (begins) {
    drawing.Begin(trail.keyframes(), believed_path());
  } else if (filter->placed()) {
    drawing.Add(trail.keyframes().back(), filter->estimate().T_map_robot);
  }
}

ScanOutcome Mapper::State::Report(Stamp stamp, const Pose2& T_odom_robot, const TrackStep& step, bool keyframe) {
  const Pose2 T_keyframe_robot = keyframe ? Pose2{} : trail.FromLast(step.T_track_robot);
  trail.AddScan(stamp, T_keyframe_robot);
  const FilterEstimate estimate = filter->estimate();
  ScanOutcome outcome;
  outcome.stamp = stamp;
  outcome.T_map_robot = estimate.T_map_robot * T_keyframe_robot;
  outcome.T_map_odom = outcome.T_map_robot * T_odom_robot.Inverse();
  outcome.covariance = estimate.covariance;
  outcome.score = step.score;
  outcome.reason = ReasonOf(step);
  outcome.localized = IsLocalized(outcome.reason);
  outcome.keyframe = keyframe;
  level = {outcome, T_keyframe_robot, T_odom_robot};
  return outcome;
}

PoseReason Mapper::State::ReasonOf(const TrackStep& step) const {
  if (filter->health().diverged || self_check.contradicted()) return PoseReason::kDiverged;
  if (!filter->placed()) return PoseReason::kLost;
  if (!step.matched) return blind.Lost() ? PoseReason::kLost : PoseReason::kOdometryOnly;
  return step.degenerate ? PoseReason::kDegenerate : PoseReason::kTracking;
}

// A tilted scan is not matched: its pose is the one to which odometry has taken the robot since the last
// level scan.
ScanOutcome Mapper::State::Coast(Stamp stamp, const Pose2& T_odom_robot) {
  if (recovery.active()) {
    const Pose2 moved = options.front_end.use_odometry ? Between(last_scan->T_odom_robot, T_odom_robot) : Pose2{};
    return ReportRecovery(stamp, T_odom_robot, last_scan->T_track_robot * moved);
  }
  ScanOutcome outcome = level.outcome;
  outcome.stamp = stamp;
  outcome.keyframe = false;
  if (trail.empty()) {  // The first level scan will define the start; until then the pose is not known.
    outcome.T_map_robot = filter->estimate().T_map_robot;
    outcome.T_map_odom = outcome.T_map_robot * T_odom_robot.Inverse();
    return outcome;
  }
  const Pose2 moved = options.front_end.use_odometry ? Between(level.T_odom_robot, T_odom_robot) : Pose2{};
  trail.AddScan(stamp, level.T_keyframe_robot * moved);
  outcome.T_map_robot = level.outcome.T_map_robot * moved;
  const Eigen::Matrix3d J = J_compose_right(level.outcome.T_map_robot, moved);
  outcome.covariance += J * options.blind.Covariance(moved) * J.transpose();
  if (!outcome.localized) return outcome;
  outcome.localized = !blind.Lost(moved.translation().norm());
  outcome.reason = outcome.localized ? PoseReason::kOdometryOnly : PoseReason::kLost;
  return outcome;
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

// Whether nothing at all has changed since the last scan: nobody has moved the robot.
bool Mapper::State::StoodStill(const Scan& scan, const Pose2& T_odom_robot, const TrackStep& step) const {
  if (!last_scan || !step.matched) return false;
  const Pose2 moved = options.front_end.use_odometry ? Between(last_scan->T_odom_robot, T_odom_robot) : Pose2{};
  return moved.translation().norm() < kStillM && std::abs(moved.theta) < kStillRad &&
         LookAlike(*last_scan->scan, scan, step.degenerate ? kUnchangedAlongCorridor : kUnchanged);
}

// Nobody watched the robot before this scan. If the scan goes on where the last ones ended, as far as it shows, the
// robot is probably still on its path, but has to prove it; otherwise it has to be found.
TrackStep Mapper::State::DoubtPlace(const ScanView& view, const Pose2& T_odom_robot, const TrackStep& step,
                                    const ParallelFor& parallel_for) {
  if (!HasMap()) return step;
  if (!recovery.active() && step.matched) {
    const Pose2 T_map_track = believed_path()[trail.size() - 1] * trail.shapes().back().T_track_robot.Inverse();
    recovery.BeginOnPath(LastKnown(), T_map_track);
    return step;
  }
  LosePlace(true);
  return front_end.Track(view, T_odom_robot, parallel_for);
}

// Follows a robot whose place is not certain, until it is proved.
ScanOutcome Mapper::State::Recover(Keyframe keyframe, ScanView view, TrackStep step, const ParallelFor& parallel_for) {
  const Stamp stamp = keyframe.scan->stamp;
  const Pose2 T_odom_robot = keyframe.T_odom_robot;
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
  const bool keep = MovedEnough(Between(T_track_last, step.T_track_robot), options.gate) || (first && !on_path);
  if (keep) front_end.AddKeyframe(view);
  if (on_path) {
    blind.Add(step, T_track_last);
    if (keep) recovery.Hold({keyframe, step, blind.TakeCovariance()});
  }
  if (keep || first) {
    const auto found =
        recovery.Take({keyframe.scan, OdometryOrNone(T_odom_robot)}, step, view.points_robot, trail, believed_path());
    if (found && found->on_path) return GoOnAlongPath(parallel_for);
    if (found) return GoOnAt(found->place, std::move(keyframe), std::move(view), step, parallel_for);
  }
  return ReportRecovery(stamp, T_odom_robot, step.T_track_robot);
}

// The robot has been found on its path: nothing was missing.
ScanOutcome Mapper::State::GoOnAlongPath(const ParallelFor& parallel_for) {
  const std::vector<Recovery::Held> held = recovery.TakeHeld();
  recovery.End();
  for (const Recovery::Held& one : held) {
    AddKeyframe(one.keyframe, Look(*one.keyframe.scan, options.front_end), one.step, one.step_covariance, parallel_for);
    if (&one != &held.back()) trail.AddScan(one.keyframe.scan->stamp, {});
  }
  const Recovery::Held& now = held.back();
  return Report(now.keyframe.scan->stamp, now.keyframe.T_odom_robot, now.step, true);
}

// The robot has been found: the path goes on there, with a step from the last keyframe that no scan or odometry shows.
ScanOutcome Mapper::State::GoOnAt(const FoundPlace& place, Keyframe keyframe, ScanView view, TrackStep step,
                                  const ParallelFor& parallel_for) {
  const Stamp stamp = keyframe.scan->stamp;
  const Pose2 T_odom_robot = keyframe.T_odom_robot;
  const Pose2 T_map_last = believed_path()[trail.size() - 1];
  const Pose2 T_track_robot = trail.shapes().back().T_track_robot * Between(T_map_last, place.T_map_robot);
  front_end.MoveTo(T_track_robot * step.T_track_robot.Inverse());
  step.T_track_robot = T_track_robot;
  step.found = true;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  R.topLeftCorner<2, 2>() = T_map_last.rotation().transpose();
  blind.Found(R * place.covariance * R.transpose());
  recovery.End();
  self_check.Forget();
  AddKeyframe(std::move(keyframe), std::move(view), step, blind.TakeCovariance(), parallel_for);
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

bool Mapper::full() const {
  const State& s = *state_;
  return s.trail.size() >= static_cast<std::size_t>(s.options.max_keyframes) ||
         s.drawing.grid().chunk_count() >= static_cast<std::size_t>(s.options.max_chunks);
}

const OccupancyGrid& Mapper::grid() const {
  return state_->drawing.grid();
}

OccupancyGrid::Chunks Mapper::ShareGrid() {
  return state_->drawing.Share();
}

OccupancyGrid::Change Mapper::TakeGridChange() {
  return state_->drawing.TakeChange();
}

std::vector<Landmark> Mapper::landmarks() const {
  return state_->filter->landmarks();
}

std::size_t Mapper::keyframe_count() const {
  return state_->trail.size();
}

MapperSnapshot Mapper::Snapshot() const {
  const State& s = *state_;
  if (!s.filter->placed()) return {};
  // Smoothing corrects the path, so that tentative keyframes count as localized.
  const bool corrected = s.level.outcome.localized;
  return {.keyframes = corrected ? s.trail.ConfirmedKeyframes() : s.trail.keyframes(),
          .online_path = s.drawing.path(),
          .full_path = s.believed_path().values(),
          .relations = s.trail.relations(),
          .pose_graph = s.options.pose_graph,
          .scans = s.trail.scans()};
}

void Mapper::FinishMap() {
  state_->drawing.Finish(state_->trail.keyframes(), state_->believed_path());
}

void Mapper::AdoptGrid(OccupancyGrid grid, std::size_t keyframes) {
  State& s = *state_;
  s.drawing.Adopt(std::move(grid), keyframes, s.trail.keyframes(), s.believed_path());
}

void Mapper::Save(StateWriter& archive) const {
  archive(*state_);
  state_->filter->Save(archive);
}

void Mapper::Load(StateReader& archive, const ParallelFor& parallel_for) {
  auto loaded = std::make_unique<State>(state_->options, Pose2{}, 0);
  archive(*loaded);
  if (archive.ok()) loaded->filter->Load(archive);
  if (!archive.ok() || !archive.Require(loaded->IsConsistent(), "the paths")) return;
  loaded->trail.RestorePoints(loaded->options.front_end.surface, parallel_for);
  loaded->recovery.RestorePoints(loaded->options.front_end.surface);
  state_ = std::move(loaded);
}

bool Mapper::State::IsConsistent() const {
  for (std::size_t i = 0; i < filter->hypothesis_count(); ++i)
    if (filter->hypothesis(i).path.size() != trail.size()) return false;
  if (recovery.active() && (trail.empty() || !last_scan)) return false;
  return drawing.path().size() == (filter->placed() ? trail.size() : 0);
}

}  // namespace cairn::slam
