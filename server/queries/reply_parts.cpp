#include "server/queries/reply_parts.h"

#include <utility>

namespace cairn::server {
namespace {

// Upper estimates of an item's bytes on the wire.
std::size_t BytesOf(const PoseReport&) {
  return 384;
}
std::size_t BytesOf(const StampedPose&) {
  return 32;
}
std::size_t BytesOf(const Tile& tile) {
  return tile.bytes.size() + 64;
}
std::size_t BytesOf(const LandmarkReport&) {
  return 192;
}
std::size_t BytesOf(const MapInfo& info) {
  std::size_t bytes = 256;
  for (const MapVersionInfo& version : info.versions) bytes += version.note.size() + 48;
  return bytes;
}
std::size_t BytesOf(const RobotStatus& robot) {
  return 1024 + robot.session.status.message.size() + robot.ledgers.size() * 512;
}
std::size_t BytesOf(const Job& job) {
  return job.message.size() + job.site.size() + 160;
}

class Parts {
 public:
  explicit Parts(Reply header) : header_(std::move(header)), current_(header_) {}

  template <typename Item>
  void AddAll(std::vector<Item>&& items, std::vector<Item> Reply::*list) {
    for (Item& item : items) {
      const std::size_t bytes = BytesOf(item);
      if (used_ > 0 && used_ + bytes > kPartBudgetBytes) Next();
      used_ += bytes;
      (current_.*list).push_back(std::move(item));
    }
  }

  std::vector<Reply> Finish() {
    Next();
    parts_.back().last = true;
    return std::move(parts_);
  }

 private:
  void Next() {
    current_.part = static_cast<std::uint32_t>(parts_.size());
    current_.last = false;
    parts_.push_back(std::move(current_));
    current_ = header_;
    used_ = 0;
  }

  const Reply header_;
  Reply current_;
  std::size_t used_ = 0;
  std::vector<Reply> parts_;
};

}  // namespace

std::vector<Reply> SplitReply(Reply&& reply) {
  auto poses = std::exchange(reply.poses, {});
  auto path = std::exchange(reply.path, {});
  auto tiles = std::exchange(reply.tiles, {});
  auto landmarks = std::exchange(reply.landmarks, {});
  auto maps = std::exchange(reply.maps, {});
  auto robots = std::exchange(reply.robots, {});
  auto jobs = std::exchange(reply.jobs, {});
  Parts parts(std::move(reply));
  parts.AddAll(std::move(poses), &Reply::poses);
  parts.AddAll(std::move(path), &Reply::path);
  parts.AddAll(std::move(tiles), &Reply::tiles);
  parts.AddAll(std::move(landmarks), &Reply::landmarks);
  parts.AddAll(std::move(maps), &Reply::maps);
  parts.AddAll(std::move(robots), &Reply::robots);
  parts.AddAll(std::move(jobs), &Reply::jobs);
  return parts.Finish();
}

}  // namespace cairn::server
