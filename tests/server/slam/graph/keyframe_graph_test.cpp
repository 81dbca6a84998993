#include "server/slam/graph/keyframe_graph.h"

#include <gtest/gtest.h>

namespace cairn::slam {
namespace {

constexpr MotionNoise kDrift{0.01, 0.0, 0.0, 0.01, 0.0, 0.0};

KeyframeGraph Chain(std::size_t keyframes) {
  KeyframeGraph graph(kDrift);
  for (std::size_t k = 0; k < keyframes; ++k) graph.Append({2.0, 0.0, 0.0}, Eigen::Matrix3d::Zero());
  return graph;
}

TEST(KeyframeGraph, DistancesFollowTheChain) {
  const KeyframeGraph graph = Chain(5);
  EXPECT_EQ(graph.DistancesFromLast(), (std::vector<double>{8, 6, 4, 2, 0}));
  EXPECT_EQ(graph.relations().size(), 4U);
}

TEST(KeyframeGraph, ALoopIsAShortCutBothWays) {
  KeyframeGraph graph = Chain(11);
  graph.AddLoop(1, 9, {0.5, 0.0, 0.0}, Eigen::Matrix3d::Identity());
  const std::vector<double> distance = graph.DistancesFromLast();
  EXPECT_DOUBLE_EQ(distance[9], 2.0);
  EXPECT_DOUBLE_EQ(distance[1], 2.5);
  EXPECT_DOUBLE_EQ(distance[0], 4.5);
  EXPECT_DOUBLE_EQ(distance[2], 4.5);
  EXPECT_DOUBLE_EQ(distance[5], 10.0);  // The farthest keyframe: both ways round have the same length.
}

TEST(KeyframeGraph, AnEmptyGraphHasNoDistances) {
  EXPECT_TRUE(KeyframeGraph(kDrift).DistancesFromLast().empty());
}

}  // namespace
}  // namespace cairn::slam
