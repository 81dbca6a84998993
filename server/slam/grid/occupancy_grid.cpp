#include "server/slam/grid/occupancy_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::slam {
namespace {

constexpr double kUnitsPerLogOdd = 100.0;

}  // namespace

std::int16_t LogOddsOf(double probability) {
  return static_cast<std::int16_t>(std::lround(kUnitsPerLogOdd * std::log(probability / (1.0 - probability))));
}

std::uint8_t OccupancyOf(std::int16_t log_odds) {
  if (log_odds == kUnseen) return kUnknownCell;
  const double odds = std::exp(log_odds / kUnitsPerLogOdd);
  return static_cast<std::uint8_t>(std::lround(100.0 * odds / (1.0 + odds)));
}

TileCells OccupanciesOf(const GridChunk& chunk) {
  TileCells cells;
  // Most cells have the log odds of the cell before: an exponential for each would be most of the work.
  std::int16_t before = kUnseen;
  std::uint8_t occupancy = kUnknownCell;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (chunk.log_odds[i] != before) {
      before = chunk.log_odds[i];
      occupancy = OccupancyOf(before);
    }
    cells[i] = occupancy;
  }
  return cells;
}

void Visit(OptionVisitor& visitor, GridOptions& options) {
  static constexpr std::string_view kModels[] = {"probabilistic", "deterministic", "triangular", "degrading"};
  VisitEnum(
      visitor, "model", options.model, kModels,
      "What a cell adds up. probabilistic adds the evidence of all scans, and triangular spreads each hit over "
      "hit_spread_m; deterministic believes the last scan, and degrading frees an occupied cell by degrees only.");
  visitor.Real("resolution_m", options.resolution_m, "m", 0.01, 1.0,
               ForOperators("Side of a cell of the map. Smaller cells show more detail and take more time and memory, "
                            "which grow with the square."));
  visitor.Real("hit_probability", options.hit_probability, "1", 0.51, 0.99,
               "Probability that a cell is occupied after one hit. Nearer to 1, one hit is enough for a wall.");
  visitor.Real("miss_probability", options.miss_probability, "1", 0.01, 0.49,
               "Probability that a cell is occupied after one beam has passed it. Nearer to 0, one beam is enough to "
               "clear a wall.");
  visitor.Real("clamp_probability", options.clamp_probability, "1", 0.6, 0.999,
               "Largest probability of a cell. Nearer to 1, more contrary evidence is needed to change a cell.");
  visitor.Real("max_ray_m", options.max_ray_m, "m", 1.0, 100.0,
               ForOperators("Beams are drawn up to this length; what is hit farther away is not drawn. A robot takes "
                            "(2 max_ray_m / resolution_m)^2 bytes."));
  visitor.Real("no_return_free_m", options.no_return_free_m, "m", 0.0, 100.0,
               ForOperators("Length up to which a beam without an echo clears the map. 0 ignores such beams."));
  visitor.Real("hit_spread_m", options.hit_spread_m, "m", 0.01, 1.0,
               "With model triangular, the distance from a hit at which its density has fallen to zero. A larger value "
               "draws thicker walls.");
  visitor.Require(options.hit_probability <= options.clamp_probability, "hit_probability", "must not exceed",
                  "clamp_probability");
  visitor.Require(options.miss_probability >= 1.0 - options.clamp_probability, "miss_probability",
                  "must be at least 1 minus", "clamp_probability");
  visitor.Require(options.no_return_free_m <= options.max_ray_m, "no_return_free_m", "must not exceed", "max_ray_m");
}

OccupancyGrid::OccupancyGrid(const GridOptions& options)
    : options_(options), clamp_(LogOddsOf(options.clamp_probability)) {
  // If one observation decides, its step is larger than the range of values that a cell can hold.
  const auto decides = static_cast<std::int16_t>(2 * clamp_);
  const bool hit_decides = options.model == GridModel::kDeterministic || options.model == GridModel::kDegrading;
  hit_ = hit_decides ? decides : LogOddsOf(options.hit_probability);
  adds_up_ = options.model == GridModel::kProbabilistic || options.model == GridModel::kDeterministic;
  miss_ = options.model == GridModel::kDeterministic ? static_cast<std::int16_t>(-decides)
                                                     : LogOddsOf(options.miss_probability);
}

OccupancyGrid::OccupancyGrid(const GridOptions& options, const Chunks& shared) : OccupancyGrid(options) {
  for (const auto& [key, chunk] : shared) slots_[key].shared = chunk;
}

