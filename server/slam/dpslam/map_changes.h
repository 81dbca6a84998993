// The changes that one particle made to the map it inherited: per cell, laser travel and stops to be added to
// those of its ancestors. They are increments, not new totals. Therefore an ancestor and its only child can
// be merged by adding the smaller set to the larger, and a map is the sum along a line of ancestors, in any
// order.
// The changes are stored in square tiles of 64 x 64 cells: as a short sorted list if few cells changed, as an
// array of all cells if many did. A tile that a checkpoint holds is copied before it changes (archive.h).
// Counts of one cell in one particle stay below 65536: before they reach it, travel and stops are both
// halved, which reduces the weight of old evidence and keeps the opacity. So the sum over 10,000 ancestors
// cannot overflow 32 bits.
// Cell (0,0) has its lower-left corner at the map origin. Not thread-safe for writing.
// Source: thesis C 3.2.3.2; Eliazar, Parr 2003, 2004.
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <memory>
#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/dpslam/laser_rays.h"
#include "server/slam/dpslam/opacity.h"

namespace cairn::slam {

inline constexpr int kTileBits = 6;
inline constexpr int kChangeTileSide = 1 << kTileBits;
inline constexpr int kChangeTileArea = kChangeTileSide * kChangeTileSide;

struct ChangeTileKey {
  int y = 0;
  int x = 0;
  auto operator<=>(const ChangeTileKey&) const = default;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.y, self.x);
  }
};

struct CellChange {
  std::uint16_t cell = 0;  // y * 64 + x within the tile.
  std::uint16_t travel = 0;
  std::uint16_t stops = 0;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.cell, self.travel, self.stops);
  }
};

// Changes of one tile: either in `list`, ascending by cell, or in `all`, which has 4096 entries.
struct ChangeTile {
  struct Counts {
    std::uint16_t travel = 0;
    std::uint16_t stops = 0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.travel, self.stops);
    }
  };
  ChangeTileKey key;
  std::vector<CellChange> list;
  std::vector<Counts> all;

  void Add(ChangeTile&& other);  // REQUIRES: the same key.
  [[nodiscard]] std::size_t bytes() const;

  // Calls visit(cell, travel, stops) for every changed cell in ascending order.
  template <typename Visit>
  void ForEach(Visit&& visit) const {
    for (const CellChange& change : list) visit(change.cell, change.travel, change.stops);
    for (std::size_t cell = 0; cell < all.size(); ++cell)
      if ((all[cell].travel | all[cell].stops) != 0)
        visit(static_cast<std::uint16_t>(cell), all[cell].travel, all[cell].stops);
  }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.key, self.list, self.all);
    constexpr int kMost = 1 << 24;  // Tiles to each side of the origin.
    const ChangeTileKey& key = self.key;
    bool sound = -kMost < key.x && key.x < kMost && -kMost < key.y && key.y < kMost;
    sound = sound && (self.all.empty() || (self.all.size() == kChangeTileArea && self.list.empty()));
    for (std::size_t i = 0; i < self.list.size(); ++i)
      sound = sound && self.list[i].cell < kChangeTileArea && (i == 0 || self.list[i - 1].cell < self.list[i].cell);
    archive.Require(sound, "a tile of changes");
  }
};

class MapChanges {
 public:
  using Tiles = std::vector<std::shared_ptr<const ChangeTile>>;

  // REQUIRES: tiles are appended in ascending order of their keys.
  void Append(ChangeTile tile) { tiles_.push_back(std::make_shared<ChangeTile>(std::move(tile))); }
  // Adds the other's changes to these.
  void Add(MapChanges&& other);
  // Removes the tiles outside [low, high].
  void KeepOnly(const ChangeTileKey& low, const ChangeTileKey& high);

  [[nodiscard]] const Tiles& tiles() const { return tiles_; }
  [[nodiscard]] bool empty() const { return tiles_.empty(); }
  [[nodiscard]] std::size_t bytes() const;  // Memory on the heap.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    // Since format 11 a checkpoint shares the large tiles. It takes less time to write the others.
    if constexpr (Archive::kReads) {
      constexpr std::uint32_t kShared = 11;
      std::uint64_t count = 0;
      archive(count);
      self.tiles_.clear();
      while (archive.ok() && self.tiles_.size() < count) {
        bool shared = false;
        if (archive.format() >= kShared) archive(shared);
        if (shared) {
          archive(self.tiles_.emplace_back());
        } else {
          ChangeTile tile;
          archive(tile);
          self.Append(std::move(tile));
        }
      }
      archive.RequireThat([&] { return self.IsAscending(); }, "the tiles of a map");
    } else {
      archive(static_cast<std::uint64_t>(self.tiles_.size()));
      for (const auto& tile : self.tiles_) {
        // By its cells and not by its memory: the same state gives the same bytes.
        const bool shared = tile->list.size() + tile->all.size() >= kLarge;
        archive(shared);
        if (shared) {
          archive(tile);
        } else {
          archive(*tile);
        }
      }
    }
  }

 private:
  static constexpr std::size_t kLarge = 64;  // Cells.
  // The tile of which this map is the only owner from now on.
  static ChangeTile& Own(std::shared_ptr<const ChangeTile>& tile);
  [[nodiscard]] bool IsAscending() const;

  Tiles tiles_;  // Ascending by key. None is null, and all were made as values that can change.
};

// Draws scans taken at given poses and returns the resulting changes of the map: per cell, how far laser
// beams travelled in it and how often they were stopped. Scratch memory is kept between calls. Not
// thread-safe.
// Frames: poses are T_map_robot, finite. Source: thesis C 3.2.3.1.
class ChangePainter {
 public:
  explicit ChangePainter(double resolution_m) : resolution_m_(resolution_m) {}

  void Draw(const LaserRays& rays, const Pose2& T_map_robot);
  // Returns all changes since the last call.
  [[nodiscard]] MapChanges Take();

 private:
  struct Sheet {
    std::array<float, kChangeTileArea> travel{};  // Travel in cells.
    std::array<std::uint32_t, kChangeTileArea> stops{};
    std::array<std::uint64_t, kChangeTileSide> touched{};  // One bit per cell, one word per row.
  };
  Sheet& SheetAt(const ChangeTileKey& key);

  double resolution_m_;
  std::map<ChangeTileKey, std::unique_ptr<Sheet>> sheets_;
  std::vector<std::unique_ptr<Sheet>> blank_;
};

}  // namespace cairn::slam
