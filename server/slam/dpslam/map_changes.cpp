#include "server/slam/dpslam/map_changes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "server/slam/dpslam/laser_rays.h"

namespace cairn::slam {
namespace {

// Longest list: a longer one takes more memory than the array of all cells.
constexpr std::size_t kLongestList = sizeof(ChangeTile::Counts) * kChangeTileArea / sizeof(CellChange);

ChangeTile::Counts Sum(std::uint32_t travel, std::uint32_t stops) {
  while (travel > UINT16_MAX || stops > UINT16_MAX) travel /= 2, stops /= 2;
  return {static_cast<std::uint16_t>(travel), static_cast<std::uint16_t>(stops)};
}

void AddTo(std::vector<ChangeTile::Counts>& all, const ChangeTile& tile) {
  tile.ForEach([&](std::uint16_t cell, std::uint16_t travel, std::uint16_t stops) {
    ChangeTile::Counts& sum = all[cell];
    sum = Sum(std::uint32_t{sum.travel} + travel, std::uint32_t{sum.stops} + stops);
  });
}

}  // namespace

void ChangeTile::Add(ChangeTile&& other) {
  if (all.empty() && !other.all.empty()) std::swap(*this, other);
  if (all.empty() && list.size() + other.list.size() > kLongestList) {
    all.resize(kChangeTileArea);
    for (const CellChange& change : list) all[change.cell] = {change.travel, change.stops};
    std::vector<CellChange>().swap(list);
  }
  if (!all.empty()) {
    AddTo(all, other);
    return;
  }
  std::vector<CellChange> sum;
  sum.reserve(list.size() + other.list.size());
  auto a = list.begin(), b = other.list.begin();
  while (a != list.end() && b != other.list.end()) {
    if (a->cell < b->cell) {
      sum.push_back(*a++);
    } else if (b->cell < a->cell) {
      sum.push_back(*b++);
    } else {
      const Counts counts = Sum(std::uint32_t{a->travel} + b->travel, std::uint32_t{a->stops} + b->stops);
      sum.push_back({a->cell, counts.travel, counts.stops});
      ++a, ++b;
    }
  }
  sum.insert(sum.end(), a, list.end());
  sum.insert(sum.end(), b, other.list.end());
  list = std::move(sum);
}

std::size_t ChangeTile::bytes() const {
  return list.capacity() * sizeof(CellChange) + all.capacity() * sizeof(Counts);
}

ChangeTile& MapChanges::Own(std::shared_ptr<const ChangeTile>& tile) {
  if (tile.use_count() > 1) tile = std::make_shared<ChangeTile>(*tile);
  // The last other owner may have been a checkpoint on another thread. Taking and giving back the tile once more puts
  // what that thread has read before what is written now.
  const std::shared_ptr<const ChangeTile> synchronised = tile;
  return const_cast<ChangeTile&>(*tile);
}

bool MapChanges::IsAscending() const {
  return std::adjacent_find(tiles_.begin(), tiles_.end(),
                            [](const auto& a, const auto& b) { return !(a->key < b->key); }) == tiles_.end();
}

void MapChanges::Add(MapChanges&& other) {
  if (tiles_.size() < other.tiles_.size()) std::swap(tiles_, other.tiles_);
  Tiles fresh;
  auto place = tiles_.begin();
  for (std::shared_ptr<const ChangeTile>& tile : other.tiles_) {
    place = std::lower_bound(place, tiles_.end(), tile->key,
                             [](const auto& have, const ChangeTileKey& key) { return have->key < key; });
    if (place != tiles_.end() && (*place)->key == tile->key) {
      Own(*place).Add(std::move(Own(tile)));
    } else {
      fresh.push_back(std::move(tile));
    }
  }
  if (!fresh.empty()) {
    const auto old = static_cast<std::ptrdiff_t>(tiles_.size());
    std::move(fresh.begin(), fresh.end(), std::back_inserter(tiles_));
    std::inplace_merge(tiles_.begin(), tiles_.begin() + old, tiles_.end(),
                       [](const auto& a, const auto& b) { return a->key < b->key; });
  }
  other.tiles_.clear();
}

void MapChanges::KeepOnly(const ChangeTileKey& low, const ChangeTileKey& high) {
  std::erase_if(tiles_, [&](const auto& tile) {
    const ChangeTileKey& key = tile->key;
    return key.x < low.x || key.x > high.x || key.y < low.y || key.y > high.y;
  });
}

std::size_t MapChanges::bytes() const {
  std::size_t sum = tiles_.capacity() * sizeof(Tiles::value_type);
  for (const auto& tile : tiles_) sum += sizeof(ChangeTile) + tile->bytes();
  return sum;
}

void ChangePainter::Draw(const LaserRays& rays, const Pose2& T_map_robot) {
  const double c = std::cos(T_map_robot.theta), s = std::sin(T_map_robot.theta);
  const Eigen::Vector2d origin = (T_map_robot * rays.origin_robot) / resolution_m_;
  ChangeTileKey at{INT32_MIN, INT32_MIN};
  Sheet* sheet = nullptr;
  const auto cell_of = [&](int x, int y) {
    const ChangeTileKey key{y >> kTileBits, x >> kTileBits};
    if (key != at) sheet = &SheetAt(at = key);
    return static_cast<std::size_t>(((y & (kChangeTileSide - 1)) << kTileBits) | (x & (kChangeTileSide - 1)));
  };
  for (const LaserRay& ray : rays.rays) {
    const Eigen::Vector2d along(c * ray.direction.x() - s * ray.direction.y(),
                                s * ray.direction.x() + c * ray.direction.y());
    std::size_t cell = 0;
    WalkRay(origin, along, ray.length_m / resolution_m_, [&](int x, int y, double from, double to) {
      cell = cell_of(x, y);
      sheet->travel[cell] += static_cast<float>(to - from);
      sheet->touched[cell >> kTileBits] |= std::uint64_t{1} << (cell & (kChangeTileSide - 1));
    });
    if (ray.hit) ++sheet->stops[cell];
  }
}

MapChanges ChangePainter::Take() {
  MapChanges changes;
  for (auto& [key, sheet] : sheets_) {
    std::size_t count = 0;
    for (const std::uint64_t row : sheet->touched) count += static_cast<std::size_t>(std::popcount(row));
    ChangeTile tile;
    tile.key = key;
    tile.list.reserve(count);
    for (std::size_t row = 0; row < sheet->touched.size(); ++row) {
      for (std::uint64_t bits = sheet->touched[row]; bits != 0; bits &= bits - 1) {
        const std::size_t cell = (row << kTileBits) + static_cast<std::size_t>(std::countr_zero(bits));
        double travel = std::round(static_cast<double>(sheet->travel[cell]) * kTravelPerCell);
        double stops = sheet->stops[cell];
        const double shrink = std::max({1.0, travel / UINT16_MAX, stops / UINT16_MAX});
        travel = std::floor(travel / shrink), stops = std::floor(stops / shrink);
        if (travel > 0.0 || stops > 0.0)
          tile.list.push_back({static_cast<std::uint16_t>(cell), static_cast<std::uint16_t>(travel),
                               static_cast<std::uint16_t>(stops)});
        sheet->travel[cell] = 0.0F;
        sheet->stops[cell] = 0;
      }
      sheet->touched[row] = 0;
    }
    blank_.push_back(std::move(sheet));
    if (!tile.list.empty()) changes.Append(std::move(tile));
  }
  sheets_.clear();
  return changes;
}

ChangePainter::Sheet& ChangePainter::SheetAt(const ChangeTileKey& key) {
  std::unique_ptr<Sheet>& sheet = sheets_[key];
  if (!sheet && !blank_.empty()) {
    sheet = std::move(blank_.back());
    blank_.pop_back();
  } else if (!sheet) {
    sheet = std::make_unique<Sheet>();
  }
  return *sheet;
}

}  // namespace cairn::slam
