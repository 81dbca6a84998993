#include "server/slam/trail/trail.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

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
