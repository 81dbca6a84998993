#include "server/slam/smoothing/smoothed_map.h"

#include <utility>

#include "server/slam/smoothing/smoothed_path.h"

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
    drawing.grid.Draw(*snapshot.keyframes[k].scan, path[k]);
  }
  for (std::size_t k = 0; k < snapshot.keyframes.size(); ++k) {
    if (!next()) return {};
    drawing.disagreement.Add(*snapshot.keyframes[k].scan, path[k], drawing.grid);
  }
  return drawing;
}

}  // namespace

std::optional<SmoothedMap> SmoothMap(const MapperSnapshot& snapshot, const GridOptions& options,
                                     const std::function<bool()>& next) {
  auto online = DrawAlong(snapshot.online_path, snapshot, options, next);
  if (!online) return {};
  std::vector<Pose2> path = SmoothedPath(snapshot);
  auto smoothed = DrawAlong(path, snapshot, options, next);
  if (!smoothed) return {};
  const Disagreement before = online->disagreement;
  // A fitted path is the best there is: figures nearly alike must not overrule it.
  const bool fitted = !snapshot.pose_graph.enabled || !snapshot.relations.empty();
  if (!fitted && before.mean_m2() < smoothed->disagreement.mean_m2())
    return SmoothedMap{snapshot.online_path, std::move(online->grid), before, before};
  return SmoothedMap{std::move(path), std::move(smoothed->grid), before, smoothed->disagreement};
}

}  // namespace cairn::slam
