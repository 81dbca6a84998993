#include "server/slam/localisation/place_hypotheses.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

LineMatchHypothesis At(const Pose2& T_map_robot, double share = 1.0) {
  return {T_map_robot, Eigen::Vector3d(4e-4, 4e-4, 1e-4).asDiagonal(), share, 4};
}

LineMatchAnswer Answer(std::vector<LineMatchHypothesis> hypotheses, bool complete = true) {
  return {std::move(hypotheses), complete};
}

const Eigen::Matrix3d kStepNoise = Eigen::Vector3d(1e-4, 1e-4, 1e-5).asDiagonal();

TEST(PlaceHypotheses, OnePlaceSeenAgainAndAgainIsIt) {
  PlaceHypotheses places({});
  Pose2 truth{3, -2, 1.0};
  const Pose2 step{0.5, 0, 0.1};
  int searches = 0;
  for (; !places.settled() && searches < 20; ++searches) {
    places.Predict(step, kStepNoise);
    truth = truth * step;
    places.Update(Answer({At(truth)}));
  }
  ASSERT_TRUE(places.settled());
  EXPECT_GT(searches, 2);
  EXPECT_LT((places.settled()->T_map_robot.translation() - truth.translation()).norm(), 0.01);
  EXPECT_LT(places.settled()->covariance.trace(), 1e-3);
}

TEST(PlaceHypotheses, TwinsAreNotSettledUntilTheWayTellsThemApart) {
  PlaceHypotheses places({});
  Pose2 truth{0, 0, 0}, twin{10, 5, kPi};
  const Pose2 step{0.5, 0, 0};
  const auto move = [&](std::vector<LineMatchHypothesis> answer) {
    places.Predict(step, kStepNoise);
    places.Update(Answer(std::move(answer)));
  };
  for (int search = 0; search < 20; ++search) {
    truth = truth * step;
    twin = twin * step;
    move({At(twin), At(truth)});
    EXPECT_FALSE(places.settled());
  }
  for (int search = 0; search < 8; ++search) {
    truth = truth * step;
    // Besides the truth, each search also finds another place, which changes.
    move({At(truth), At({-3.0 * search, 7.0, 0.3})});
  }
  ASSERT_TRUE(places.settled());
  EXPECT_LT((places.settled()->T_map_robot.translation() - truth.translation()).norm(), 0.01);
}

TEST(PlaceHypotheses, ASearchCutShortSaysNothing) {
  PlaceHypotheses places({});
  for (int search = 0; search < 20; ++search) places.Update(Answer({At({1, 2, 3})}, false));
  EXPECT_FALSE(places.settled());
  EXPECT_EQ(places.size(), 0U);
}

TEST(PlaceHypotheses, AreBoundedAndForgotten) {
  PlaceHypotheses places({.most = 5});
  for (int search = 0; search < 30; ++search) {
    std::vector<LineMatchHypothesis> answer;
    for (int k = 0; k < 40; ++k) answer.push_back(At({10.0 * search, 3.0 * k, 0}, 0.1 + 0.02 * k));
    places.Update(Answer(std::move(answer)));
    EXPECT_LE(places.size(), 5U);
    EXPECT_FALSE(places.settled());
  }
  places.Clear();
  EXPECT_EQ(places.size(), 0U);
}

}  // namespace
}  // namespace cairn::slam
