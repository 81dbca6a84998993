#include "server/slam/matchers/polyline.h"

#include <gtest/gtest.h>

#include "server/slam/features/feature_extraction.h"
#include "tests/server/slam/worlds.h"

namespace cairn::slam {
namespace {

LineFeature Line(double x1, double y1, double x2, double y2, int points = 20) {
  LineFeature line;
  line.first = {x1, y1};
  line.last = {x2, y2};
  line.length = (line.last - line.first).norm();
  line.slope = std::atan2(y2 - y1, x2 - x1);
  const double side = line.left_normal().dot(line.first) < 0 ? -1.0 : 1.0;
  line.distance = side * line.left_normal().dot(line.first);
  line.normal_angle = std::atan2(side * line.left_normal().y(), side * line.left_normal().x());
  line.point_count = points;
  return line;
}

TEST(Polyline, CollinearPiecesWithNearEndsBecomeOne) {
  const auto lines = MergeCollinear({Line(2, -2, 2, -0.5), Line(2, -0.3, 2, 1.0, 40), Line(2, 1.2, 2, 1.5)}, {});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_NEAR(lines[0].length, 3.5, 1e-9);
  EXPECT_EQ(lines[0].point_count, 80);
  EXPECT_LT((lines[0].first - Eigen::Vector2d(2, -2)).norm(), 1e-9);
  EXPECT_LT((lines[0].last - Eigen::Vector2d(2, 1.5)).norm(), 1e-9);
  EXPECT_NEAR(lines[0].slope, kPi / 2, 1e-9);
  EXPECT_NEAR(lines[0].distance, 2.0, 1e-9);
  EXPECT_NEAR(std::abs(lines[0].normal_angle), 0.0, 1e-9);
}

TEST(Polyline, DoorsSlantsAndOffsetsStayApart) {
  const PolylineOptions options;
  EXPECT_EQ(MergeCollinear({Line(2, -2, 2, -0.5), Line(2, 0.4, 2, 1.5)}, options).size(), 2U);       // A door.
  EXPECT_EQ(MergeCollinear({Line(2, -2, 2, -0.5), Line(2.1, -0.4, 2.1, 1.5)}, options).size(), 2U);  // A step.
  EXPECT_EQ(MergeCollinear({Line(2, -2, 2, -0.5), Line(2, -0.4, 2.3, 1.5)}, options).size(), 2U);    // A bend.
}

TEST(Polyline, ARoomIsOneClosedChain) {
  const Scan scan = test::Look(test::Room(-2, -1.5, 5, 4), {0.3, 0.2, 0.1}, test::FullTurnLaser(720));
  const auto lines = ExtractFeatures(scan, FeatureOptions{}).lines;
  const auto chains = PolylinesOf(lines, {});
  ASSERT_EQ(chains.size(), 1U);
  EXPECT_TRUE(chains[0].closed);
  EXPECT_EQ(chains[0].lines.size(), lines.size());
  EXPECT_EQ(chains[0].vertices.size(), lines.size() + 1);
  // Vertices are the room's corners, in the robot frame.
  const Pose2 T_robot_world = Pose2{0.3, 0.2, 0.1}.Inverse();
  for (const Eigen::Vector2d& corner : {Eigen::Vector2d(-2, -1.5), {3, -1.5}, {3, 2.5}, {-2, 2.5}}) {
    double nearest = 1e9;
    for (const Eigen::Vector2d& v : chains[0].vertices)
      nearest = std::min(nearest, (v - T_robot_world * corner).norm());
    EXPECT_LT(nearest, 0.01);
  }
}

TEST(Polyline, StubsOutsideChainsAreDropped) {
  const std::vector<LineFeature> lines{Line(2, -2, 2, 0), Line(2, 0.05, 1.85, 0.05), Line(-1, 3, -1.2, 3)};
  const auto kept = PolylineLines(lines, {});
  ASSERT_EQ(kept.size(), 2U);  // The short one that meets the wall stays.
  EXPECT_NEAR(kept[1].length, 0.15, 1e-9);
}

TEST(Polyline, NothingComesOfNothing) {
  EXPECT_TRUE(PolylineLines({}, {}).empty());
  EXPECT_TRUE(PolylinesOf({}, {}).empty());
}

}  // namespace
}  // namespace cairn::slam
