#include "server/ops/heartbeat.h"

#include <gmock/gmock.h>

namespace cairn::server {
namespace {

using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;

class HeartbeatTest : public testing::Test {
 protected:
  std::vector<std::string> At(int second, const std::map<std::string, Pulse>& pulses) {
    return heartbeat_.Check(pulses, Heartbeat::Clock::time_point{} + seconds(second));
  }
  Heartbeat heartbeat_{seconds(5)};
};

TEST_F(HeartbeatTest, NamesWhatHasWorkAndFinishesNothing) {
  EXPECT_THAT(At(0, {{"quick", {0, true}}, {"stuck", {7, true}}}), IsEmpty());
  EXPECT_THAT(At(5, {{"quick", {1, true}}, {"stuck", {7, true}}}), IsEmpty());
  EXPECT_THAT(At(6, {{"quick", {2, true}}, {"stuck", {7, true}}}), ElementsAre("stuck"));
  EXPECT_THAT(At(7, {{"quick", {3, true}}, {"stuck", {8, true}}}), IsEmpty());
}

// The server was killed under load once: sixty-four scans waited in front of the sign of life that was asked for.
TEST_F(HeartbeatTest, WhatFinishesSomethingIsHealthyHoweverMuchWaits) {
  for (int second = 0; second < 100; second += 4)
    EXPECT_THAT(At(second, {{"slow", {static_cast<std::uint64_t>(second), true}}}), IsEmpty());
}

TEST_F(HeartbeatTest, WhatHasNothingToDoIsHealthy) {
  EXPECT_THAT(At(0, {{"idle", {3, false}}}), IsEmpty());
  EXPECT_THAT(At(100, {{"idle", {3, false}}}), IsEmpty());
  EXPECT_THAT(At(101, {{"idle", {3, true}}}), IsEmpty());  // Its first work has only just come.
  EXPECT_THAT(At(105, {{"idle", {3, true}}}), IsEmpty());
  EXPECT_THAT(At(107, {{"idle", {3, true}}}), ElementsAre("idle"));
}

TEST_F(HeartbeatTest, ANameThatComesBackStartsAnew) {
  EXPECT_THAT(At(0, {{"robot", {0, true}}}), IsEmpty());
  EXPECT_THAT(At(4, {}), IsEmpty());
  EXPECT_THAT(At(8, {{"robot", {0, true}}}), IsEmpty());
  EXPECT_THAT(At(12, {{"robot", {0, true}}}), IsEmpty());
  EXPECT_THAT(At(14, {{"robot", {0, true}}}), ElementsAre("robot"));
}

}  // namespace
}  // namespace cairn::server
