#include "common/ros2/frame_tree.h"

#include <algorithm>
#include <cmath>

namespace cairn::ros2 {
namespace {

constexpr std::size_t kMaxDepth = 32;  // A longer chain is a circle, or nobody's robot.

const FrameTree::Link* FindLink(std::span<const FrameTree* const> trees, std::string_view child) {
  for (const FrameTree* tree : trees)
    if (const FrameTree::Link* link = tree->Find(child)) return link;
  return nullptr;
}

struct Ancestor {
  std::string name;
  Eigen::Isometry3d T_ancestor_frame;
};

// The frame itself first, then its parents.
std::vector<Ancestor> AncestorsOf(std::span<const FrameTree* const> trees, std::string_view frame,
                                  std::span<const std::string> outside) {
  std::vector<Ancestor> ancestors{{std::string(frame), Eigen::Isometry3d::Identity()}};
  while (ancestors.size() < kMaxDepth) {
    const FrameTree::Link* link = FindLink(trees, ancestors.back().name);
    if (link == nullptr || std::find(outside.begin(), outside.end(), link->parent) != outside.end()) break;
    ancestors.push_back({link->parent, link->T_parent_child * ancestors.back().T_ancestor_frame});
  }
  return ancestors;
}

}  // namespace

Result<Eigen::Isometry3d> MotionOf(const Pose3& pose) {
  constexpr double kMaxLengthError = 0.1;
  constexpr double kFarthest_m = 1e7;
  if (!pose.translation.allFinite() || pose.translation.cwiseAbs().maxCoeff() > kFarthest_m)
    return Fail(StatusCode::kInvalidArgument, "a position is not finite or more than 10,000 km away");
  const double length = pose.rotation.norm();
  if (!(std::abs(length - 1.0) <= kMaxLengthError))
    return Fail(StatusCode::kInvalidArgument, "an orientation is no quaternion of length 1");
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = pose.rotation.normalized().toRotationMatrix();
  motion.translation() = pose.translation;
  return motion;
}

Pose2 PlanarPart(const Eigen::Isometry3d& motion) {
  const Eigen::Matrix3d turn = motion.linear();
  return {motion.translation().x(), motion.translation().y(), std::atan2(turn(1, 0), turn(0, 0))};
}

Result<void> FrameTree::Set(const Transform& transform) {
  const std::string& parent = transform.header.frame;
  if (parent.empty() || transform.child_frame.empty() || parent == transform.child_frame)
    return Fail(StatusCode::kInvalidArgument, "a transform needs two frames");
  const auto motion = MotionOf(transform.T_frame_child);
  if (!motion) return tl::unexpected(motion.error());
  const auto known = links_.find(transform.child_frame);
  if (known == links_.end()) {
    if (links_.size() >= kMaxFrames) return Fail(StatusCode::kResourceExhausted, "more than 1024 frames");
    links_.emplace(transform.child_frame, Link{parent, *motion});
    ++version_;
  } else if (known->second.parent != parent || !known->second.T_parent_child.isApprox(*motion, 1e-12)) {
    known->second = {parent, *motion};
    ++version_;
  }
  return {};
}

void FrameTree::Forget(std::string_view child) {
  const auto found = links_.find(child);
  if (found == links_.end()) return;
  links_.erase(found);
  ++version_;
}

const FrameTree::Link* FrameTree::Find(std::string_view child) const {
  const auto found = links_.find(child);
  return found == links_.end() ? nullptr : &found->second;
}

std::optional<Eigen::Isometry3d> FindMotion(std::span<const FrameTree* const> trees, std::string_view to,
                                            std::string_view from, std::span<const std::string> outside) {
  const std::vector<Ancestor> of_to = AncestorsOf(trees, to, outside);
  for (const Ancestor& one : AncestorsOf(trees, from, outside)) {
    for (const Ancestor& other : of_to) {
      if (one.name != other.name) continue;
      return Eigen::Isometry3d(other.T_ancestor_frame.inverse() * one.T_ancestor_frame);
    }
  }
  return std::nullopt;
}

}  // namespace cairn::ros2
