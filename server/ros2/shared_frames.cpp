#include "server/ros2/shared_frames.h"

#include <iterator>
#include <utility>

namespace cairn::server {
namespace {

bool SaysTheSame(const ros2::Transform& one, const ros2::Transform& other) {
  const auto motion = ros2::MotionOf(one.T_frame_child);
  const auto other_motion = ros2::MotionOf(other.T_frame_child);
  return one.header.frame == other.header.frame && motion && other_motion && motion->isApprox(*other_motion, 1e-9);
}

}  // namespace

ros2::Transforms SharedFrames::Take(const ros2::Transforms& message, const ros2::WriterId& writer, bool fixed) {
  ros2::Transforms clear;
  for (const ros2::Transform& transform : message.transforms) {
    const std::string& child = transform.child_frame;
    if (const auto known = contended_.find(child); known != contended_.end()) {
      if (known->second.size() < kMaxContenders || known->second.contains(writer))
        known->second.insert_or_assign(writer, transform);
      continue;
    }
    const auto owner = owners_.find(child);
    if (owner != owners_.end() && owner->second.writer != writer &&
        !(fixed && SaysTheSame(owner->second.said, transform))) {
      if (contended_.size() >= ros2::FrameTree::kMaxFrames) continue;
      contended_[child] = {{owner->second.writer, owner->second.said}, {writer, transform}};
      owners_.erase(owner);
      tree_.Forget(child);
      continue;
    }
    if (const auto set = Set(transform); !set) {
      const bool room = left_out_.size() < ros2::FrameTree::kMaxFrames || left_out_.contains(child);
      if (set.error().code == StatusCode::kResourceExhausted && room)
        left_out_.insert_or_assign(child, Owner{writer, transform});
      continue;
    }
    left_out_.erase(child);
    if (owner == owners_.end()) std::erase(left_, child);
    owners_.insert_or_assign(child, Owner{writer, transform});
    clear.transforms.push_back(transform);
  }
  return clear;
}

Result<void> SharedFrames::Set(const ros2::Transform& transform) {
  for (;;) {
    auto set = tree_.Set(transform);
    const bool full = !set && set.error().code == StatusCode::kResourceExhausted;
    if (!full || left_.empty()) return set;
    tree_.Forget(left_.front());
    left_.pop_front();
  }
}

void SharedFrames::SetWriters(const std::set<ros2::WriterId>& writers) {
  // The transforms stay in the tree: a robot whose program is started again is mounted as before.
  for (auto owner = owners_.begin(); owner != owners_.end();) {
    if (writers.contains(owner->second.writer)) {
      ++owner;
      continue;
    }
    left_.push_back(owner->first);
    owner = owners_.erase(owner);
  }
  for (auto frame = contended_.begin(); frame != contended_.end();) {
    Contenders& contenders = frame->second;
    std::erase_if(contenders, [&writers](const auto& one) { return !writers.contains(one.first); });
    if (contenders.size() > 1) {
      ++frame;
      continue;
    }
    if (contenders.size() == 1 && Set(contenders.begin()->second))
      owners_.insert_or_assign(frame->first, Owner{contenders.begin()->first, contenders.begin()->second});
    frame = contended_.erase(frame);
  }
  // A static transform is not said again: what found no room before is tried once more.
  for (auto frame = left_out_.begin(); frame != left_out_.end();) {
    const auto& [child, owner] = *frame;
    const bool taken = writers.contains(owner.writer) && Set(owner.said);
    if (taken) owners_.insert_or_assign(child, owner);
    frame = taken || !writers.contains(owner.writer) ? left_out_.erase(frame) : std::next(frame);
  }
}

std::vector<std::string> SharedFrames::contended() const {
  std::vector<std::string> frames;
  for (const auto& [frame, contenders] : contended_) frames.push_back(frame);
  return frames;
}

}  // namespace cairn::server
