#include "client/lib/pose_client.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/client/lib/fake_server.h"
#include "tests/loopback.h"

namespace cairn::client {
namespace {

using namespace test;

class PoseClientTest : public ::testing::Test {
 protected:
  // Publishes a pose of the robot, as the server does, as soon as somebody listens.
  void Publish(const std::string& robot, std::uint64_t scan) {
    PoseReport pose;
    pose.robot = robot;
    pose.robot_id = HashName(robot);
    pose.scan_sequence = scan;
    Must(poses_->Publish(pose));
  }

  const std::unique_ptr<wire::Bus> server_ = MakeBus("server");
  const std::unique_ptr<wire::Bus> bus_ = MakeBus("client");
  const std::unique_ptr<wire::Publication<PoseReport>> poses_ = Must(server_->Advertise<PoseReport>());
  const std::unique_ptr<PoseClient> client_ = Must(PoseClient::Create(*bus_, "r1"));
};

TEST_F(PoseClientTest, HearsThePosesOfItsRobotInOrder) {
  // Poses that are published before the two have found each other are lost.
  std::optional<PoseReport> first;
  std::uint64_t scan = 0;
  while (!first && scan < 1000) {
    Publish("r2", 5000);
    Publish("r1", ++scan);
    first = client_->Next(0.02);
  }
  ASSERT_TRUE(first);
  Publish("r2", 5000);
  const std::uint64_t last = ++scan;
  Publish("r1", last);
  std::uint64_t before = first->scan_sequence;
  while (before < last) {
    const auto pose = client_->Next(20.0);
    ASSERT_TRUE(pose);
    EXPECT_EQ(pose->robot, "r1");
    EXPECT_GT(pose->scan_sequence, before);
    before = pose->scan_sequence;
  }
  EXPECT_EQ(before, last);
  EXPECT_FALSE(client_->Next(0.0));
  EXPECT_EQ(client_->dropped(), 0U);
}

// Poses of an earlier generation of the server are ignored, so a forged later one would hide all others for ever.
TEST(PoseClientOfAServer, JoinsAnewWhereOnlyTheServerHasNewPoses) {
  FakeServer server(LoopbackOptions());
  const auto bus = MakeBus("client"), forger = MakeBus("forger");
  const auto client = Must(PoseClient::Create(*bus, "r1"));
  const auto forged = Must(forger->Advertise<PoseReport>());
  PoseReport pose;
  pose.robot = "r1";
  pose.robot_id = HashName(pose.robot);
  pose.generation = 9;
  EXPECT_TRUE(Eventually([&] {
    Must(forged->Publish(pose));
    const auto arrived = client->Next(0.05);
    return arrived && arrived->generation == 9;
  }));
  pose.generation = 1;
  EXPECT_TRUE(Eventually([&] {
    ++pose.stamp;
    server.Publish(pose);
    const auto arrived = client->Next(0.05);
    return arrived && arrived->generation == 1;
  }));
  EXPECT_GE(client->renewed(), 1);
}

TEST(PoseClientOfAServer, StaysWhereTheRobotHasNoNewPoses) {
  FakeServer server(LoopbackOptions());
  PoseReport pose;
  pose.robot = "r1";
  pose.robot_id = HashName(pose.robot);
  pose.stamp = 77;
  server.Publish(pose);
  const auto bus = MakeBus("client");
  const auto client = Must(PoseClient::Create(*bus, "r1"));
  EXPECT_TRUE(Eventually([&] { return std::ranges::count(server.asked(), RequestKind::kPose) >= 4; }));
  EXPECT_EQ(client->renewed(), 0);
}

TEST_F(PoseClientTest, ASlowReaderLosesTheOldestPoses) {
  ASSERT_TRUE(Eventually([&] { return poses_->matched() > 0; }));
  std::uint64_t published = 0;
  // With pauses, because DDS itself drops poses of one robot that come faster than they are taken.
  EXPECT_TRUE(Eventually([&] {
    for (int i = 0; i < 16; ++i) Publish("r1", ++published);
    return client_->dropped() > 0;
  }));
  EXPECT_GT(published, PoseClient::kMaxWaiting);
  const auto pose = client_->Next(0.0);
  ASSERT_TRUE(pose);
  EXPECT_GT(pose->scan_sequence, 1U);
}

}  // namespace
}  // namespace cairn::client
