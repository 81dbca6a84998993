// The family tree of the particles: every one that lives is a leaf and holds what it changed of its parent's map; its
// map is the sum along its line of ancestors. Who leaves no descendants is removed; who has one child only becomes one
// with it. So every inner particle has at least two children, the tree holds fewer than twice as many particles as
// live, and no line is longer than their number, however long the robot drives. Not thread-safe for writing. Source:
// Eliazar, Parr 2003; thesis C 3.2.3.2, Figure 3.10.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/dpslam/map_changes.h"

namespace cairn::slam {

class Ancestry {
 public:
  using Id = std::uint32_t;
  static constexpr Id kNobody = UINT32_MAX;

  struct Birth {
    std::size_t parent = 0;  // Index in living().
    MapChanges changes;
  };

  Ancestry();  // One particle with nothing on its map.

  // The births become the living. REQUIRES: at least one, ordered by parent; that keeps relatives side by side.
  void NextGeneration(std::vector<Birth> births);
  // All maps forget what lies outside [low, high].
  void KeepOnly(const ChangeTileKey& low, const ChangeTileKey& high);

  [[nodiscard]] std::span<const Id> living() const { return living_; }
  [[nodiscard]] const MapChanges& changes(Id id) const { return nodes_[id].changes; }
  [[nodiscard]] Id parent(Id id) const { return nodes_[id].parent; }
  [[nodiscard]] int children(Id id) const { return static_cast<int>(nodes_[id].child_count); }

  // From the oldest ancestor down to `id`.
  void LineTo(Id id, std::vector<Id>& line) const;
  [[nodiscard]] std::size_t size() const { return nodes_.size() - free_.size(); }
  [[nodiscard]] std::size_t depth() const;  // Of the longest line.
  [[nodiscard]] std::size_t bytes() const;  // All changes of all particles.

 private:
  struct Node {
    Id parent = kNobody;
    std::uint32_t child_count = 0;
    std::uint64_t child_sum = 0;  // Of the children's ids: the only child's, where there is one.
    MapChanges changes;
  };
  Id Add(Id parent, MapChanges changes);
  void RemoveChildless(Id id);
  void JoinOnlyChild(Id id);

  std::vector<Node> nodes_;
  std::vector<Id> free_;
  std::vector<Id> living_;
};

}  // namespace cairn::slam
