#include "server/slam/dpslam/map_changes.h"

#include <algorithm>
#include <utility>

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

void MapChanges::Add(MapChanges&& other) {
  if (tiles_.size() < other.tiles_.size()) std::swap(tiles_, other.tiles_);
  std::vector<ChangeTile> fresh;
  auto place = tiles_.begin();
  for (ChangeTile& tile : other.tiles_) {
    place = std::lower_bound(place, tiles_.end(), tile.key,
                             [](const ChangeTile& have, const ChangeTileKey& key) { return have.key < key; });
    if (place != tiles_.end() && place->key == tile.key) {
      place->Add(std::move(tile));
    } else {
      fresh.push_back(std::move(tile));
    }
  }
  if (!fresh.empty()) {
    const auto old = static_cast<std::ptrdiff_t>(tiles_.size());
    std::move(fresh.begin(), fresh.end(), std::back_inserter(tiles_));
    std::inplace_merge(tiles_.begin(), tiles_.begin() + old, tiles_.end(),
                       [](const ChangeTile& a, const ChangeTile& b) { return a.key < b.key; });
  }
  other.tiles_.clear();
}

void MapChanges::KeepOnly(const ChangeTileKey& low, const ChangeTileKey& high) {
  std::erase_if(tiles_, [&](const ChangeTile& tile) {
    return tile.key.x < low.x || tile.key.x > high.x || tile.key.y < low.y || tile.key.y > high.y;
  });
}

std::size_t MapChanges::bytes() const {
  std::size_t sum = tiles_.capacity() * sizeof(ChangeTile);
  for (const ChangeTile& tile : tiles_) sum += tile.bytes();
  return sum;
}

}  // namespace cairn::slam
