#include "client/lib/pose_client.h"

#include <chrono>
#include <utility>

namespace cairn::client {

Result<std::unique_ptr<PoseClient>> PoseClient::Create(wire::Bus& bus, const std::string& robot) {
  std::unique_ptr<PoseClient> client(new PoseClient(robot));
  auto poses = bus.Subscribe<PoseReport>([self = client.get()](PoseReport&& pose) { self->OnPose(std::move(pose)); });
  if (!poses) return tl::unexpected(poses.error());
  client->poses_ = std::move(*poses);
  return client;
}

void PoseClient::OnPose(PoseReport&& pose) {
  if (pose.robot_id != robot_id_ || pose.generation < generation_) return;
  generation_ = pose.generation;
  // A refused value is not moved from (BoundedChannel::TryPush).
  while (!waiting_.TryPush(std::move(pose))) {  // NOLINT(bugprone-use-after-move)
    if (waiting_.TryPop()) ++dropped_;
  }
}

std::optional<PoseReport> PoseClient::Next(double timeout_s) {
  return waiting_.PopFor(
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(timeout_s)));
}

}  // namespace cairn::client
