#include "server/slam/trail/trail.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>
#include <utility>

#include "server/slam/graph/loop_graph.h"
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

constexpr std::uint64_t kMostMade = std::uint64_t{1} << 48;
constexpr double kRoundingM = 1e-6;  // More than sums of the same lengths in another order can differ.
// A loop that is farther off than this many of its standard deviations on the path that fits best has been outvoted: it
// has less than a tenth of its weight there.
constexpr double kOutvotedSigmas = 10.0;

// Added to every covariance: options may set all noise to zero, but the least squares need positive definite
// covariances.
PoseRelation PositiveDefinite(PoseRelation relation) {
  relation.covariance += 1e-10 * Eigen::Matrix3d::Identity();
  return relation;
}

// Whether the other relations of the path contradict this one.
bool IsOutvoted(const PoseRelation& relation, std::span<const Pose2> path) {
  const Eigen::Vector3d error = ErrorOf(relation, path[relation.from], path[relation.to]).error;
  return error.dot(relation.covariance.llt().solve(error)) > kOutvotedSigmas * kOutvotedSigmas;
}

}  // namespace

bool KeepsShape(const PoseRelation& relation) {
  constexpr double kRounding = 1e-9;  // Earlier versions have added 1e-10.
  return relation.loop &&
         (relation.covariance - PoseCovariance(kShapeSigmaM, kShapeSigmaRad)).cwiseAbs().maxCoeff() < kRounding;
}

void Trail::Append(Keyframe keyframe, const Pose2& T_track_robot, std::optional<std::vector<SurfacePoint>> points_robot,
                   const Eigen::Matrix3d& step_covariance, const std::optional<RevisitObservation>& revisit) {
  const std::size_t node = size();
  const Pose2 T_prev_curr = FromLast(T_track_robot);
  if (node > 0)
    relations_.push_back(
        PositiveDefinite({node - 1, node, T_prev_curr, drift_.Covariance(T_prev_curr) + step_covariance, false}));
  shapes_.push_back({T_track_robot, TravelledTo(T_track_robot), made()});
  if (points_robot) points_.Keep(node, *std::move(points_robot));
  keyframe.scan.Pack();
  keyframes_.push_back(std::move(keyframe));
  loops_.emplace_back();
  distances_current_ = false;
  if (node > 0) way_bounds_.Append(shapes_[node].travelled_m - shapes_[node - 1].travelled_m);
  if (revisit) AddLoop({revisit->keyframe, node, revisit->T_keyframe_robot, revisit->covariance, true});
}

void Trail::MarkLast(bool localized, bool on_the_path) {
  keyframes_.back().localized = localized;
  keyframes_.back().tentative = !localized && on_the_path;
}

void Trail::ConfirmTentative() {
  keyframes_ = ConfirmedKeyframes();
  frozen_keyframes_.Forget();
}

std::vector<Keyframe> Trail::ConfirmedKeyframes() const {
  std::vector<Keyframe> trusted = keyframes_;
  for (Keyframe& keyframe : trusted) {
    keyframe.localized = keyframe.localized || keyframe.tentative;
    keyframe.tentative = false;
  }
  return trusted;
}

SharedPoints Trail::points(std::size_t keyframe) const {
  if (SharedPoints kept = points_.Find(keyframe)) return kept;
  const Scan scan = *keyframes_[keyframe].scan;
  return points_.Keep(keyframe, SurfacePointsOf(PointsOf(scan), scan, surface_));
}

bool Trail::IsConsistent() const {
  if (shapes_.size() != size()) return false;
  if (!empty() && shapes_.back().number >= kMostMade) return false;
  for (std::size_t k = 1; k < size(); ++k)
    if (shapes_[k - 1].travelled_m > shapes_[k].travelled_m || shapes_[k - 1].number >= shapes_[k].number) return false;
  return std::ranges::all_of(relations_, [this](const auto& one) { return one.from < size() && one.to < size(); }) &&
         std::ranges::all_of(scans_, [this](const auto& scan) { return scan.keyframe < size(); });
}

void Trail::RestoreRest() {
  points_.Clear();
  loops_.assign(size(), {});
  way_bounds_.Clear();
  for (const PoseRelation& relation : relations_)
    if (relation.loop && !KeepsShape(relation)) NoteLoop(relation);
  distances_m_.clear();
  distances_current_ = empty();
}

std::size_t Trail::RevisitsWithin(double way_m, double travelled_m) const {
  std::size_t revisits = 0;
  for (std::size_t k = size(); k-- > 0 && travelled_m - shapes_[k].travelled_m < way_m;)
    revisits += std::ranges::any_of(loops_[k], [k](const Loop& loop) { return loop.other < k; }) ? 1 : 0;
  return revisits;
}

void Trail::AddScan(Stamp stamp, const Pose2& T_keyframe_robot) {
  scans_.push_back({stamp, size() - 1, T_keyframe_robot});
  // A robot that stands makes no keyframes, so that Retire never comes.
  if (scans_.size() >= 2 * kMostScans + size()) DropOldScans();
}

void Trail::AddLoop(const PoseRelation& loop) {
  relations_.push_back(PositiveDefinite(loop));
  NoteLoop(loop);
  distances_current_ = false;
}

void Trail::SetShape(const std::vector<PoseRelation>& shape) {
  std::erase_if(relations_, KeepsShape);
  for (PoseRelation relation : shape) {
    relation.covariance = PoseCovariance(kShapeSigmaM, kShapeSigmaRad);
    relation.loop = true;
    relations_.push_back(relation);
  }
  frozen_relations_.Forget();
}

