#include "server/slam/trail/path_index.h"

#include <utility>

namespace cairn::slam {

void PathIndex::Follow(const PosePath& path) {
  const std::size_t same = path_.SharedWith(path, std::min(indexed_, path.size()));
  while (indexed_ > same) RemoveLast();
  path_ = path;
  const std::size_t end = path.size() < kLast ? 0 : (path.size() - kLast) / kAtOnce * kAtOnce;
  while (indexed_ < end) Insert(indexed_++);
}

void PathIndex::Insert(std::size_t index) {
  const Pose2& pose = path_[index];
  if (IsFar(pose)) return far_.push_back(static_cast<std::uint32_t>(index));
  while (!square_.Contains(pose)) Grow(pose);
  std::uint32_t node = 0;
  Square square = square_;
  while (nodes_[node].quarters != 0) {
    const int quarter = square.QuarterOf(pose);
    node = nodes_[node].quarters + static_cast<std::uint32_t>(quarter);
    square = square.Quarter(quarter);
  }
  nodes_[node].poses.push_back(static_cast<std::uint32_t>(index));
  if (nodes_[node].poses.size() > kMostInLeaf && square.half_m > kLeastHalfM) Divide(node, square);
}

// All poses may fall into one quarter; the next insertion divides it then.
void PathIndex::Divide(std::uint32_t node, const Square& square) {
  const auto quarters = static_cast<std::uint32_t>(nodes_.size());
  nodes_.resize(nodes_.size() + 4);
  nodes_[node].quarters = quarters;
  for (const std::uint32_t index : std::exchange(nodes_[node].poses, {}))
    nodes_[quarters + static_cast<std::uint32_t>(square.QuarterOf(path_[index]))].poses.push_back(index);
}

// The last pose is the last one of its leaf. Empty leaves stay: the path will come there again.
void PathIndex::RemoveLast() {
  const Pose2& pose = path_[--indexed_];
  if (IsFar(pose)) return far_.pop_back();
  std::uint32_t node = 0;
  for (Square square = square_; nodes_[node].quarters != 0;) {
    const int quarter = square.QuarterOf(pose);
    node = nodes_[node].quarters + static_cast<std::uint32_t>(quarter);
    square = square.Quarter(quarter);
  }
  nodes_[node].poses.pop_back();
}

// Doubles the width of the root, towards the pose.
void PathIndex::Grow(const Pose2& pose) {
  const int quarter = (pose.x < square_.x ? 1 : 0) + (pose.y < square_.y ? 2 : 0);  // That of the root as it was.
  square_ = {(quarter & 1) != 0 ? square_.x - square_.half_m : square_.x + square_.half_m,
             (quarter & 2) != 0 ? square_.y - square_.half_m : square_.y + square_.half_m, 2.0 * square_.half_m};
  const auto quarters = static_cast<std::uint32_t>(nodes_.size());
  nodes_.resize(nodes_.size() + 4);
  std::swap(nodes_[quarters + static_cast<std::uint32_t>(quarter)], nodes_[0]);
  nodes_[0].quarters = quarters;
}

}  // namespace cairn::slam
