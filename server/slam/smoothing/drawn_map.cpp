#include "server/slam/smoothing/drawn_map.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "common/geometry/angle.h"
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

// A centimetre in cells of 5 cm, at the end of the longest ray: less than the noise of a range. What a robot sees in
// its last metres turns its whole path by a few thousandths of a degree, which moves the ends of long rays by half as
// much.
constexpr double kMovedCells = 0.2;
// An earlier drawing with less in common is not continued, because all would be drawn again nevertheless.
constexpr double kLeastInCommon = 0.75;

std::uint64_t NumberOf(const MapperSnapshot& snapshot, std::size_t keyframe) {
  return snapshot.numbers.empty() ? keyframe : snapshot.numbers[keyframe];
}

double ReachOf(const Scan& scan, const GridOptions& options) {
  double ray_m = options.no_return_free_m;
  for (const float range_m : scan.ranges_m) {
    if (ClassifyRange(range_m, scan.range_min_m, scan.range_max_m) == BeamClass::kHit)
      ray_m = std::max(ray_m, std::min(static_cast<double>(range_m), options.max_ray_m));
  }
  return scan.T_robot_laser.translation().norm() + ray_m;
}

bool HasMoved(const DrawnKeyframe& drawn, const Pose2& T_map_robot, const GridOptions& options) {
  const double moved_m = (T_map_robot.translation() - drawn.T_map_robot.translation()).norm() +
                         drawn.reach_m * std::abs(AngleDiff(T_map_robot.theta, drawn.T_map_robot.theta));
  return moved_m > kMovedCells * options.resolution_m;
}

// What of an earlier drawing stays.
struct Common {
  const DrawnMap* map = nullptr;
  std::vector<const DrawnKeyframe*> kept;  // Per keyframe of the snapshot: as it was drawn, or null.
  std::size_t count = 0;                   // Of those that are not null.
};

Common CommonWith(const DrawnMap& map, const MapperSnapshot& snapshot, const std::vector<Pose2>& path) {
  Common common{&map, std::vector<const DrawnKeyframe*>(snapshot.keyframes.size(), nullptr), 0};
  auto drawn = map.keyframes.begin();
  for (std::size_t k = 0; k < snapshot.keyframes.size(); ++k) {
    const std::uint64_t number = NumberOf(snapshot, k);
    while (drawn != map.keyframes.end() && drawn->number < number) ++drawn;
    if (drawn == map.keyframes.end()) break;
    const Keyframe& keyframe = snapshot.keyframes[k];
    if (drawn->number != number || !keyframe.localized || HasMoved(*drawn, path[k], map.options)) continue;
    if (keyframe.scan.stamp() != drawn->stamp) continue;
    common.kept[k] = &*drawn;
    ++common.count;
  }
  return common;
}

Common MostInCommon(const MapperSnapshot& snapshot, const std::vector<Pose2>& path, const GridOptions& options,
                    std::span<const std::shared_ptr<const DrawnMap>> earlier) {
  Common best{nullptr, std::vector<const DrawnKeyframe*>(snapshot.keyframes.size(), nullptr), 0};
  for (const auto& map : earlier) {
    if (map == nullptr || map->options != options) continue;
    Common common = CommonWith(*map, snapshot, path);
    const auto least = static_cast<std::size_t>(kLeastInCommon * static_cast<double>(map->keyframes.size()));
    if (common.count > best.count && common.count >= least) best = std::move(common);
  }
  return best;
}

// The chunks that have to be drawn again: those into which a keyframe was drawn that is gone or lies elsewhere, and
// those into which one has to be drawn before others that are drawn already. `path` and `snapshot` as in DrawMap.
std::set<ChunkKey> Outdated(const Common& common, const MapperSnapshot& snapshot, const std::vector<Pose2>& path) {
  std::set<ChunkKey> outdated;
  if (common.map == nullptr) return outdated;
  std::set<const DrawnKeyframe*> kept(common.kept.begin(), common.kept.end());
  for (const DrawnKeyframe& drawn : common.map->keyframes)
    if (!kept.contains(&drawn)) outdated.insert(drawn.drawn_in.begin(), drawn.drawn_in.end());
  const std::uint64_t last = common.map->keyframes.back().number;
  OccupancyGrid grid(common.map->options);
  for (std::size_t k = 0; k < snapshot.keyframes.size() && NumberOf(snapshot, k) <= last; ++k) {
    if (common.kept[k] != nullptr || !snapshot.keyframes[k].localized) continue;
    grid.Draw(*snapshot.keyframes[k].scan, path[k], [&outdated](const ChunkKey& key) {
      outdated.insert(key);
      return false;
    });
  }
  return outdated;
}

