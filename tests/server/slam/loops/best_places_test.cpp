#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "server/slam/loops/region.h"

namespace cairn::slam {
namespace {

// The front-end has drifted where keyframes were retired.
TEST(Stretches, EndWhereKeyframesWereRetired) {
  std::vector<KeyframeShape> shapes(60);
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    shapes[k].travelled_m = 0.1 * static_cast<double>(k);
    shapes[k].number = k < 30 ? k : k + 100;
  }
  const Stretch around = StretchAround(shapes, 25, 1.05);
  EXPECT_EQ(around.first, 15U);
  EXPECT_EQ(around.last, 29U);
  EXPECT_EQ(around.anchor, 25U);
  const Stretch neighbours = NeighboursOf(shapes, 33, 8);
  EXPECT_EQ(neighbours.first, 30U);
  EXPECT_EQ(neighbours.last, 41U);
  EXPECT_EQ(NeighboursOf(shapes, 58, 8).last, 59U);
  EXPECT_EQ(NeighboursOf(shapes, 2, 8).first, 0U);
}

// All candidates sorted, then taken one after the other.
std::vector<std::size_t> Sorted(std::vector<KeyframeCost> all, const std::vector<KeyframeShape>& shapes, double apart_m,
                                std::size_t most) {
  std::ranges::stable_sort(all, {}, &KeyframeCost::cost);
  std::vector<std::size_t> chosen;
  for (const KeyframeCost& one : all) {
    const bool taken = std::ranges::any_of(chosen, [&](std::size_t other) {
      return std::abs(shapes[one.keyframe].travelled_m - shapes[other].travelled_m) < apart_m;
    });
    if (!taken && chosen.size() < most) chosen.push_back(one.keyframe);
  }
  return chosen;
}

// Added in any order, the dear ones only after what is cheaper was settled, and with many equal costs.
TEST(BestPlaces, AreThoseOfAllCandidatesInTheOrderOfTheirCosts) {
  std::mt19937 random(1);
  int settled_early = 0;
  for (int round = 0; round < 300; ++round) {
    std::vector<KeyframeShape> shapes(200);
    for (std::size_t k = 0; k < shapes.size(); ++k) shapes[k].travelled_m = 0.2 * static_cast<double>(k);
    std::vector<KeyframeCost> all;
    for (std::size_t k = 0; k < shapes.size(); k += 1 + random() % 40)
      all.push_back({k, static_cast<double>(random() % 12)});
    const std::vector<std::size_t> expected = Sorted(all, shapes, 3.0, 3);
    std::ranges::shuffle(all, random);
    BestPlaces best(shapes, 3.0, 3);
    bool settled = false;
    for (const double until : {4.0, 8.0, 12.0}) {
      for (const KeyframeCost& one : all) {
        // Every second one is added before it is needed.
        const double due = std::max(4.0, 4.0 * std::floor(one.cost / 4.0) + (one.keyframe % 2 == 0 ? 4.0 : 0.0));
        if (!settled && due == until) best.Add(one);
      }
      if (!settled && best.Settle(until)) settled = true;
      if (settled && until < 12.0) ++settled_early;
    }
    EXPECT_EQ(best.Take(), expected);
  }
  EXPECT_GT(settled_early, 100);
}

}  // namespace
}  // namespace cairn::slam
