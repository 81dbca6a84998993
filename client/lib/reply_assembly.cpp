#include "client/lib/reply_assembly.h"

#include <iterator>
#include <utility>

namespace cairn::client {
namespace {

template <typename T>
void Append(std::vector<T>& all, std::vector<T>&& more) {
  all.insert(all.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
}

}  // namespace

void ReplyAssembly::Add(Reply&& part) {
  if (part.generation < generation_) return;
  if (part.generation > generation_) {
    generation_ = part.generation;
    parts_.clear();
    last_seen_ = false;
  }
  if (part.part >= kMaxParts || (last_seen_ && part.part > last_part_)) return;
  if (part.last) {
    last_seen_ = true;
    last_part_ = part.part;
  }
  parts_.try_emplace(part.part, std::move(part));
}

Reply ReplyAssembly::Take() {
  Reply whole;
  for (auto& [number, part] : parts_) {
    Append(whole.poses, std::move(part.poses));
    Append(whole.path, std::move(part.path));
    Append(whole.tiles, std::move(part.tiles));
    Append(whole.landmarks, std::move(part.landmarks));
    Append(whole.maps, std::move(part.maps));
    Append(whole.robots, std::move(part.robots));
    Append(whole.jobs, std::move(part.jobs));
    Append(whole.saved, std::move(part.saved));
    Append(whole.ros2_namespaces, std::move(part.ros2_namespaces));
    Append(whole.edits, std::move(part.edits));
    if (whole.hypotheses.empty()) whole.hypotheses = std::move(part.hypotheses);
    if (whole.ros2.empty()) whole.ros2 = std::move(part.ros2);
    if (whole.refused.empty()) whole.refused = std::move(part.refused);
    if (whole.load.empty()) whole.load = std::move(part.load);
  }
  Reply& last = parts_.at(last_part_);
  whole.client = last.client;
  whole.sequence = last.sequence;
  whole.status = std::move(last.status);
  whole.generation = last.generation;
  whole.map_epoch = last.map_epoch;
  whole.map_version = last.map_version;
  whole.server_version = std::move(last.server_version);
  return whole;
}

}  // namespace cairn::client
