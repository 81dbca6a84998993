// Participants that find each other through a discovery server of Fast DDS (Debian's fastdds-tools), without multicast.
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <optional>

#include "tests/child_process.h"
#include "tests/free_port.h"
#include "tests/loopback.h"

namespace cairn::wire {
namespace {

using namespace test;

constexpr const char* kProgram = "/usr/bin/fast-discovery-server";

PoseReport Of(const std::string& robot) {
  PoseReport pose;
  pose.robot = robot;
  pose.robot_id = HashName(robot);
  return pose;
}

TEST(DiscoveryServer, ParticipantsFindEachOtherThroughItAndOnlyThroughIt) {
  if (!std::filesystem::exists(kProgram))
    GTEST_SKIP() << "SKIPPED: " << kProgram << " is not installed (package fastdds-tools)";
  const std::string port = std::to_string(FreePort());
  const auto start = [&] {
    return std::make_unique<ChildProcess>(std::vector<std::string>{kProgram, "-i", "0", "-l", "127.0.0.1", "-p", port});
  };
  WireOptions options = LoopbackOptions();
  options.discovery_servers = {"127.0.0.1:" + port};
  const auto server = MakeBus("server", options);
  const auto viewer = MakeBus("viewer", options);
  const auto poses = Must(server->Advertise<PoseReport>());
  Inbox<PoseReport> inbox;
  const auto subscription = Must(viewer->Subscribe<PoseReport>(inbox.Sink(), {}));
  EXPECT_FALSE(Eventually([&] { return poses->matched() > 0; }, std::chrono::seconds(1)));

  auto meeting_place = start();
  ASSERT_TRUE(Eventually([&] { return poses->matched() == 1 && subscription->matched() == 1; }));
  ASSERT_TRUE(poses->Publish(Of("r1")));
  ASSERT_TRUE(inbox.WaitFor(1));

  // Those who have met do not need it any more.
  meeting_place.reset();
  ASSERT_TRUE(poses->Publish(Of("r2")));
  ASSERT_TRUE(inbox.WaitFor(2));

  // One that joins later finds them as soon as it is back.
  meeting_place = start();
  const auto late = MakeBus("late", options);
  Inbox<PoseReport> late_inbox;
  const auto late_subscription = Must(late->Subscribe<PoseReport>(late_inbox.Sink(), {}));
  ASSERT_TRUE(Eventually([&] { return poses->matched() == 2 && late_subscription->matched() == 1; }));
  ASSERT_TRUE(poses->Publish(Of("r3")));
  ASSERT_TRUE(late_inbox.WaitFor(1));
  EXPECT_EQ(server->datagrams_refused() + viewer->datagrams_refused() + late->datagrams_refused(), 0U);
}

}  // namespace
}  // namespace cairn::wire
