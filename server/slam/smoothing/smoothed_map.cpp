#include "server/slam/smoothing/smoothed_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

namespace cairn::slam {
namespace {

// Of each keyframe, how far its scan disagrees with a map in which it was not drawn: keyframes with odd numbers are
// compared with the map of those with even numbers, and the other way round. A scan agrees well with a map that it is
// part of, however wrong its pose is.
std::optional<std::vector<double>> DisagreementWithOthers(const std::vector<Pose2>& path,
                                                          const MapperSnapshot& snapshot, const GridOptions& options,
                                                          const std::function<bool()>& next) {
  std::vector<double> each_m2;
  for (std::size_t half = 0; half < 2; ++half) {
    OccupancyGrid grid(options);
    for (std::size_t k = half; k < snapshot.keyframes.size(); k += 2) {
      if (!next()) return {};
      if (snapshot.keyframes[k].localized) grid.Draw(*snapshot.keyframes[k].scan, path[k]);
    }
    for (std::size_t k = 1 - half; k < snapshot.keyframes.size(); k += 2) {
      if (!next()) return {};
      if (!snapshot.keyframes[k].localized) continue;
      Disagreement one;
      one.Add(*snapshot.keyframes[k].scan, path[k], grid);
      each_m2.push_back(one.mean_m2());
    }
  }
  return each_m2;
}

// Whether the values of `a` are smaller than those of `b`, by more than chance explains: a t-test of the differences.
// Neighbouring scans share their errors, so a block of them counts as one value.
bool IsClearlySmaller(const std::vector<double>& a, const std::vector<double>& b) {
  constexpr std::size_t kBlock = 5, kLeastBlocks = 4;
  // Standard errors of the mean. Blocks of odd and of even keyframes lie side by side on the way and share errors as
  // well, so that three are about two of blocks that share none.
  constexpr double kClearly = 3.0;
  const std::size_t blocks = a.size() / kBlock;
  if (blocks < kLeastBlocks) return false;
  const auto count = static_cast<double>(blocks);
  std::vector<double> better(blocks, 0.0);
  double mean = 0.0, squares = 0.0;
  for (std::size_t block = 0; block < blocks; ++block) {
    for (std::size_t i = block * kBlock; i < (block + 1) * kBlock; ++i) better[block] += (b[i] - a[i]) / kBlock;
    mean += better[block] / count;
  }
  for (const double one : better) squares += (one - mean) * (one - mean);
  return mean > kClearly * std::sqrt(squares / (count * (count - 1.0)));
}

// True if there are no relations to fit, although the fit is wanted. Then the scans choose between two paths.
bool IsChosenByScans(const MapperSnapshot& snapshot) {
  return snapshot.pose_graph.enabled && snapshot.relations.empty();
}

// True if one wrong relation may have bent the fitted path.
bool IsJudgedByScans(const MapperSnapshot& snapshot) {
  return snapshot.pose_graph.enabled && !snapshot.relations.empty() && HasFewLoops(snapshot.relations);
}

// The best particle's path is one sample of many, and the online path their mean. So the sample is taken only where the
// scans clearly agree better with it.
std::optional<std::vector<Pose2>> ChosenPath(const MapperSnapshot& snapshot, const GridOptions& options,
                                             const std::function<bool()>& next) {
  const auto online = DisagreementWithOthers(snapshot.online_path, snapshot, options, next);
  if (!online) return {};
  const auto sample = DisagreementWithOthers(snapshot.full_path, snapshot, options, next);
  if (!sample) return {};
  return IsClearlySmaller(*sample, *online) ? snapshot.full_path : snapshot.online_path;
}

// A path that was fitted to few relations, unless the scans clearly agree better with the online one. A large loop that
// is right makes few scans agree better, so that the fitted path need not be clearly better.
std::optional<std::vector<Pose2>> JudgedPath(const MapperSnapshot& snapshot, std::vector<Pose2> fitted,
                                             const GridOptions& options, const std::function<bool()>& next) {
  const auto online = DisagreementWithOthers(snapshot.online_path, snapshot, options, next);
  if (!online) return {};
  const auto after = DisagreementWithOthers(fitted, snapshot, options, next);
  if (!after) return {};
  if (IsClearlySmaller(*online, *after)) return snapshot.online_path;
  return fitted;
}

// The smoothed one first, because after a job the robot's online path is what the job has smoothed.
std::array<std::shared_ptr<const DrawnMap>, 2> DrawingsOf(const DrawnMaps* drawn) {
  if (drawn == nullptr) return {};
  return {drawn->smoothed, drawn->online};
}

SmoothedMap MapOf(DrawnMaps maps, std::vector<Pose2> path, DrawnMaps* kept) {
  SmoothedMap map{std::move(path), OccupancyGrid(maps.smoothed->options, maps.smoothed->chunks), maps.online->Sum(),
                  maps.smoothed->Sum()};
  if (kept != nullptr) *kept = std::move(maps);
  return map;
}

}  // namespace

std::optional<std::vector<Pose2>> SmoothedPath(const MapperSnapshot& snapshot, const std::function<bool()>& go_on) {
  std::vector<Pose2> path = snapshot.full_path;
  // If the optimisation finds nothing better, it leaves the path as it is.
  if (snapshot.pose_graph.enabled && OptimisePoses(path, snapshot.relations, snapshot.pose_graph, go_on).cancelled)
    return std::nullopt;
  return path;
}

std::vector<Pose2> SmoothedPath(const MapperSnapshot& snapshot) {
  return *SmoothedPath(snapshot, {});
}

std::optional<SmoothedMap> MapAlong(const MapperSnapshot& snapshot, std::vector<Pose2> path, const GridOptions& options,
                                    const std::function<bool()>& next, DrawnMaps* drawn) {
  const std::array earlier = DrawingsOf(drawn);
  auto online = DrawMap(snapshot, snapshot.online_path, options, earlier, next);
  if (!online) return {};
  auto smoothed = DrawMap(snapshot, path, options, earlier, next);
  if (!smoothed) return {};
  return MapOf({std::move(online), std::move(smoothed)}, std::move(path), drawn);
}

std::size_t SmoothingSteps(const MapperSnapshot& snapshot, bool fitted_elsewhere) {
  const bool compares = (IsChosenByScans(snapshot) || IsJudgedByScans(snapshot)) && !fitted_elsewhere;
  const std::size_t per_keyframe = compares ? 8 : 4;
  return per_keyframe * snapshot.keyframes.size();
}

std::optional<SmoothedMap> SmoothMap(const MapperSnapshot& snapshot, const GridOptions& options,
                                     const std::function<bool()>& next, const std::function<bool()>& go_on,
                                     DrawnMaps* drawn) {
  const std::array earlier = DrawingsOf(drawn);
  auto online = DrawMap(snapshot, snapshot.online_path, options, earlier, next);
  if (!online) return {};
  auto path = IsChosenByScans(snapshot) ? ChosenPath(snapshot, options, next) : SmoothedPath(snapshot, go_on);
  if (path && IsJudgedByScans(snapshot)) path = JudgedPath(snapshot, *std::move(path), options, next);
  if (!path) return {};
  auto smoothed = *path == snapshot.online_path ? online : DrawMap(snapshot, *path, options, earlier, next);
  if (!smoothed) return {};
  return MapOf({std::move(online), std::move(smoothed)}, *std::move(path), drawn);
}

}  // namespace cairn::slam
