#include "server/slam/mapper.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/slam/mapper_state.h"
#include "server/slam/tracking/scan_tracking.h"

namespace cairn::slam {
namespace {

bool IsLocalized(PoseReason reason) {
  return reason != PoseReason::kLost && reason != PoseReason::kDiverged;
}

}  // namespace

Mapper::Mapper(const MapperOptions& options, const Pose2& T_map_robot_start, std::uint64_t seed)
    : state_(std::make_unique<State>(options, T_map_robot_start, seed)) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

ScanOutcome Mapper::State::Process(std::shared_ptr<const Scan> scan, const Pose2& T_odom_robot,
                                   const ParallelFor& parallel_for, Passage passage, const RollingScan* rolling,
                                   bool odometry_begins) {
  State& s = *this;
  const Stamp stamp = scan->stamp;
  const bool tilted = IsTilted(*scan, s.options.max_tilt_rad);
  if (s.localisation) {
    passage = s.LocaliseAfter(passage, tilted);
    if (tilted)
      return s.ReportLocalised(stamp, T_odom_robot, s.localisation->CarriedTo(s.OdometryOrNone(T_odom_robot)), 0.0);
    // As for a robot that maps: one that is only doubted has been followed without a gap.
    const bool doubted = s.localisation->recovery().doubt().has_value();
    if (passage != Passage::kDriven || (s.localisation->looking() && !doubted)) rolling = nullptr;
    TrackedScan tracked = TrackScan(s.front_end, {s.options.front_end, s.options.pairing.rolling}, s.trail,
                                    std::move(scan), rolling, T_odom_robot, parallel_for);
    return s.Localise(std::move(tracked), T_odom_robot, passage, rolling != nullptr, parallel_for);
  }
  passage = s.BeginAfter(passage, tilted);
  if (tilted) return s.Coast(stamp, T_odom_robot);

  if (s.drawing.redrawing() || s.drawing.late()) {
    s.Begin(ScanStep::kDraw);
    s.drawing.Continue(s.trail.keyframes(), s.believed_path());
  }

  // The motion of the last scans says nothing where they do not belong together with this one.
  const bool doubted = s.recovery.doubt().has_value();
  if (passage != Passage::kDriven || (s.recovery.active() && !doubted)) rolling = nullptr;
  std::optional<ScanBefore> last;  // Not in the trail.
  if (doubted) last = ScanBefore{s.last_scan->scan->stamp, s.last_scan->T_track_robot};
  TrackedScan tracked = TrackScan(s.front_end, {s.options.front_end, s.options.pairing.rolling}, s.trail,
                                  std::move(scan), rolling, T_odom_robot, parallel_for, last);
  if (odometry_begins) s.front_end.ForgetEarlierOdometry();
  s.Begin(ScanStep::kRecover);
  s.CheckPlace(passage, rolling != nullptr, tracked, T_odom_robot, parallel_for);
  auto& [still, view, step] = tracked;
  s.learning.LearnUnless(passage != Passage::kDriven || s.recovery.active() || !s.options.front_end.use_odometry, step);
  if (s.recovery.doubt()) s.EndDoubt(*still, view.points_robot, step, parallel_for);
  if (s.recovery.active()) return s.Recover({std::move(still), T_odom_robot}, std::move(view), step, parallel_for);

  s.Begin(ScanStep::kOther);
  s.blind.Add(step, s.trail.empty() ? Pose2{} : s.trail.shapes().back().T_track_robot);
  // The step to the next keyframe begins where odometry does.
  const bool keyframe =
      s.trail.empty() || odometry_begins || MovedEnough(s.trail.FromLast(step.T_track_robot), s.options.gate);
  if (keyframe) {
    s.front_end.AddKeyframe(view);
    s.AddKeyframe({std::move(still), T_odom_robot}, std::move(view), step, s.blind.TakeCovariance(), parallel_for);
  } else if (s.loops.busy()) {
    s.Begin(ScanStep::kLargeLoop);
    s.CloseLargeLoop(false);
    s.Begin(ScanStep::kOther);
  }
  return s.Report(stamp, T_odom_robot, step, keyframe);
}

// Adds a scan with enough new content to the filter, the loops and the map.
void Mapper::State::AddKeyframe(Keyframe keyframe, ScanView view, const TrackStep& step,
                                Eigen::Matrix3d step_covariance, const ParallelFor& parallel_for, Regained regained) {
  const double travelled_m = trail.TravelledTo(step.T_track_robot);
  const bool placed_before = filter->placed();
  auto& [revisit, elsewhere] = regained;

  if (elsewhere) {
    Begin(ScanStep::kFilter);
    const Eigen::Matrix3d doubt = DoubtOfStep(trail.FromLast(step.T_track_robot));
    if (!filter->GoOnAt(*elsewhere)) filter->Predict(MotionTo(keyframe, step, step_covariance));
    step_covariance += doubt;
  } else if (!trail.empty()) {
    Begin(ScanStep::kFilter);
    filter->Predict(MotionTo(keyframe, step, step_covariance));
    Begin(ScanStep::kRevisit);
    if (!revisit)
      revisit = revisits.Find(view.points_robot, trail, travelled_m, *filter, believed_index(), parallel_for);
    Begin(ScanStep::kFilter);
    if (revisit && !filter->Observe(*revisit)) revisit.reset();
  }
  Begin(ScanStep::kFilter);
  filter->Observe(KeyframeSight{*keyframe.scan, view, step.T_track_robot, travelled_m}, parallel_for);
  filter->Commit();

  trail.Append(std::move(keyframe), step.T_track_robot, std::move(view.points_robot), step_covariance, revisit);

  Begin(ScanStep::kLargeLoop);
  CloseLargeLoop(true);
  Begin(ScanStep::kSelfCheck);
  self_check.Look(trail, believed_index());
  Begin(ScanStep::kDraw);
  Draw(step, placed_before);
  Begin(ScanStep::kRetire);
  RetireKeyframes();
  Begin(ScanStep::kOther);
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
void Mapper::State::CloseLargeLoop(bool keyframe) {
  if (!filter->rebases()) return;
  const PosePath believed = believed_path();
  const auto loop = keyframe ? loops.Find(trail, believed) : loops.GoOn(trail);
  if (!loop) return;
  const auto path = trail.PathWithLoop(loop->relation(), believed.values(), options.pose_graph);
  if (!path) return;  // The loop is not stored, so that it will be searched for again.
  filter->Rebase(*path);
  filter->LearnLoop({loop->old, loop->T_old_recent, loop->covariance});
  trail.AddLoop(loop->relation());
  trail.ConfirmTentative();
  drawing.StartAgain(trail.made());
  self_check.Forget();
}

// All that is kept is gone through, so it happens seldom: each time that an eighth has been added. Only where all
// hypotheses have the same past, and no keyframe that something is still being done with.
void Mapper::State::RetireKeyframes() {
  const RetireOptions& limits = options.retire;
  if (!limits.enabled || !filter->retires() || !filter->placed()) return;
  if (drawing.redrawing() || drawing.late()) return;  // Soon.
  const auto from = static_cast<std::uint64_t>(std::min(limits.from_keyframes, options.max_keyframes / 2));
  const bool enough_new = trail.size() >= size_after_last_search + std::max(from, size_after_last_search) / 8;
  const bool full = trail.size() >= static_cast<std::uint64_t>(options.max_keyframes);
  if (trail.size() < from || !(enough_new || full)) return;
  const PosePath path = believed_path();
  std::size_t end = trail.size() - std::min(trail.size(), static_cast<std::size_t>(limits.recent_keyframes));
  for (std::size_t i = 1; i < filter->hypothesis_count(); ++i) end = filter->hypothesis(i).path.SharedWith(path, end);
  if (const auto retirement = ChooseRetired(trail, path, end, limits)) {
    trail.Retire(*retirement);
    filter->Retire(*retirement);
    loops.Retire(*retirement);
    drawing.Retire(*retirement);
  }
  size_after_last_search = trail.size();
}

// A robot that is not localized would draw noise over its map, and the map would grow without end.
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
  const bool there = keyframe && !step.T_track_held;  // Where the keyframe is.
  const Pose2 T_keyframe_robot = there ? Pose2{} : trail.FromLast(step.T_track_held.value_or(step.T_track_robot));
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

void Mapper::WatchSteps(StepWatch watch) {
  state_->front_end.Watch(std::move(watch));
}

bool Mapper::full() const {
  const State& s = *state_;
  if (s.localisation) return false;
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

OccupancyGrid::Looks Mapper::TakeGridLooks() {
  return state_->drawing.TakeLooks();
}

std::vector<Landmark> Mapper::landmarks() const {
  return state_->filter->landmarks();
}

std::vector<WeightedPose> Mapper::belief(const Pose2& T_map_robot) const {
  // The filter may be at the last keyframe, from which the front end has followed the robot on. So each hypothesis goes
  // on from its own pose by the same motion.
  const Pose2 T_filter_robot = Between(state_->filter->estimate().T_map_robot, T_map_robot);
  std::vector<WeightedPose> belief = state_->filter->belief();
  for (WeightedPose& pose : belief) pose.T_map_robot = pose.T_map_robot * T_filter_robot;
  return belief;
}

std::size_t Mapper::keyframe_count() const {
  return state_->trail.size();
}

std::uint64_t Mapper::keyframes_made() const {
  return state_->trail.made();
}

MapperSnapshot Mapper::Snapshot() const {
  const State& s = *state_;
  if (!s.filter->placed()) return {};
  // Smoothing corrects the path, so that tentative keyframes count as localized.
  const bool corrected = s.level.outcome.localized;
  return {.keyframes = corrected ? s.trail.ConfirmedKeyframes() : s.trail.keyframes(),
          .numbers = s.trail.numbers(),
          .online_path = s.drawing.path(),
          .full_path = s.believed_path().values(),
          .relations = s.trail.measured(),
          .steps = s.trail.steps_of_shaped(),
          .pose_graph = s.options.pose_graph,
          .scans = s.trail.scans()};
}

bool Mapper::AdoptGrid(OccupancyGrid grid, std::uint64_t keyframes, std::span<const Pose2> path,
                       std::span<const std::uint64_t> numbers, bool must_follow, std::span<const Pose2> drawn) {
  State& s = *state_;
  std::vector<Pose2> first_poses;
  if (s.filter->rebases() && s.filter->placed()) first_poses = s.PosesOfFirst(keyframes, path, numbers);
  const bool follows = !first_poses.empty();
  if ((must_follow || keyframes > s.trail.made()) && !follows) return false;
  const std::uint64_t known = std::min(keyframes, s.trail.made());
  const std::vector<Pose2> in_grid = s.PosesOfFirst(keyframes, drawn.empty() ? path : drawn, numbers);
  if (follows) s.Follow(first_poses, known);
  s.drawing.Adopt(std::move(grid), known, s.trail.CountBelow(known), s.trail.keyframes(), s.believed_path(), follows,
                  in_grid);
  return true;
}

bool Mapper::follows_paths() const {
  return state_->filter->rebases();
}

void Mapper::Relocalise(const std::optional<Pose2>& T_map_robot) {
  state_->Relocalise(T_map_robot);
}

std::vector<std::uint64_t> Mapper::keyframe_numbers() const {
  return state_->trail.numbers();
}

std::vector<Pose2> Mapper::BestPath() const {
  return state_->filter->placed() ? state_->believed_path().values() : std::vector<Pose2>{};
}

void Mapper::Save(StateWriter& archive) const {
  state_->drawing.DrawAllLate(state_->trail.keyframes());
  archive(*state_);
  state_->filter->Save(archive);
}

void Mapper::Load(StateReader& archive) {
  auto loaded = std::make_unique<State>(state_->configured, Pose2{}, 0);
  archive(*loaded);
  if (archive.ok()) loaded->filter->Load(archive);
  if (!archive.RequireThat([&] { return loaded->IsConsistent(); }, "the paths")) return;
  loaded->front_end.Watch(state_->front_end.watch());
  state_ = std::move(loaded);
}

bool Mapper::State::IsConsistent() const {
  if (size_after_last_search > trail.size()) return false;
  for (std::size_t i = 0; i < filter->hypothesis_count(); ++i)
    if (filter->hypothesis(i).path.size() != trail.size()) return false;
  if (recovery.active() && (trail.empty() || !last_scan)) return false;
  if (localisation && !localisation->looking() && !last_scan) return false;
  return drawing.path().size() == (filter->placed() ? trail.size() : 0);
}

}  // namespace cairn::slam
