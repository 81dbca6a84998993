#include "client/lib/pose_client.h"

#include <chrono>
#include <utility>

namespace cairn::client {

PoseClient::PoseClient(wire::Bus& bus, const std::string& robot)
    : bus_(bus),
      robot_(robot),
      robot_id_(HashName(robot)),
      watch_(
          bus, [this](QueryClient& queries) { return Behind(queries); }, [this] { Renew(); }) {}

PoseClient::~PoseClient() {
  watch_.Stop();  // It would change the wire.
}

Result<std::unique_ptr<PoseClient>> PoseClient::Create(wire::Bus& bus, const std::string& robot) {
  std::unique_ptr<PoseClient> client(new PoseClient(bus, robot));
  auto wire = client->Connect(bus, 0);
  if (!wire) return tl::unexpected(wire.error());
  const MutexLock lock(client->mutex_);
  client->wire_ = std::move(*wire);
  return client;
}

Result<std::unique_ptr<PoseClient::Wire>> PoseClient::Connect(wire::Bus& bus, int number) {
  auto poses =
      bus.SubscribeRobot<PoseReport>(robot_id_, [this, number](PoseReport&& pose) { OnPose(number, std::move(pose)); });
  if (!poses) return tl::unexpected(poses.error());
  auto wire = std::make_unique<Wire>();
  wire->poses = std::move(*poses);
  return wire;
}

void PoseClient::OnPose(int number, PoseReport&& pose) {
  if (pose.robot_id != robot_id_) return;
  {
    const MutexLock lock(mutex_);
    if (number != number_ || pose.generation < arrived_.generation) return;
    arrived_ = {pose.generation, pose.stamp};
  }
  watch_.Arrived();
  // A refused value is not moved from (BoundedChannel::TryPush).
  while (!waiting_.TryPush(std::move(pose))) {  // NOLINT(bugprone-use-after-move)
    if (waiting_.TryPop()) ++dropped_;
  }
}

// Whether the server has another pose than the last one that arrived, and another one than at the last question. (What
// it had when this client joined was published before.)
bool PoseClient::Behind(QueryClient& queries) {
  const auto asked = queries.Pose(robot_);
  if (!asked) return false;
  const Newest answer{asked->generation, asked->stamp};
  const bool is_new = answer != std::exchange(answered_, answer);
  const MutexLock lock(mutex_);
  return is_new && answer != arrived_;
}

// What was received before may have been forged: a generation that is too high would hide all that follow.
void PoseClient::Renew() {
  auto bus = wire::Bus::Create(bus_.options(), "poses");
  if (!bus) return;
  int number = 0;
  {
    const MutexLock lock(mutex_);
    number = ++number_;
    arrived_ = {};
  }
  auto wire = Connect(**bus, number);
  if (!wire) return;
  (*wire)->own = std::move(*bus);
  std::unique_ptr<Wire> before;  // Its callback takes the mutex: it goes when the lock is released.
  {
    const MutexLock lock(mutex_);
    before = std::exchange(wire_, std::move(*wire));
  }
}

std::optional<PoseReport> PoseClient::Next(double timeout_s) {
  return waiting_.PopFor(
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(timeout_s)));
}

int PoseClient::renewed() const {
  const MutexLock lock(mutex_);
  return number_;
}

}  // namespace cairn::client