void OccupancyGrid::Draw(const Scan& scan, const Pose2& T_map_robot, const Wants& wants, Looks* looks) {
  const RasterOptions raster{options_.resolution_m, options_.max_ray_m, options_.no_return_free_m,
                             options_.model == GridModel::kTriangular ? options_.hit_spread_m : 0.0};
  // A scan touches few chunks, but goes from one to the next in every row of cells.
  struct Place {
    int x;
    GridChunk* chunk;  // Null: not wanted.
    CellMask* looks;   // Null: not noted.
  };
  std::vector<Place> places;  // The chunks of one row of chunks.
  int row = std::numeric_limits<int>::min();
  static_assert(kTileCells % ScanRaster::kPiece == 0);  // A piece lies in one chunk.
  raster_.Rasterise(scan, T_map_robot, raster, [&](GridCell first, const ScanRaster::Piece& marks) {
    const ChunkKey key = ChunkOf(first);
    if (key.y != row) places.clear();
    row = key.y;
    auto place = std::ranges::find(places, key.x, &Place::x);
    if (place == places.end()) {
      GridChunk* const chunk = !wants || wants(key) ? &Writable(key) : nullptr;
      place = places.insert(place, {key.x, chunk, chunk != nullptr && looks != nullptr ? &(*looks)[key] : nullptr});
    }
    if (place->chunk == nullptr) return;
    const std::size_t index = IndexInChunk(first, key);
    if (place->looks != nullptr) place->looks->AddTouched(index, marks);
    std::int16_t* cells = place->chunk->log_odds.data() + index;
    if (adds_up_) return AddUp(marks, cells);
    for (std::size_t i = 0; i < marks.size(); ++i)
      if (marks[i] != ScanRaster::kUntouched) cells[i] = After(cells[i], ScanRaster::HitShare(marks[i]));
  });
}

// What After does, where every mark is a whole hit or none. Written so that compilers vectorise it.
void OccupancyGrid::AddUp(const ScanRaster::Piece& marks, std::int16_t* cells) const {
  const std::int16_t hit = hit_, miss = miss_, high = clamp_, low = static_cast<std::int16_t>(-clamp_);
  std::array<std::int16_t, ScanRaster::kPiece> values;
  std::copy_n(cells, values.size(), values.begin());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::int16_t before = values[i], held = before == kUnseen ? std::int16_t{0} : before;
    const auto next = static_cast<std::int16_t>(held + (marks[i] == ScanRaster::kHit ? hit : miss));
    values[i] = marks[i] == ScanRaster::kUntouched ? before : std::min(std::max(next, low), high);
  }
  std::copy(values.begin(), values.end(), cells);
}

std::int16_t OccupancyGrid::After(std::int16_t before, double hit) const {
  const int held = before == kUnseen ? 0 : before;
  int next = held + (hit > 0.0 ? static_cast<int>(std::lround(hit * hit_)) : miss_);
  if (options_.model == GridModel::kDegrading && hit == 0.0 && next <= 0) next = -clamp_;
  return static_cast<std::int16_t>(std::clamp<int>(next, -clamp_, clamp_));
}

void OccupancyGrid::ReplaceBy(OccupancyGrid&& other) {
  for (const auto& [key, slot] : slots_) changed_.insert(key);
  slots_ = std::move(other.slots_);
  for (const auto& [key, slot] : slots_) changed_.insert(key);
}

OccupancyGrid::Chunks OccupancyGrid::Share() {
  Chunks chunks;
  for (auto& [key, slot] : slots_) chunks.emplace_hint(chunks.end(), key, slot.Share());
  return chunks;
}

OccupancyGrid::Change OccupancyGrid::TakeChange() {
  Change change;
  change.reserve(changed_.size());
  for (const ChunkKey& key : changed_) {
    const auto found = slots_.find(key);
    change.emplace_back(key, found == slots_.end() ? nullptr : found->second.Share());
  }
  changed_.clear();
  return change;
}

const GridChunk* OccupancyGrid::chunk(const ChunkKey& key) const {
  const auto found = slots_.find(key);
  return found == slots_.end() ? nullptr : &found->second.chunk();
}

std::uint8_t OccupancyGrid::OccupancyAt(const Eigen::Vector2d& p_map) const {
  const GridCell cell = CellOf(p_map, options_.resolution_m);
  const ChunkKey key = ChunkOf(cell);
  const GridChunk* const found = chunk(key);
  return found == nullptr ? kUnknownCell : OccupancyOf(found->log_odds[IndexInChunk(cell, key)]);
}

GridChunk& OccupancyGrid::Writable(const ChunkKey& key) {
  changed_.insert(key);
  Slot& slot = slots_[key];
  if (slot.own) return *slot.own;
  if (slot.shared) {
    slot.own = std::make_unique<GridChunk>(*slot.shared);
    slot.shared.reset();
  } else {
    slot.own = std::make_unique<GridChunk>();
    slot.own->log_odds.fill(kUnseen);
  }
  return *slot.own;
}

}  // namespace cairn::slam
