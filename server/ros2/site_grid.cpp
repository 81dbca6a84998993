#include "server/ros2/site_grid.h"

#include <algorithm>
#include <utility>

namespace cairn::server {
namespace {

std::int8_t RosCell(std::uint8_t cell) {
  return cell == kUnknownCell ? std::int8_t{-1} : static_cast<std::int8_t>(std::min<std::uint8_t>(cell, 100));
}

}  // namespace

std::uint64_t SiteGrid::Bounds::cells() const {
  if (empty()) return 0;
  const auto tiles = static_cast<std::uint64_t>(x_max - x_min + 1) * static_cast<std::uint64_t>(y_max - y_min + 1);
  return tiles * static_cast<std::uint64_t>(kTileArea);
}

void SiteGrid::Bounds::Add(int x, int y) {
  if (empty()) {
    *this = {x, y, x, y};
    return;
  }
  x_min = std::min(x_min, x);
  y_min = std::min(y_min, y);
  x_max = std::max(x_max, x);
  y_max = std::max(y_max, y);
}

SiteGrid::SiteGrid(std::string frame, double map_period_s, std::int64_t max_cells)
    : frame_(std::move(frame)), period_(map_period_s), max_cells_(static_cast<std::uint64_t>(max_cells)) {}

bool SiteGrid::Enter(std::uint32_t epoch) {
  if (epoch < epoch_) return false;
  if (epoch == epoch_) return true;
  // The map changed as a whole: what does not come again is no part of it.
  epoch_ = epoch;
  for (const auto& [place, cells] : tiles_) changed_.Add(place.second, place.first);
  if (std::exchange(epoch_was_complete_, false) || waited_) tiles_before_ = std::move(tiles_);
  tiles_.clear();
  incomplete_since_.reset();
  waited_ = false;
  return true;
}

void SiteGrid::Take(const MapInfo& info) {
  site_ = info.site;
  resolution_ = info.resolution_m;
  if (!Enter(info.epoch)) return;
  info_epoch_ = info.epoch;
  tile_count_ = info.tile_count;
  NoteComplete();
}

void SiteGrid::Take(const TileSample& sample) {
  const TileKey& key = sample.tile.key;
  if (key.level != 0 || !Enter(sample.tile.epoch)) return;
  if (sample.deleted) {
    if (tiles_.erase({key.y, key.x}) > 0) changed_.Add(key.x, key.y);
    return;
  }
  auto cells = DecodeCells(sample.tile.bytes, sample.tile.encoding);
  if (!cells) return;
  tiles_.insert_or_assign({key.y, key.x}, *cells);
  changed_.Add(key.x, key.y);
  NoteComplete();
}

void SiteGrid::NoteComplete() {
  if (!complete()) return;
  incomplete_since_.reset();
  waited_ = false;
  // A map without tiles may be one of which the tiles are still being read.
  epoch_was_complete_ = epoch_was_complete_ || tile_count_ > 0;
  tiles_before_.clear();
}

bool SiteGrid::IsHeld(Clock::time_point now) {
  if (complete()) return false;
  if (!incomplete_since_) incomplete_since_ = now;
  waited_ = waited_ || now - *incomplete_since_ >= kCompleteWithin;
  return !waited_;
}

std::vector<std::int8_t> SiteGrid::CellsOf(const Tiles& tiles, const Bounds& bounds) {
  const auto width = static_cast<std::size_t>(bounds.x_max - bounds.x_min + 1) * kTileCells;
  std::vector<std::int8_t> cells(bounds.cells(), -1);
  for (int y = bounds.y_min; y <= bounds.y_max; ++y) {
    const auto end = tiles.upper_bound({y, bounds.x_max});
    for (auto tile = tiles.lower_bound({y, bounds.x_min}); tile != end; ++tile) {
      const auto left = static_cast<std::size_t>(tile->first.second - bounds.x_min) * kTileCells;
      const auto bottom = static_cast<std::size_t>(y - bounds.y_min) * kTileCells;
      for (std::size_t row = 0; row < kTileCells; ++row) {
        const auto* const from = tile->second.begin() + static_cast<std::ptrdiff_t>(row * kTileCells);
        std::transform(from, from + kTileCells,
                       cells.begin() + static_cast<std::ptrdiff_t>((bottom + row) * width + left), RosCell);
      }
    }
  }
  return cells;
}

SiteGrid::Bounds SiteGrid::BoundsOf(const Tiles& tiles) {
  Bounds bounds;
  for (const auto& [place, cells] : tiles) bounds.Add(place.second, place.first);
  return bounds;
}

ros2::Grid SiteGrid::Now(Stamp stamp) const {
  const Tiles& tiles = complete() || waited_ || epoch_was_complete_ ? tiles_ : tiles_before_;
  const Bounds bounds = BoundsOf(tiles);
  if (!bounds.empty() && bounds.cells() <= max_cells_) return Whole(tiles, bounds, stamp);
  ros2::Grid nothing;
  nothing.header = {stamp, frame_};
  nothing.loaded = stamp;
  nothing.resolution = resolution_;
  return nothing;
}

ros2::Grid SiteGrid::Whole(const Tiles& tiles, const Bounds& bounds, Stamp stamp) const {
  ros2::Grid grid;
  grid.header = {stamp, frame_};
  grid.loaded = stamp;
  grid.resolution = resolution_;
  grid.width = static_cast<std::uint32_t>((bounds.x_max - bounds.x_min + 1) * kTileCells);
  grid.height = static_cast<std::uint32_t>((bounds.y_max - bounds.y_min + 1) * kTileCells);
  grid.T_frame_origin = {bounds.x_min * kTileCells * resolution_, bounds.y_min * kTileCells * resolution_, 0.0};
  grid.cells = CellsOf(tiles, bounds);
  return grid;
}

SiteGrid::Due SiteGrid::Next(bool wanted, Stamp stamp, Clock::time_point now) {
  wanted_ = wanted_ || wanted;
  if (IsHeld(now)) return {};
  wanted = std::exchange(wanted_, false);
  if (site_.empty() || (changed_.empty() && !whole_is_old_)) return {};
  Bounds bounds = BoundsOf(tiles_);
  if (bounds.empty()) bounds = published_;  // The site was emptied: nothing of it is known any more.
  too_large_ = bounds.cells() > max_cells_;
  if (bounds.empty() || too_large_) return {};
  const bool first = published_.empty();
  const bool resized = !(bounds == published_);
  const auto age = now - whole_at_;
  if (wanted || first || (resized && age >= kShortestPeriod) || age >= period_) {
    published_ = bounds;
    changed_ = {};
    whole_is_old_ = false;
    whole_at_ = now;
    return Whole(tiles_, published_, stamp);
  }
  if (resized || changed_.empty()) return {};
  // A tile outside may have come and gone in between.
  changed_ = {std::max(changed_.x_min, bounds.x_min), std::max(changed_.y_min, bounds.y_min),
              std::min(changed_.x_max, bounds.x_max), std::min(changed_.y_max, bounds.y_max)};
  if (changed_.empty() || changed_.y_max < changed_.y_min) {
    changed_ = {};
    return {};
  }
  ros2::GridUpdate update;
  update.header = {stamp, frame_};
  update.x = (changed_.x_min - published_.x_min) * kTileCells;
  update.y = (changed_.y_min - published_.y_min) * kTileCells;
  update.width = static_cast<std::uint32_t>((changed_.x_max - changed_.x_min + 1) * kTileCells);
  update.height = static_cast<std::uint32_t>((changed_.y_max - changed_.y_min + 1) * kTileCells);
  update.cells = CellsOf(tiles_, changed_);
  changed_ = {};
  whole_is_old_ = true;
  return update;
}

}  // namespace cairn::server
