// What a session answers about where its robot may be while its place is not known.
#include <gtest/gtest.h>

#include <optional>
#include <utility>
#include <vector>

#include "server/robots/session_estimator.h"
#include "tests/server/robots/one_session.h"

namespace cairn::server {
namespace {

using testing::kOwner;
using testing::kScans;
using testing::RequestOf;
using testing::RoomOdometry;
using testing::RoomScan;

class LostPlacesTest : public ::testing::Test {
 protected:
  LostPlacesTest() { EXPECT_TRUE(record_.AddSensors({"laser"})); }

  static EstimatorSetup LostSetup() {
    EstimatorSetup setup;
    setup.mapper.filter.particles = 20;
    return setup;
  }
  void Drive(int first, int last) {
    for (int step = first; step < last; ++step) {
      EXPECT_TRUE(record_.OdometryReceived(kOwner, RoomOdometry(step).sequence));
      estimator_.Handle(testing::OdometryOf("r1", RoomOdometry(step)));
      record_.ScanReceived(kScans, RoomScan(step).sequence);
      estimator_.Handle(testing::ScanOf("r1", RoomScan(step)));
    }
  }
  [[nodiscard]] std::vector<PoseHypothesis> Places() const { return record_.snapshot().hypotheses; }

  SessionRecord record_{4, RequestOf("r1"), RobotsOptions{}};
  SessionEstimator estimator_{
      LostSetup(), record_, {.send = [](const OutboundValue&) { return true; }, .grid_changed = [](GridChange&&) {}}};
};

// Half a second has not passed since it was summed up last.
TEST_F(LostPlacesTest, WhatWasBelievedOfARobotIsGoneWithTheFirstScanThatItIsLost) {
  Drive(0, 22);
  ASSERT_FALSE(Places().empty());
  ASSERT_LT(RoomScan(22).stamp - Places().front().stamp, 5 * testing::kScanPeriod);
  estimator_.Handle(RelocaliseWanted{});
  Drive(22, 23);
  EXPECT_FALSE(record_.snapshot().status.pose.localized);
  for (const PoseHypothesis& place : Places())
    EXPECT_EQ(place.stamp, RoomScan(22).stamp) << "its own search has found it";
}

TEST_F(LostPlacesTest, WhatAJobHasFoundIsGoneWithTheMapInWhichItWasFound) {
  Drive(0, 20);
  estimator_.Handle(RelocaliseWanted{});
  Drive(20, 21);
  std::optional<bool> taken;
  estimator_.Handle(PlaceFound{.place = std::nullopt,
                               .places = {{1, {3.0, 0.0, 0.0}, 0.6}, {1, {9.0, 0.0, 0.0}, 0.4}},
                               .done = [&taken](bool confirms) { taken = confirms; }});
  EXPECT_EQ(taken, false);
  EXPECT_EQ(Places().size(), 2U);
  estimator_.Handle(EpochChange{record_.epoch() + 1});
  EXPECT_TRUE(Places().empty());
}

}  // namespace
}  // namespace cairn::server
