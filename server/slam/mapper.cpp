#include "server/slam/mapper.h"

#include <cmath>

#include "server/slam/filters/make_filter.h"
#include "server/slam/front_end.h"
#include "server/slam/grid/grid_redraw.h"
#include "server/slam/matching/loop_search.h"
#include "server/slam/matching/revisit_search.h"
#include "server/slam/matching/self_check.h"
#include "server/slam/motion/constant_speed.h"
#include "server/slam/scan/tilt.h"
#include "server/slam/smoothing/keyframe_graph.h"

namespace cairn::slam {

namespace {

// Keyframes drawn again with every scan after a large loop: a few milliseconds' worth.
constexpr std::size_t kRedrawnPerScan = 20;

}  // namespace

struct Mapper::State {
  State(const MapperOptions& given, const Pose2& T_map_robot_start, std::uint64_t seed)
      : options(given),
        front_end(given.front_end, given.matcher, given.matching),
        revisits(given.revisit, given.front_end.refine),
        loops(given.loop, given.front_end.refine),
        self_check(given.self_check),
        graph(given.filter.back_end.drift),
        filter(MakeFilter(given.filter.kind, given.filter, T_map_robot_start, seed)),
        grid(given.grid) {}

  // A scan that looks out of the plane: where odometry has taken the robot since the last level one.
  ScanOutcome Coast(Stamp stamp, const Pose2& T_odom_robot);
  void AddKeyframe(std::shared_ptr<const Scan> scan, const Pose2& T_odom_robot, ScanView view, const TrackStep& step,
                   const ParallelFor& parallel_for);
  void CloseLargeLoop();
  void MoveMap();
  void TakePath();
  void Redraw();

  const MapperOptions options;
  FrontEnd front_end;
  RevisitSearch revisits;
  LoopSearch loops;
  SelfCheck self_check;
  ConstantSpeed speed;  // From keyframe to keyframe.
  KeyframeGraph graph;
  std::vector<double> distances_m;  // Along the graph, from the last keyframe to each.
  std::unique_ptr<Filter> filter;
  OccupancyGrid grid;
  std::optional<GridRedraw> redraw;   // Under way since a large loop was closed ...
  std::size_t rebased_keyframes = 0;  // ... when there were so many keyframes.

