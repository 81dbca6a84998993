#include "server/slam/grid/occupancy_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::slam {
namespace {

constexpr double kUnitsPerLogOdd = 100.0;

std::int16_t LogOdds(double probability) {
  return static_cast<std::int16_t>(std::lround(kUnitsPerLogOdd * std::log(probability / (1.0 - probability))));
}

std::size_t IndexInChunk(const GridCell& cell, const ChunkKey& key) {
  return static_cast<std::size_t>((cell.y - key.y * kTileCells) * kTileCells + (cell.x - key.x * kTileCells));
}

}  // namespace

std::uint8_t OccupancyOf(std::int16_t log_odds) {
  if (log_odds == kUnseen) return kUnknownCell;
  const double odds = std::exp(log_odds / kUnitsPerLogOdd);
  return static_cast<std::uint8_t>(std::lround(100.0 * odds / (1.0 + odds)));
}

void Visit(OptionVisitor& visitor, GridOptions& options) {
  static constexpr std::string_view kModels[] = {"probabilistic", "deterministic"};
  VisitEnum(visitor, "model", options.model, kModels,
            "Evidence adds up (probabilistic) or the last scan decides (deterministic).");
  visitor.Real("resolution_m", options.resolution_m, "m", 0.01, 1.0, "Side of a cell of level 0.");
  visitor.Real("hit_probability", options.hit_probability, "1", 0.51, 0.99, "Nearer 1: one hit makes a wall.");
  visitor.Real("miss_probability", options.miss_probability, "1", 0.01, 0.49, "Nearer 0: one ray through clears it.");
  visitor.Real("clamp_probability", options.clamp_probability, "1", 0.6, 0.999,
               "Nearer 1: more contrary evidence is needed to change a cell.");
  visitor.Real(
      "max_ray_m", options.max_ray_m, "m", 1.0, 100.0,
      "Rays are cut here; what is hit farther away is not drawn. Takes (2 max_ray_m / resolution_m)^2 bytes a robot.");
  visitor.Real("no_return_free_m", options.no_return_free_m, "m", 0.0, 100.0,
               "How far a beam that hit nothing clears.");
}

OccupancyGrid::OccupancyGrid(const GridOptions& options)
    : options_(options), clamp_(LogOdds(options.clamp_probability)) {
  const bool deterministic = options.model == GridModel::kDeterministic;
  // One observation of a deterministic grid outweighs anything a cell can hold.
  hit_ = deterministic ? static_cast<std::int16_t>(2 * clamp_) : LogOdds(options.hit_probability);
  miss_ = deterministic ? static_cast<std::int16_t>(-2 * clamp_) : LogOdds(options.miss_probability);
}

OccupancyGrid::OccupancyGrid(const GridOptions& options, Chunks published) : OccupancyGrid(options) {
  chunks_ = std::move(published);
}

void OccupancyGrid::Draw(const Scan& scan, const Pose2& T_map_robot) {
  const RasterOptions raster{options_.resolution_m, options_.max_ray_m, options_.no_return_free_m};
  ChunkKey current{std::numeric_limits<int>::min(), 0};
  GridChunk* chunk = nullptr;
  raster_.Rasterise(scan, T_map_robot, raster, [&](GridCell cell, bool hit) {
    const ChunkKey key{FloorDiv(cell.x, kTileCells), FloorDiv(cell.y, kTileCells)};
    if (key != current) {
      chunk = &Writable(key);
      current = key;
    }
    std::int16_t& value = chunk->log_odds[IndexInChunk(cell, key)];
    const int before = value == kUnseen ? 0 : value;
    value = static_cast<std::int16_t>(std::clamp<int>(before + (hit ? hit_ : miss_), -clamp_, clamp_));
  });
}

OccupancyGrid OccupancyGrid::Share() {
  OccupancyGrid copy(options_);
  copy.chunks_ = Publish();
  return copy;
}

const OccupancyGrid::Chunks& OccupancyGrid::Publish() {
  owned_.clear();
  return chunks_;
}

std::vector<ChunkKey> OccupancyGrid::TakeDirty() {
  owned_.clear();
  std::vector<ChunkKey> keys(dirty_.begin(), dirty_.end());
  dirty_.clear();
  return keys;
}

void OccupancyGrid::MarkAllDirty() {
  for (const auto& [key, chunk] : chunks_) dirty_.insert(key);
}

std::uint8_t OccupancyGrid::OccupancyAt(const Eigen::Vector2d& p_map) const {
  const GridCell cell{static_cast<int>(std::floor(p_map.x() / options_.resolution_m)),
                      static_cast<int>(std::floor(p_map.y() / options_.resolution_m))};
  const ChunkKey key{FloorDiv(cell.x, kTileCells), FloorDiv(cell.y, kTileCells)};
  const auto found = chunks_.find(key);
  return found == chunks_.end() ? kUnknownCell : OccupancyOf(found->second->log_odds[IndexInChunk(cell, key)]);
}

GridChunk& OccupancyGrid::Writable(const ChunkKey& key) {
  dirty_.insert(key);
  std::shared_ptr<const GridChunk>& chunk = chunks_[key];
  if (owned_.insert(key).second) {
    auto fresh = chunk ? std::make_shared<GridChunk>(*chunk) : std::make_shared<GridChunk>();
    if (!chunk) fresh->log_odds.fill(kUnseen);
    chunk = std::move(fresh);
  }
  return const_cast<GridChunk&>(*chunk);  // Owned: made by this grid as non-const, not handed out yet.
}

}  // namespace cairn::slam
