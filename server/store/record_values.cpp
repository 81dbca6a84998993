#include "server/store/record_values.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "common/map/tile.h"

namespace cairn::server {
namespace {

constexpr int kFarthestChunk = 1 << 22;  // No estimator draws farther from the origin.
constexpr double kFarthestM = 1e7;       // No robot drives farther from it.
constexpr std::size_t kChunkBytes = sizeof(std::int16_t) * static_cast<std::size_t>(kTileArea);
static_assert(std::endian::native == std::endian::little, "cells are stored as they lie in memory");

using Doubles = google::protobuf::RepeatedField<double>;

void AddPoses(const std::vector<Pose2>& poses, Doubles& to) {
  for (const Pose2& pose : poses)
    for (const double number : {pose.x, pose.y, pose.theta}) to.Add(number);
}

// Null: they are no poses.
std::shared_ptr<const std::vector<Pose2>> PosesOf(const Doubles& numbers) {
  std::vector<Pose2> poses;
  for (int i = 0; i + 2 < numbers.size(); i += 3) {
    const Pose2& pose = poses.emplace_back(Pose2{numbers[i], numbers[i + 1], WrapAngle(numbers[i + 2])});
    if (!pose.IsFinite() || pose.translation().cwiseAbs().maxCoeff() > kFarthestM) return nullptr;
  }
  return std::make_shared<const std::vector<Pose2>>(std::move(poses));
}

}  // namespace

void Fill(record::Pose& to, const Pose2& from) {
  to.set_x(from.x);
  to.set_y(from.y);
  to.set_theta(from.theta);
}

void Fill(record::Stream& to, const StreamId& from) {
  to.set_robot_id(from.robot_id);
  to.set_sensor_id(from.sensor_id);
  to.set_session(from.session);
}

void Fill(record::Status& to, const Status& from) {
  to.set_code(static_cast<int>(from.code));
  to.set_message(from.message);
}

void Fill(record::SessionRequest& to, const SessionRequest& from) {
  to.set_robot(from.robot);
  to.set_site(from.site);
  for (const std::string& sensor : from.sensors) to.add_sensors(sensor);
  to.set_client(from.client);
  to.set_has_start(from.has_start);
  Fill(*to.mutable_t_map_robot_start(), from.T_map_robot_start);
  to.set_session(from.session);
}

void Fill(record::Grid& to, const StoredGrid& from) {
  to.set_keyframes(from.keyframes);
  to.set_fragment(from.fragment);
  for (const StoredChunk& chunk : from.chunks) {
    record::GridChunk& added = *to.add_chunks();
    added.set_x(chunk.x);
    added.set_y(chunk.y);
    added.set_log_odds(chunk.cells.get(), kChunkBytes);
  }
  if (from.path == nullptr) return;
  const bool all = from.numbers == nullptr || from.keyframes == from.numbers->size();
  if (!all) to.mutable_numbers()->Add(from.numbers->begin(), from.numbers->end());
  auto& numbers = all ? *to.mutable_path() : *to.mutable_kept_path();
  AddPoses(*from.path, numbers);
  if (from.drawn != nullptr) AddPoses(*from.drawn, *to.mutable_drawn());
}

Pose2 ValueOf(const record::Pose& from) {
  return {from.x(), from.y(), from.theta()};
}

StreamId ValueOf(const record::Stream& from) {
  return {.robot_id = from.robot_id(), .sensor_id = from.sensor_id(), .session = from.session()};
}

Status ValueOf(const record::Status& from) {
  return {static_cast<StatusCode>(from.code()), from.message()};
}

SessionRequest ValueOf(const record::SessionRequest& from) {
  SessionRequest request;
  request.robot = from.robot();
  request.site = from.site();
  request.sensors.assign(from.sensors().begin(), from.sensors().end());
  request.client = from.client();
  request.has_start = from.has_start();
  request.T_map_robot_start = ValueOf(from.t_map_robot_start());
  request.session = from.session();
  return request;
}

Result<StoredGrid> ValueOf(const record::Grid& from) {
  StoredGrid grid;
  grid.keyframes = from.keyframes();
  grid.fragment = from.fragment();
  for (const record::GridChunk& chunk : from.chunks()) {
    const auto is_near = [](int place) { return -kFarthestChunk <= place && place <= kFarthestChunk; };
    if (chunk.log_odds().size() != kChunkBytes || !is_near(chunk.x()) || !is_near(chunk.y()))
      return Unreadable("a part of a grid");
    auto cells = std::make_shared<std::vector<std::int16_t>>(static_cast<std::size_t>(kTileArea));
    std::memcpy(cells->data(), chunk.log_odds().data(), kChunkBytes);
    const std::int16_t* const first = cells->data();
    grid.chunks.push_back({chunk.x(), chunk.y(), std::shared_ptr<const std::int16_t>(std::move(cells), first)});
  }
  const bool all = from.numbers().empty();
  const auto& numbers = all ? from.path() : from.kept_path();
  if (numbers.empty() && all) return grid;
  const std::uint64_t poses = all ? grid.keyframes : static_cast<std::uint64_t>(from.numbers_size());
  if (static_cast<std::uint64_t>(numbers.size()) != 3 * poses) return Unreadable("the path of a grid");
  if (!all) {
    auto kept = std::make_shared<std::vector<std::uint64_t>>(from.numbers().begin(), from.numbers().end());
    if (std::ranges::adjacent_find(*kept, std::greater_equal<>()) != kept->end() || kept->back() >= grid.keyframes)
      return Unreadable("the keyframes of a grid");
    grid.numbers = std::move(kept);
  }
  grid.path = PosesOf(numbers);
  if (grid.path == nullptr) return Unreadable("the path of a grid");
  if (from.drawn().empty()) return grid;
  grid.drawn = from.drawn_size() == numbers.size() ? PosesOf(from.drawn()) : nullptr;
  if (grid.drawn == nullptr) return Unreadable("the poses of a grid");
  return grid;
}

}  // namespace cairn::server
