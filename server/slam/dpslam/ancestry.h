// The ancestry tree of the particles. Every living particle is a leaf and holds the changes that it made to
// its parent's map; its map is the sum of the changes along its line of ancestors. A particle without
// descendants is removed, and a particle with only one child is merged with that child. So every inner node
// has at least two children, the tree has fewer than twice as many nodes as there are living particles, and
// no line is longer than their number, however long the robot drives. Not thread-safe for writing.
// Source: Eliazar, Parr 2003; thesis C 3.2.3.2, Figure 3.10.
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

  struct Child {
    std::size_t parent = 0;  // Index in living().
    MapChanges changes;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.parent, self.changes);
    }
  };

  Ancestry();  // Starts with one particle whose map is empty.

  // The children become the living particles. REQUIRES: at least one child, ordered by parent, so that children
  // of one parent are neighbours.
  void NextGeneration(std::vector<Child> children);
  // Removes from all maps the tiles outside [low, high].
  void KeepOnly(const ChangeTileKey& low, const ChangeTileKey& high);

  [[nodiscard]] std::span<const Id> living() const { return living_; }
  [[nodiscard]] const MapChanges& changes(Id id) const { return nodes_[id].changes; }
  [[nodiscard]] Id parent(Id id) const { return nodes_[id].parent; }
  [[nodiscard]] int children(Id id) const { return static_cast<int>(nodes_[id].child_count); }

  // The line of ancestors from the oldest down to `id`.
  void LineTo(Id id, std::vector<Id>& line) const;
  [[nodiscard]] std::size_t size() const { return nodes_.size() - free_.size(); }
  [[nodiscard]] std::size_t depth() const;  // Number of particles in the longest line.
  [[nodiscard]] std::size_t bytes() const;  // Memory of all changes of all particles.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.nodes_, self.free_, self.living_);
    if constexpr (Archive::kReads) archive.RequireThat([&] { return self.IsTree(); }, "the ancestry of the particles");
  }

 private:
  struct Node {
    Id parent = kNobody;
    std::uint32_t child_count = 0;
    std::uint64_t child_sum = 0;  // Sum of the children's ids: with one child, its id.
    MapChanges changes;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.parent, self.child_count, self.child_sum, self.changes);
    }
  };
  // Whether every node is either free or an ancestor of a living one, and knows its children.
  [[nodiscard]] bool IsTree() const;
  Id Add(Id parent, MapChanges changes);
  void RemoveChildless(Id id);
  void JoinOnlyChild(Id id);

  std::vector<Node> nodes_;
  std::vector<Id> free_;
  std::vector<Id> living_;
};

}  // namespace cairn::slam
