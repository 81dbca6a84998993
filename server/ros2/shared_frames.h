// The transforms of the topics /tf and /tf_static, which all robots share. Where two live publishers contend for one
// frame (two robots with the same names of frames), nobody knows whose it is: the frame is left out until one of them
// is gone. Not thread-safe: one owner.
#pragma once

#include <deque>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "common/ros2/frame_tree.h"
#include "common/wire/ros2/bus.h"

namespace cairn::server {

class SharedFrames {
 public:
  // Takes those transforms of a message that are clear, and returns them. `fixed`: of tf_static, where two publishers
  // may say the same.
  [[nodiscard]] ros2::Transforms Take(const ros2::Transforms& message, const ros2::WriterId& writer, bool fixed);
  // Forgets what publishers have said who are gone.
  void SetWriters(const std::set<ros2::WriterId>& writers);

  [[nodiscard]] const ros2::FrameTree& tree() const { return tree_; }
  // The frames that two publishers contend for.
  [[nodiscard]] std::vector<std::string> contended() const;
  // There are more frames than the tree can hold.
  [[nodiscard]] bool full() const { return !left_out_.empty(); }

 private:
  struct Owner {
    ros2::WriterId writer{};
    ros2::Transform said;
  };
  // What each of its publishers says of a contended frame.
  using Contenders = std::map<ros2::WriterId, ros2::Transform>;
  static constexpr std::size_t kMaxContenders = 16;

  // As FrameTree::Set. Where there are too many frames, one gives way that nobody publishes any more.
  Result<void> Set(const ros2::Transform& transform);

  std::map<std::string, Owner, std::less<>> owners_;
  std::deque<std::string> left_;           // Frames in the tree whose publisher is gone, the first that left first.
  std::map<std::string, Owner> left_out_;  // There was no room for them. At most ros2::FrameTree::kMaxFrames.
  std::map<std::string, Contenders> contended_;  // At most ros2::FrameTree::kMaxFrames.
  ros2::FrameTree tree_;
};

}  // namespace cairn::server
