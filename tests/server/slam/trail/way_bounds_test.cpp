#include "server/slam/trail/way_bounds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <queue>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "server/slam/trail/trail.h"

namespace cairn::slam {
namespace {

// Keyframes along a way, and the relations between them.
struct Ways {
  std::vector<double> steps_m{0.0};
  std::vector<std::vector<std::pair<std::size_t, double>>> relations{{}};

  [[nodiscard]] std::vector<double> FromLast() const {
    std::vector<double> ways(steps_m.size(), std::numeric_limits<double>::infinity());
    std::priority_queue<std::pair<double, std::size_t>, std::vector<std::pair<double, std::size_t>>, std::greater<>>
        next;
    next.emplace(0.0, steps_m.size() - 1);
    while (!next.empty()) {
      const auto [way, k] = next.top();
      next.pop();
      if (way >= ways[k]) continue;
      ways[k] = way;
      if (k > 0) next.emplace(way + steps_m[k], k - 1);
      if (k + 1 < steps_m.size()) next.emplace(way + steps_m[k + 1], k + 1);
      for (const auto& [other, length] : relations[k]) next.emplace(way + length, other);
    }
    return ways;
  }
};

// Rounds along a way of 40 m, on which the robot recognises the last round at every fifth keyframe.
TEST(WayBounds, NoWayIsLongerThanItsBoundOverManyRounds) {
  std::mt19937 random(1);
  Ways ways;
  WayBounds bounds;
  bounds.AddHub(ways.FromLast());
  constexpr std::size_t kRound = 200;
  double worst_m = 0.0;
  for (std::size_t k = 1; k < 3000; ++k) {
    ways.steps_m.push_back(0.2);
    ways.relations.emplace_back();
    bounds.Append(0.2);
    if (k >= kRound && k % 5 == 0) {
      const std::size_t other = k - kRound * (1 + random() % (k / kRound));
      ways.relations[k].emplace_back(other, 0.05);
      ways.relations[other].emplace_back(k, 0.05);
      bounds.AddRelation(other, k, 0.05);
    }
    if (k == 700 || k == 790) bounds.AddHub(ways.FromLast());  // Half a round apart.
    if (k % 101 != 0) continue;
    const std::vector<double> exact = ways.FromLast();
    for (std::size_t i = 0; i <= k; ++i) {
      ASSERT_LE(exact[i], bounds.AtMostM(i) + 1e-6) << i << " of " << k;
      if (k > 1500) worst_m = std::max(worst_m, bounds.AtMostM(i));
    }
    for (std::size_t size = 1; size <= 4096; size *= 16) {
      for (std::size_t begin = 0; begin <= k; begin += size) {
        const std::size_t end = std::min(begin + size, k + 1);
        const auto begin_of = [&](auto& values) { return values.begin() + static_cast<std::ptrdiff_t>(begin); };
        const double longest = *std::max_element(begin_of(exact), exact.begin() + static_cast<std::ptrdiff_t>(end));
        for (const double way_m : {5.0, 20.0, 60.0}) {
          ASSERT_TRUE(longest < way_m + 1e-6 || !bounds.AllBelow(begin, end, way_m)) << begin << " to " << end;
        }
      }
    }
  }
  EXPECT_LT(worst_m, 60.0) << "the bounds become useless with time";
  EXPECT_TRUE(bounds.AllBelow(0, 3000, 60.0));
  bounds.Clear();
  EXPECT_EQ(bounds.AtMostM(0), std::numeric_limits<double>::infinity());
  EXPECT_FALSE(bounds.AllBelow(0, 16, 1e9));
}

TEST(WayBounds, AFarRoundNeedsMoreThanOneHub) {
  Ways ways;
  WayBounds bounds;
  bounds.AddHub(ways.FromLast());
  for (int k = 1; k < 20000; ++k) {
    ways.steps_m.push_back(0.2);
    ways.relations.emplace_back();
    bounds.Append(0.2);
    if (k % 500 == 0) bounds.AddHub(ways.FromLast());  // Every 100 m: more hubs than it keeps.
  }
  EXPECT_NEAR(bounds.AtMostM(19500), 99.8, 0.1);
  EXPECT_GE(bounds.AtMostM(0), 3999.8 - 1e-6);
  EXPECT_FALSE(bounds.AllBelow(0, 256, 60.0));
}

// What a trail says never depends on what was asked before.
TEST(Trail, SaysOfEveryKeyframeWhetherItIsFarther) {
  std::mt19937 random(5);
  Trail trail(MotionNoise{0.01, 0.0, 0.0, 0.01, 0.0, 0.0});
  double x = 0.0;
  for (std::size_t k = 0; k < 900; ++k) {
    std::optional<RevisitObservation> revisit;
    if (k > 150 && random() % 3 == 0)
      revisit = RevisitObservation{random() % (k - 100), {0.5, 0.0, 0.0}, Eigen::Matrix3d::Identity()};
    trail.Append({std::make_shared<const Scan>(), {}}, {x += 0.6, 0.0, 0.0}, {}, Eigen::Matrix3d::Identity(), revisit);
    const std::size_t other = random() % (k + 1);
    const bool farther = trail.IsFarther(other, 12.0), all = trail.AllWithin(other / 16 * 16, other + 1, 12.0);
    if (random() % 7 != 0) continue;  // Sometimes the exact distances are not asked for.
    const std::span<const double> exact = trail.distances_m();
    ASSERT_EQ(farther, exact[other] > 12.0) << k;
    const double longest = *std::max_element(exact.begin() + static_cast<std::ptrdiff_t>(other / 16 * 16),
                                             exact.begin() + static_cast<std::ptrdiff_t>(other + 1));
    ASSERT_TRUE(!all || longest <= 12.0) << k;
  }
}

}  // namespace
}  // namespace cairn::slam
