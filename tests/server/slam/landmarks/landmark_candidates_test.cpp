#include "server/slam/landmarks/landmark_candidates.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

// A scan that shows real corners at these places, each with one line along x behind it.
ScanFeatures Corners(const std::vector<Eigen::Vector2d>& places, double angle = 1.5) {
  ScanFeatures features;
  for (const Eigen::Vector2d& place : places) {
    CornerFeature corner;
    corner.position = place;
    corner.real = true;
    corner.angle = angle;
    corner.line_a = static_cast<int>(features.lines.size());
    features.lines.emplace_back();
    features.corners.push_back(corner);
  }
  return features;
}

TEST(LandmarkCandidates, AFeatureIsShownOnceItWasSeenOftenEnough) {
  LandmarkCandidates candidates({});
  EXPECT_TRUE(candidates.Observe(Corners({{2, 0}}), {}, 0.0).empty());
  EXPECT_TRUE(candidates.Observe(Corners({{2, 0}}), {}, 0.3).empty());
  const auto due = candidates.Observe(Corners({{2, 0}}), {}, 0.6);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].slot, 0U);
}

TEST(LandmarkCandidates, NotFoundMeansComparedWithAll) {
  // With the thesis' pseudo code the second feature would be added anew every time the first entry differs.
  LandmarkCandidates candidates({});
  std::vector<LandmarkSighting> due;
  for (int i = 0; i < 3; ++i) due = candidates.Observe(Corners({{2, 0}, {5, 3}}), {}, 0.3 * i);
  ASSERT_EQ(due.size(), 2U);
  EXPECT_EQ(due[1].slot, 1U);
}

TEST(LandmarkCandidates, LikeFeaturesCloseTogetherAreNobodysLandmark) {
  LandmarkCandidates candidates({});
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(candidates.Observe(Corners({{2, 0}, {2.4, 0}}), {}, 0.3 * i).empty());
}

TEST(LandmarkCandidates, InViewItIsShownAgainOnlyAfterTravelling) {
  LandmarkCandidates candidates({});
  int shown = 0;
  for (int i = 0; i < 20; ++i) shown += static_cast<int>(candidates.Observe(Corners({{2, 0}}), {}, 0.5 * i).size());
  EXPECT_EQ(shown, 2);  // At 1.0 m and at 6.0 m; the next is due at 11.
}

TEST(LandmarkCandidates, AForgottenFeatureGetsANewSlot) {
  LandmarkCandidates candidates({});
  std::vector<LandmarkSighting> due;
  for (int i = 0; i < 3; ++i) due = candidates.Observe(Corners({{2, 0}}), {}, 0.1 * i);
  for (int i = 0; i < 3; ++i) due = candidates.Observe(Corners({{2, 0}}), {}, 30.0 + 0.1 * i);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].slot, 1U);
}

// Slot 0 is used by somebody, slot 1 by nobody any more, and slot 2 belongs to a candidate in view.
TEST(LandmarkCandidates, SlotsThatNobodyUsesAreGivenAgain) {
  LandmarkCandidates candidates({});
  std::vector<LandmarkSighting> due;
  const auto see = [&](const Eigen::Vector2d& place, double from_m) {
    for (int i = 0; i < 3; ++i) due = candidates.Observe(Corners({place}), {}, from_m + 0.1 * i);
  };
  see({2, 0}, 0.0);
  see({2, 0}, 30.0);
  see({2, 0}, 60.0);
  ASSERT_EQ(candidates.slots(), 3U);
  candidates.GiveAgain({true, false, false});
  see({9, 9}, 60.5);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].slot, 1U);
  see({-9, 9}, 61.0);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].slot, 3U);
}

TEST(LandmarkCandidates, NothingFromAnEmptyScanOrSwitchedOff) {
  LandmarkOptions off;
  off.enabled = false;
  LandmarkCandidates none(off), candidates({});
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(candidates.Observe({}, {}, i).empty());
    EXPECT_TRUE(none.Observe(Corners({{2, 0}}), {}, 0.0).empty());
  }
}

}  // namespace
}  // namespace cairn::slam
