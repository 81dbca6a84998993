#include "server/robots/most_believed.h"

#include <gtest/gtest.h>

#include <vector>

namespace cairn::server {
namespace {

TEST(MostBelieved, PosesThatAreNearBecomeOnePlaceAtTheHeaviest) {
  const std::vector<slam::WeightedPose> belief = {
      {{5.0, 0.0, 0.0}, 0.2}, {{1.0, 0.0, 3.1}, 0.1}, {{1.1, 0.0, -3.12}, 0.4}, {{1.0, 0.0, 0.0}, 0.3}};
  const auto places = MostBelieved(belief, 7);
  ASSERT_EQ(places.size(), 3U);
  EXPECT_EQ(places[0].T_map_robot.x, 1.1);
  EXPECT_DOUBLE_EQ(places[0].weight, 0.5) << "headings on both sides of pi are near";
  EXPECT_DOUBLE_EQ(places[1].weight, 0.3) << "the same place, seen the other way";
  EXPECT_DOUBLE_EQ(places[2].weight, 0.2);
  EXPECT_EQ(places[2].stamp, 7);
}

TEST(MostBelieved, ManyLightPosesAreMoreThanOneHeavyOne) {
  std::vector<slam::WeightedPose> belief(1, {{9.0, 0.0, 0.0}, 0.3});
  for (int i = 0; i < 7; ++i) belief.push_back({{0.01 * i, 0.0, 0.0}, 0.1});
  EXPECT_NEAR(MostBelieved(belief, 0).front().weight, 0.7, 1e-12);
}

TEST(MostBelieved, OnlyTheFirstPlacesAreTold) {
  std::vector<slam::WeightedPose> belief;
  for (int i = 0; i < 100; ++i) belief.push_back({{static_cast<double>(i), 0.0, 0.0}, 0.01});
  const auto places = MostBelieved(belief, 0);
  ASSERT_EQ(places.size(), kMostHypotheses);
  EXPECT_EQ(places[0].T_map_robot.x, 0.0) << "equal ones stay in their order";
  EXPECT_TRUE(MostBelieved({}, 0).empty());
}

}  // namespace
}  // namespace cairn::server
