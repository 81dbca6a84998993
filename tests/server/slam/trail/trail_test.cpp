#include "server/slam/trail/trail.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

constexpr MotionNoise kDrift{0.01, 0.0, 0.0, 0.01, 0.0, 0.0};

// Keyframes on a straight line, 2 m apart.
Trail Chain(std::size_t keyframes) {
  Trail trail(kDrift);
  for (std::size_t k = 0; k < keyframes; ++k)
    trail.Append({std::make_shared<const Scan>(), {}}, {2.0 * static_cast<double>(k), 0.0, 0.0}, {},
                 Eigen::Matrix3d::Zero(), std::nullopt);
  return trail;
}

TEST(Trail, DistancesFollowTheChain) {
  const Trail trail = Chain(5);
  const std::span<const double> distances = trail.distances_m();
  EXPECT_EQ(std::vector<double>(distances.begin(), distances.end()), (std::vector<double>{8, 6, 4, 2, 0}));
  EXPECT_TRUE(trail.relations().empty());  // Nothing was seen again.
}

TEST(Trail, ALoopIsAShortCutBothWays) {
  Trail trail = Chain(11);
  trail.AddLoop({1, 9, {0.5, 0.0, 0.0}, Eigen::Matrix3d::Identity(), true});
  const std::span<const double> distance = trail.distances_m();
  EXPECT_DOUBLE_EQ(distance[9], 2.0);
  EXPECT_DOUBLE_EQ(distance[1], 2.5);
  EXPECT_DOUBLE_EQ(distance[0], 4.5);
  EXPECT_DOUBLE_EQ(distance[2], 4.5);
  EXPECT_DOUBLE_EQ(distance[5], 10.0);  // The farthest keyframe: both ways round have the same length.
  EXPECT_EQ(trail.relations().size(), 11U);
}

TEST(Trail, ARevisitIsALoopOfTheKeyframeThatSawIt) {
  Trail trail = Chain(10);
  trail.Append({std::make_shared<const Scan>(), {}}, {20.0, 0.0, 0.0}, {}, Eigen::Matrix3d::Zero(),
               RevisitObservation{2, {0.0, 1.0, 0.0}, Eigen::Matrix3d::Identity()});
  EXPECT_DOUBLE_EQ(trail.distances_m()[2], 1.0);
  const std::vector<PoseRelation> relations = trail.relations();
  ASSERT_EQ(relations.size(), 11U);
  EXPECT_TRUE(relations.back().loop);
  EXPECT_EQ(relations.back().to, 10U);
}

TEST(Trail, WhatWasDoubtedCountsOnceThePathIsCorrectedAndBlindMotionNever) {
  Trail trail(MotionNoise{});
  const auto append = [&trail](bool localized, bool on_the_path) {
    trail.Append({std::make_shared<const Scan>(), {}}, {}, {}, Eigen::Matrix3d::Identity(), std::nullopt);
    trail.JudgeLast(localized, on_the_path);
  };
  const auto localized = [](const std::vector<Keyframe>& keyframes) {
    std::vector<bool> all;
    for (const Keyframe& keyframe : keyframes) all.push_back(keyframe.localized);
    return all;
  };
  append(true, true);
  append(false, true);
  append(false, false);
  EXPECT_EQ(localized(trail.keyframes()), (std::vector<bool>{true, false, false}));
  EXPECT_EQ(localized(trail.TrustedKeyframes()), (std::vector<bool>{true, true, false}));
  EXPECT_FALSE(trail.keyframes()[1].localized);  // Only asked, not done.
  trail.TrustDoubted();
  append(false, true);
  EXPECT_EQ(localized(trail.keyframes()), (std::vector<bool>{true, true, false, false}));
}

}  // namespace
}  // namespace cairn::slam