  std::vector<Keyframe> keyframes;
  std::vector<KeyframeShape> shapes;  // One per keyframe.
  std::vector<Pose2> online_path;     // One per keyframe.
  std::vector<MapperSnapshot::ScanPlace> scans;
  ScanOutcome level;  // Of the last scan that was not tilted ...
  MapperSnapshot::ScanPlace level_place;
  Pose2 T_odom_level;        // ... and odometry there.
  double travelled_m = 0.0;  // Up to the last keyframe.
  double unmatched_m = 0.0;  // Travelled by odometry alone since the last match.
  // Of what was travelled by odometry or a forecast alone since the last keyframe, in that keyframe.
  Eigen::Matrix3d blind_covariance = Eigen::Matrix3d::Zero();
};

namespace {

PoseReason ReasonOf(const TrackStep& step, double unmatched_m, double lost_after_m) {
  if (!step.matched) return unmatched_m > lost_after_m ? PoseReason::kLost : PoseReason::kOdometryOnly;
  return step.match.degenerate ? PoseReason::kDegenerate : PoseReason::kTracking;
}

}  // namespace

Mapper::Mapper(const MapperOptions& options, const Pose2& T_map_robot_start, std::uint64_t seed)
    : state_(std::make_unique<State>(options, T_map_robot_start, seed)) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;
Mapper& Mapper::operator=(Mapper&&) noexcept = default;

ScanOutcome Mapper::Process(std::shared_ptr<const Scan> scan, const Pose2& T_odom_robot,
                            const ParallelFor& parallel_for) {
  State& s = *state_;
  if (IsTilted(*scan, s.options.max_tilt_rad)) return s.Coast(scan->stamp, T_odom_robot);
  ScanOutcome outcome;
  outcome.stamp = scan->stamp;

  s.Redraw();

  // Where the front-end sees the robot, and how far that is from the last keyframe.
  ScanView view = Look(*scan, s.options.front_end);
  const TrackStep step = s.front_end.Track(view, T_odom_robot, parallel_for);
  s.unmatched_m = step.matched || s.keyframes.empty() ? 0.0 : s.unmatched_m + step.moved_m;
  if (!step.matched && s.options.front_end.use_odometry)
    s.blind_covariance += s.options.blind.Covariance({step.moved_m, 0.0, 0.0});
  if (!s.shapes.empty()) {
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    R.topLeftCorner<2, 2>() = s.shapes.back().T_track_robot.rotation().transpose();
    s.blind_covariance += R * step.forecast_covariance * R.transpose();
  }
  const bool first = s.keyframes.empty();
  Pose2 T_keyframe_robot = first ? Pose2{} : Between(s.shapes.back().T_track_robot, step.T_track_robot);

  // A scan that shows enough new updates filter and map.
  if (first || MovedEnough(T_keyframe_robot, s.options.gate)) {
    s.AddKeyframe(std::move(scan), T_odom_robot, std::move(view), step, parallel_for);
    T_keyframe_robot = {};
    outcome.keyframe = true;
  }
  s.scans.push_back({outcome.stamp, s.keyframes.size() - 1, T_keyframe_robot});

  outcome.T_map_robot = s.filter->estimate().T_map_robot * T_keyframe_robot;
  outcome.T_map_odom = outcome.T_map_robot * T_odom_robot.Inverse();
  outcome.covariance = s.filter->estimate().covariance;
  outcome.score = first ? 1.0 : step.match.score;
  outcome.reason = first ? PoseReason::kTracking : ReasonOf(step, s.unmatched_m, s.options.lost_after_m);
  if (!s.filter->placed()) outcome.reason = PoseReason::kLost;
  if (s.filter->health().diverged || s.self_check.contradicted()) outcome.reason = PoseReason::kDiverged;
  outcome.localized = outcome.reason != PoseReason::kLost && outcome.reason != PoseReason::kDiverged;
  s.level = outcome;
  s.level_place = s.scans.back();
  s.T_odom_level = T_odom_robot;
  return outcome;
}

ScanOutcome Mapper::State::Coast(Stamp stamp, const Pose2& T_odom_robot) {
  ScanOutcome outcome = level;
  outcome.stamp = stamp;
  outcome.keyframe = false;
  if (keyframes.empty()) {  // The first level scan will stand at the start; until then nobody knows.
    outcome.T_map_robot = filter->estimate().T_map_robot;
    outcome.T_map_odom = outcome.T_map_robot * T_odom_robot.Inverse();
    return outcome;
  }
  const Pose2 moved = options.front_end.use_odometry ? Between(T_odom_level, T_odom_robot) : Pose2{};
  scans.push_back({stamp, level_place.keyframe, level_place.T_keyframe_robot * moved});
  outcome.T_map_robot = level.T_map_robot * moved;
  const Eigen::Matrix3d J = J_compose_right(level.T_map_robot, moved);
  outcome.covariance += J * options.blind.Covariance(moved) * J.transpose();
  if (!outcome.localized) return outcome;
  outcome.localized = unmatched_m + moved.translation().norm() <= options.lost_after_m;
  outcome.reason = outcome.localized ? PoseReason::kOdometryOnly : PoseReason::kLost;
  return outcome;
}

void Mapper::State::AddKeyframe(std::shared_ptr<const Scan> scan, const Pose2& T_odom_robot, ScanView view,
                                const TrackStep& step, const ParallelFor& parallel_for) {
  if (!keyframes.empty()) {
    const Pose2 motion = Between(shapes.back().T_track_robot, step.T_track_robot);
    travelled_m += motion.translation().norm();
    const double seconds = SecondsFromStamp(scan->stamp - keyframes.back().scan->stamp);
    StepMotion measured{motion, blind_covariance};
    if (options.front_end.use_odometry)
      measured.T_prev_curr_odom = Between(keyframes.back().T_odom_robot, T_odom_robot);
    measured.lambda_m = std::abs(speed.Forecast(seconds).x);
    filter->Predict(measured);
    speed.Moved(motion, seconds);
    graph.Append(motion, blind_covariance);
    blind_covariance.setZero();
    const auto revisit = revisits.Find(view.points_robot, shapes, distances_m, travelled_m, *filter, parallel_for);
    if (revisit && filter->Observe(*revisit))
      graph.AddLoop(revisit->keyframe, keyframes.size(), revisit->T_keyframe_robot, revisit->covariance);
  } else {
    graph.Append({}, Eigen::Matrix3d::Zero());
    blind_covariance.setZero();
  }
  const bool placed_before = filter->placed();
  filter->Observe(KeyframeSight{*scan, view, step.T_track_robot, travelled_m}, parallel_for);
  filter->Commit();
  front_end.AddKeyframe(view);
  keyframes.push_back({std::move(scan), T_odom_robot});
  shapes.push_back({step.T_track_robot, travelled_m, std::move(view.points_robot)});
  distances_m = graph.DistancesFromLast();
  CloseLargeLoop();
  self_check.Look(keyframes, shapes, filter->hypothesis(0).path);
  if (!placed_before && filter->placed()) {
    MoveMap();
    TakePath();
  } else {
    online_path.push_back(filter->estimate().T_map_robot);
  }
  if (filter->placed()) grid.Draw(*keyframes.back().scan, filter->estimate().T_map_robot);
}

// No particle may have gone the way a large loop turns out to have gone: then its error is spread over the whole path.
void Mapper::State::CloseLargeLoop() {
  if (!filter->rebases()) return;
  const SharedSequence<Pose2> believed = filter->hypothesis(0).path;
  const auto loop = loops.Find(keyframes, shapes, believed, distances_m);
  if (!loop) return;
  KeyframeGraph closed = graph;
  closed.AddLoop(loop->keyframe, keyframes.size() - 1, loop->T_keyframe_robot, loop->covariance);
  std::vector<Pose2> path;
  for (std::size_t k = 0; k < believed.size(); ++k) path.push_back(believed[k]);
  // Known only once the filter goes on from it: a loop nobody followed must be looked for again.
  if (!closed.Optimise(path, options.pose_graph).usable || !filter->Rebase(path)) return;
  graph = std::move(closed);
  distances_m = graph.DistancesFromLast();
  MoveMap();
}

// The path behind is another one: what was made along the old one goes.
void Mapper::State::MoveMap() {
  rebased_keyframes = keyframes.size();
  redraw.emplace(options.grid);
  self_check.Forget();
}

void Mapper::State::Redraw() {
  if (!redraw || !redraw->Advance(keyframes, filter->hypothesis(0).path, kRedrawnPerScan)) return;
  const OccupancyGrid::Chunks old = grid.chunks();
  grid = redraw->TakeGrid();
  redraw.reset();
  TakePath();
  grid.MarkAllDirty();
  for (const auto& [key, chunk] : old) grid.MarkDirty(key);
}

// The map is, or is about to be, drawn along the filter's path of now.
void Mapper::State::TakePath() {
  online_path.clear();
  const SharedSequence<Pose2> path = filter->hypothesis(0).path;
  for (std::size_t k = 0; k < path.size(); ++k) online_path.push_back(path[k]);
}

const OccupancyGrid& Mapper::grid() const {
  return state_->grid;
}

std::vector<ChunkKey> Mapper::TakeDirtyChunks() {
  return state_->grid.TakeDirty();
}

std::vector<Landmark> Mapper::landmarks() const {
  return state_->filter->landmarks();
}

std::size_t Mapper::keyframe_count() const {
  return state_->keyframes.size();
}

MapperSnapshot Mapper::Snapshot() const {
  MapperSnapshot snapshot;
  if (!state_->filter->placed()) return snapshot;
  snapshot.keyframes = state_->keyframes;
  snapshot.online_path = state_->online_path;
  snapshot.scans = state_->scans;
  snapshot.pose_graph = state_->options.pose_graph;
  if (state_->graph.has_loops()) snapshot.relations = state_->graph.relations();
  const SharedSequence<Pose2> path = state_->filter->hypothesis(0).path;
  for (std::size_t k = 0; k < path.size(); ++k) snapshot.full_path.push_back(path[k]);
  return snapshot;
}

void Mapper::FinishMap() {
  while (state_->redraw) state_->Redraw();
}

void Mapper::AdoptGrid(OccupancyGrid grid, std::size_t keyframes) {
  State& s = *state_;
  s.grid = std::move(grid);
  // A grid from before a large loop was closed shows the old way; one being drawn again is thrown away for it.
  const bool outdated = keyframes < s.rebased_keyframes || s.redraw;
  s.redraw.reset();
  const SharedSequence<Pose2> path = s.filter->hypothesis(0).path;
  for (std::size_t k = keyframes; s.filter->placed() && k < s.keyframes.size(); ++k)
    s.grid.Draw(*s.keyframes[k].scan, path[k]);
  s.grid.MarkAllDirty();
  if (outdated) s.redraw.emplace(s.options.grid);
}

}  // namespace cairn::slam