void Trail::NoteLoop(const PoseRelation& loop) {
  const double way_m = loop.T_from_to.translation().norm();
  loops_[loop.from].push_back({loop.to, way_m});
  loops_[loop.to].push_back({loop.from, way_m});
  way_bounds_.AddRelation(loop.from, loop.to, way_m);
}

std::span<const double> Trail::distances_m() const {
  if (distances_current_) return distances_m_;
  distances_m_ = DistancesFromLast();
  distances_current_ = true;
  if (!empty()) way_bounds_.AddHub(distances_m_);
  return distances_m_;
}

double Trail::DistanceAtMost(std::size_t keyframe) const {
  const double along_steps_m = shapes_.back().travelled_m - shapes_[keyframe].travelled_m;
  return std::min(along_steps_m, way_bounds_.AtMostM(keyframe));
}

bool Trail::IsFarther(std::size_t keyframe, double way_m) const {
  if (DistanceAtMost(keyframe) + kRoundingM < way_m) return false;
  return distances_m()[keyframe] > way_m;
}

bool Trail::AllWithin(std::size_t begin, std::size_t end, double way_m) const {
  const double along_steps_m = shapes_.back().travelled_m - shapes_[begin].travelled_m;
  return along_steps_m + kRoundingM < way_m || way_bounds_.AllBelow(begin, end, way_m - kRoundingM);
}

// Dijkstra's search, with buckets for a queue (Dial 1969): a heap takes five times as long. Within a bucket keyframes
// are not in order, so some are looked at again; the lengths that remain are the same.
std::vector<double> Trail::DistancesFromLast() const {
  constexpr double kBucketM = 0.25;
  constexpr double kMostBuckets = 65536.0;  // The last one takes all that is farther away.
  struct Reached {
    double way_m = 0.0;
    std::size_t node = 0;
  };
  std::vector<double> distance(size(), std::numeric_limits<double>::infinity());
  std::vector<std::vector<Reached>> buckets;
  std::size_t now = 0;  // The bucket that is looked at. Rounding may want to go back to the one before.
  const auto reach = [&](std::size_t node, double way_m) {
    if (!(way_m < distance[node])) return;
    distance[node] = way_m;
    const std::size_t bucket = std::max(now, static_cast<std::size_t>(std::min(way_m / kBucketM, kMostBuckets)));
    if (bucket >= buckets.size()) buckets.resize(bucket + 1);
    buckets[bucket].push_back({way_m, node});
  };
  reach(size() - 1, 0.0);
  for (; now < buckets.size(); ++now) {
    for (std::size_t i = 0; i < buckets[now].size(); ++i) {  // It grows meanwhile.
      const auto [way_m, node] = buckets[now][i];
      if (way_m > distance[node]) continue;
      if (node > 0) reach(node - 1, way_m + shapes_[node].travelled_m - shapes_[node - 1].travelled_m);
      if (node + 1 < size()) reach(node + 1, way_m + shapes_[node + 1].travelled_m - shapes_[node].travelled_m);
      for (const Loop& loop : loops_[node]) reach(loop.other, way_m + loop.way_m);
    }
  }
  return distance;
}

std::optional<std::vector<Pose2>> Trail::PathWithLoop(const PoseRelation& loop, std::vector<Pose2> path,
                                                      const PoseGraphOptions& options) const {
  std::vector<PoseRelation> relations = relations_;
  relations.push_back(PositiveDefinite(loop));
  if (!OptimiseLoopGraph(path, relations, options).usable) return std::nullopt;
  if (IsOutvoted(relations.back(), path)) return std::nullopt;
  return path;
}

Pose2 Trail::FromLast(const Pose2& T_track_robot) const {
  return empty() ? Pose2{} : Between(shapes_.back().T_track_robot, T_track_robot);
}

double Trail::TravelledTo(const Pose2& T_track_robot) const {
  return empty() ? 0.0 : shapes_.back().travelled_m + FromLast(T_track_robot).translation().norm();
}

std::vector<PoseRelation> Trail::relations() const {
  const bool seen_again = std::ranges::any_of(relations_, [](const PoseRelation& one) { return one.loop; });
  return seen_again ? relations_ : std::vector<PoseRelation>{};
}

std::vector<PoseRelation> Trail::measured() const {
  std::vector<PoseRelation> measured = relations_;
  std::erase_if(measured, KeepsShape);
  const bool seen_again = std::ranges::any_of(measured, [](const PoseRelation& one) { return one.loop; });
  return seen_again ? measured : std::vector<PoseRelation>{};
}

std::vector<PoseRelation> Trail::steps_of_shaped() const {
  const bool shaped = std::ranges::any_of(relations_, KeepsShape);
  const bool seen_again =
      std::ranges::any_of(relations_, [](const PoseRelation& one) { return one.loop && !KeepsShape(one); });
  if (!shaped || seen_again) return {};
  std::vector<PoseRelation> steps = relations_;
  std::erase_if(steps, KeepsShape);
  return steps;
}

std::vector<std::uint64_t> Trail::numbers() const {
  std::vector<std::uint64_t> numbers;
  numbers.reserve(size());
  for (const KeyframeShape& shape : shapes_) numbers.push_back(shape.number);
  return numbers;
}

std::size_t Trail::CountBelow(std::uint64_t number) const {
  return static_cast<std::size_t>(std::ranges::lower_bound(shapes_, number, {}, &KeyframeShape::number) -
                                  shapes_.begin());
}

}  // namespace cairn::slam
