#include "server/slam/dpslam/ancestry.h"

#include <algorithm>
#include <utility>

namespace cairn::slam {

Ancestry::Ancestry() : nodes_(1), living_{0} {}

void Ancestry::NextGeneration(std::vector<Child> children) {
  const std::vector<Id> parents = std::exchange(living_, {});
  living_.reserve(children.size());
  for (Child& child : children) living_.push_back(Add(parents[child.parent], std::move(child.changes)));
  for (const Id id : parents) {
    if (nodes_[id].child_count == 0)
      RemoveChildless(id);
    else if (nodes_[id].child_count == 1)
      JoinOnlyChild(id);
  }
}

void Ancestry::KeepOnly(const ChangeTileKey& low, const ChangeTileKey& high) {
  for (Node& node : nodes_) node.changes.KeepOnly(low, high);
}

bool Ancestry::IsTree() const {
  std::vector<std::uint32_t> count(nodes_.size()), visits(nodes_.size());
  std::vector<std::uint64_t> sum(nodes_.size());
  std::size_t reached = 0;
  for (const Id living : living_) {
    if (living >= nodes_.size() || visits[living] > 0 || nodes_[living].child_count > 0) return false;
    // Towards the root, as far as no other living particle has led. A circle would visit a node again.
    for (Id id = living;;) {
      if (++visits[id] > 1) break;
      ++reached;
      const Id parent = nodes_[id].parent;
      if (parent == kNobody) break;
      if (parent >= nodes_.size() || parent == id) return false;
      ++count[parent];
      sum[parent] += id;
      id = parent;
    }
  }
  std::size_t roots = 0;
  for (Id id = 0; id < nodes_.size(); ++id) {
    const Node& node = nodes_[id];
    if (visits[id] == 0) continue;
    roots += node.parent == kNobody ? 1 : 0;
    if (node.child_count != count[id] || node.child_sum != sum[id] || visits[id] > node.child_count + 1) return false;
  }
  for (const Id id : free_) {
    if (id >= nodes_.size() || visits[id]++ > 0) return false;
  }
  return !living_.empty() && roots == 1 && reached + free_.size() == nodes_.size();
}

Ancestry::Id Ancestry::Add(Id parent, MapChanges changes) {
  Id id = static_cast<Id>(nodes_.size());
  if (free_.empty()) {
    nodes_.emplace_back();
  } else {
    id = free_.back();
    free_.pop_back();
  }
  nodes_[id] = {parent, 0, 0, std::move(changes)};
  ++nodes_[parent].child_count;
  nodes_[parent].child_sum += id;
  return id;
}

void Ancestry::RemoveChildless(Id id) {
  while (nodes_[id].child_count == 0) {
    const Id parent = nodes_[id].parent;
    nodes_[id] = {};
    free_.push_back(id);
    --nodes_[parent].child_count;  // The loop ends at the latest where a living particle branches off.
    nodes_[parent].child_sum -= id;
    id = parent;
  }
  if (nodes_[id].child_count == 1) JoinOnlyChild(id);
}

// The child takes the parent's place and keeps its own id, because living particles are referred to by id.
void Ancestry::JoinOnlyChild(Id id) {
  const Id child = static_cast<Id>(nodes_[id].child_sum);
  Node& old = nodes_[id];
  old.changes.Add(std::move(nodes_[child].changes));
  nodes_[child].changes = std::move(old.changes);
  nodes_[child].parent = old.parent;
  if (old.parent != kNobody) nodes_[old.parent].child_sum += std::uint64_t{child} - id;
  old = {};
  free_.push_back(id);
}

void Ancestry::LineTo(Id id, std::vector<Id>& line) const {
  line.clear();
  for (; id != kNobody; id = nodes_[id].parent) line.push_back(id);
  std::reverse(line.begin(), line.end());
}

std::size_t Ancestry::depth() const {
  std::size_t deepest = 0;
  std::vector<Id> line;
  for (const Id id : living_) {
    LineTo(id, line);
    deepest = std::max(deepest, line.size());
  }
  return deepest;
}

std::size_t Ancestry::bytes() const {
  std::size_t sum = nodes_.capacity() * sizeof(Node);
  for (const Node& node : nodes_) sum += node.changes.bytes();
  return sum;
}

}  // namespace cairn::slam
