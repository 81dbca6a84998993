#include "server/queries/reply_parts.h"

#include <utility>

namespace cairn::server {
namespace {

// Upper estimates of an item's bytes on the wire.
std::size_t BytesOf(const PoseReport&) {
  return 384;
}
std::size_t BytesOf(const std::shared_ptr<const Tile>& tile) {
  return tile->bytes.size() + 64;
}
std::size_t BytesOf(const LandmarkReport&) {
  return 192;
}
std::size_t BytesOf(const MapInfo& info) {
  std::size_t bytes = 256 + info.memory_note.size();
  for (const MapVersionInfo& version : info.versions) bytes += version.note.size() + 48;
  return bytes;
}
std::size_t BytesOf(const RobotStatus& robot) {
  return 1024 + robot.session.status.message.size() + robot.ledgers.size() * 512 + robot.learned.size() * 176;
}
std::size_t BytesOf(const SavedSite&) {
  return 192;
}
std::size_t BytesOf(const Job& job) {
  return job.message.size() + job.site.size() + job.robot.size() + job.places.size() * 40 + 176;
}

std::size_t BytesOf(const Ros2Namespace& name_space) {
  std::size_t bytes = name_space.name.size() + 256;
  for (const std::string& problem : name_space.problems) bytes += problem.size() + 8;
  for (const Ros2Topic& topic : name_space.topics) bytes += topic.name.size() + topic.type.size() + 64;
  return bytes;
}

std::size_t BytesOf(const MapEdit& edit) {
  return 96 + edit.note.size() + 16 * edit.points_map.size();
}

template <typename Item>
Item Content(Item&& item) {
  return std::forward<Item>(item);
}
Tile Content(std::shared_ptr<const Tile>&& tile) {
  return *tile;
}

}  // namespace

bool PathItems::empty() const {
  return smoothed_ != nullptr ? next_ == smoothed_->size() : block_ == online_.blocks();
}

StampedPose PathItems::Take() {
  if (smoothed_ != nullptr) return (*smoothed_)[next_++];
  const std::vector<PathPose>& block = online_.block(block_);
  const PathPose& pose = block[next_++];
  if (next_ == block.size()) {
    ++block_;
    next_ = 0;
  }
  return {pose.stamp, pose.T_map_robot};
}

// The part under way and the bytes that it holds so far.
class ReplyParts::Part {
 public:
  // Moves items from `items[taken]` on into `list`; false where the part is full before the last one.
  template <typename From, typename To>
  bool Take(std::vector<From>& items, std::size_t& taken, std::vector<To>& list) {
    for (; taken < items.size(); ++taken) {
      const std::size_t bytes = BytesOf(items[taken]);
      if (used_ > 0 && used_ + bytes > kPartBudgetBytes) return false;
      used_ += bytes;
      list.push_back(Content(std::move(items[taken])));
    }
    return true;
  }
  bool Take(PathItems& items, Trajectory& list) {
    constexpr std::size_t kPoseBytes = 32;
    for (; !items.empty(); used_ += kPoseBytes) {
      if (used_ > 0 && used_ + kPoseBytes > kPartBudgetBytes) return false;
      list.push_back(items.Take());
    }
    return true;
  }

 private:
  std::size_t used_ = 0;
};

ReplyParts::ReplyParts(Answer&& answer)
    : tiles_(std::move(answer.tiles)), path_(std::move(answer.path)), header_(std::move(answer.reply)) {
  items_.poses = std::exchange(header_.poses, {});
  items_.landmarks = std::exchange(header_.landmarks, {});
  items_.maps = std::exchange(header_.maps, {});
  items_.robots = std::exchange(header_.robots, {});
  items_.jobs = std::exchange(header_.jobs, {});
  items_.saved = std::exchange(header_.saved, {});
  items_.ros2_namespaces = std::exchange(header_.ros2_namespaces, {});
  items_.edits = std::exchange(header_.edits, {});
}

std::optional<Reply> ReplyParts::Next() {
  if (done_) return std::nullopt;
  Reply part = header_;
  ++header_.part;
  done_ = Fill(part);
  part.last = done_;
  return part;
}

bool ReplyParts::Fill(Reply& part) {
  Part full;
  return full.Take(items_.poses, taken_.poses, part.poses) && full.Take(path_, part.path) &&
         full.Take(tiles_, taken_.tiles, part.tiles) && full.Take(items_.landmarks, taken_.landmarks, part.landmarks) &&
         full.Take(items_.maps, taken_.maps, part.maps) && full.Take(items_.robots, taken_.robots, part.robots) &&
         full.Take(items_.jobs, taken_.jobs, part.jobs) && full.Take(items_.saved, taken_.saved, part.saved) &&
         full.Take(items_.ros2_namespaces, taken_.ros2_namespaces, part.ros2_namespaces) &&
         full.Take(items_.edits, taken_.edits, part.edits);
}

}  // namespace cairn::server
