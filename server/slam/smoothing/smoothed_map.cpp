#include "server/slam/smoothing/smoothed_map.h"

#include <utility>

namespace cairn::slam {
namespace {

struct Drawing {
  OccupancyGrid grid;
  Disagreement disagreement;
};

std::optional<Drawing> DrawAlong(const std::vector<Pose2>& path, const MapperSnapshot& snapshot,
                                 const GridOptions& options, const std::function<bool()>& next) {
  Drawing drawing{OccupancyGrid(options), {}};
  for (std::size_t k = 0; k < snapshot.keyframes.size(); ++k) {
    if (!next()) return {};
    if (snapshot.keyframes[k].localized) drawing.grid.Draw(*snapshot.keyframes[k].scan, path[k]);
  }
  for (std::size_t k = 0; k < snapshot.keyframes.size(); ++k) {
    if (!next()) return {};
    if (snapshot.keyframes[k].localized) drawing.disagreement.Add(*snapshot.keyframes[k].scan, path[k], drawing.grid);
  }
  return drawing;
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
                                    const std::function<bool()>& next) {
  const auto online = DrawAlong(snapshot.online_path, snapshot, options, next);
  if (!online) return {};
  auto smoothed = DrawAlong(path, snapshot, options, next);
  if (!smoothed) return {};
  return SmoothedMap{std::move(path), std::move(smoothed->grid), online->disagreement, smoothed->disagreement};
}

std::optional<SmoothedMap> SmoothMap(const MapperSnapshot& snapshot, const GridOptions& options,
                                     const std::function<bool()>& next, const std::function<bool()>& go_on) {
  auto online = DrawAlong(snapshot.online_path, snapshot, options, next);
  if (!online) return {};
  auto path = SmoothedPath(snapshot, go_on);
  if (!path) return {};
  auto smoothed = DrawAlong(*path, snapshot, options, next);
  if (!smoothed) return {};
  const Disagreement before = online->disagreement;
  // An optimised path is always preferred: the two disagreements are often nearly alike and must not decide
  // against it.
  const bool fitted = !snapshot.pose_graph.enabled || !snapshot.relations.empty();
  if (!fitted && before.mean_m2() < smoothed->disagreement.mean_m2())
    return SmoothedMap{snapshot.online_path, std::move(online->grid), before, before};
  return SmoothedMap{*std::move(path), std::move(smoothed->grid), before, smoothed->disagreement};
}

}  // namespace cairn::slam