const GridChunk* Find(const OccupancyGrid::Chunks& chunks, const ChunkKey& key) {
  const auto found = chunks.find(key);
  return found == chunks.end() ? nullptr : found->second.get();
}

bool ContainsAny(const std::set<ChunkKey>& all, const std::vector<ChunkKey>& some) {
  return std::ranges::any_of(some, [&all](const ChunkKey& key) { return all.contains(key); });
}

}  // namespace

Disagreement DrawnMap::Sum() const {
  Disagreement sum;
  for (const DrawnKeyframe& one : keyframes) sum.Add(one.disagreement);
  return sum;
}

std::size_t DrawnMap::Bytes() const {
  std::size_t bytes = chunks.size() * sizeof(GridChunk) + keyframes.capacity() * sizeof(DrawnKeyframe);
  for (const DrawnKeyframe& one : keyframes)
    bytes += (one.drawn_in.capacity() + one.compared_with.capacity()) * sizeof(ChunkKey);
  return bytes;
}

std::size_t DrawnMaps::Bytes() const {
  return (online ? online->Bytes() : 0) + (smoothed && smoothed != online ? smoothed->Bytes() : 0);
}

std::shared_ptr<const DrawnMap> DrawMap(const MapperSnapshot& snapshot, const std::vector<Pose2>& path,
                                        const GridOptions& options,
                                        std::span<const std::shared_ptr<const DrawnMap>> earlier,
                                        const std::function<bool()>& next) {
  const Common common = MostInCommon(snapshot, path, options, earlier);
  const std::set<ChunkKey> outdated = Outdated(common, snapshot, path);
  OccupancyGrid::Chunks before;
  if (common.map != nullptr) before = common.map->chunks;
  OccupancyGrid::Chunks valid = before;
  std::erase_if(valid, [&outdated](const auto& one) { return outdated.contains(one.first); });
  OccupancyGrid grid(options, valid);

  const auto drawn = std::make_shared<DrawnMap>();
  drawn->options = options;
  drawn->keyframes.reserve(snapshot.keyframes.size());
  std::set<ChunkKey> changed = outdated;
  for (std::size_t k = 0; k < snapshot.keyframes.size(); ++k) {
    if (!next()) return nullptr;
    const Keyframe& keyframe = snapshot.keyframes[k];
    if (!keyframe.localized) continue;
    if (const DrawnKeyframe* kept = common.kept[k]; kept != nullptr) {
      drawn->keyframes.push_back(*kept);
      if (ContainsAny(outdated, kept->drawn_in))
        grid.Draw(*keyframe.scan, kept->T_map_robot,
                  [&outdated](const ChunkKey& key) { return outdated.contains(key); });
      continue;
    }
    const auto scan = keyframe.scan.Share();
    DrawnKeyframe one{.number = NumberOf(snapshot, k),
                      .stamp = scan->stamp,
                      .T_map_robot = path[k],
                      .reach_m = ReachOf(*scan, options),
                      .drawn_in = {},
                      .compared_with = {},
                      .disagreement = {}};
    // One that does not follow all that were drawn before changes outdated chunks only.
    grid.Draw(*scan, path[k], [&](const ChunkKey& key) {
      one.drawn_in.push_back(key);
      changed.insert(key);
      return true;
    });
    drawn->keyframes.push_back(std::move(one));
    ++drawn->drawn_anew;
  }
  drawn->chunks = grid.Share();

  std::set<ChunkKey> blocks;
  if (common.map != nullptr)
    for (const ChunkKey& key : changed) AddChangedBlocks(key, Find(before, key), Find(drawn->chunks, key), blocks);
  ScanComparison comparison(grid);
  auto one = drawn->keyframes.begin();
  for (std::size_t k = 0; k < snapshot.keyframes.size(); ++k) {
    if (!next()) return nullptr;
    if (!snapshot.keyframes[k].localized) continue;
    const bool is_new = common.kept[k] == nullptr;
    if (is_new || ContainsAny(blocks, one->compared_with)) {
      const auto scan = snapshot.keyframes[k].scan.Share();
      one->disagreement = is_new ? comparison.Compare(*scan, one->T_map_robot, one->compared_with)
                                 : comparison.Compare(*scan, one->T_map_robot);
    }
    ++one;
  }
  return drawn;
}

}  // namespace cairn::slam
