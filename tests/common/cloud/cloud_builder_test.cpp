#include "common/cloud/cloud_builder.h"

#include <gtest/gtest.h>

#include <cmath>

namespace cairn {
namespace {

Scan Beams(std::vector<float> ranges, double tilt, Stamp stamp = 0) {
  Scan scan;
  scan.stamp = stamp;
  scan.angle_first_rad = -kPi / 2;
  scan.angle_step_rad = kPi / 2;
  scan.range_max_m = 30.0;
  scan.tilt_rad = tilt;
  scan.ranges_m = std::move(ranges);
  return scan;
}

void ExpectPoint(const Eigen::Vector3f& p, double x, double y, double z) {
  EXPECT_NEAR(p.x(), x, 1e-6);
  EXPECT_NEAR(p.y(), y, 1e-6);
  EXPECT_NEAR(p.z(), z, 1e-6);
}

// By hand: beams to the right, ahead and left; tilted 30 deg down, the one ahead falls, the others stay level.
TEST(ScanPoints3, ATiltedPlaneTurnsAboutTheLasersYAxis) {
  PointCloud cloud;
  AppendPoints(Beams({2, 2, 2}, Radians(30.0)), {{}, 1.0}, 100.0, &cloud);
  ASSERT_EQ(cloud.size(), 3u);
  ExpectPoint(cloud[0], 0, -2, 1);
  ExpectPoint(cloud[1], std::sqrt(3.0), 0, 0);
  ExpectPoint(cloud[2], 0, 2, 1);
}

TEST(ScanPoints3, MountingAndPosePlaceThePlane) {
  Scan scan = Beams({2, 2, 2}, Radians(-90.0 + 1e-9));
  scan.T_robot_laser = {0.5, 0.0, 0.0};
  PointCloud cloud;
  AppendPoints(scan, {{1.0, 2.0, kPi / 2}, 0.4}, 100.0, &cloud);
  ASSERT_EQ(cloud.size(), 3u);
  ExpectPoint(cloud[1], 1.0, 2.5, 2.4);  // Straight up above the laser.
  ExpectPoint(cloud[2], -1.0, 2.5, 0.4);
}

// The robot turns by 90 deg while the beams are measured one after the other.
TEST(CloudBuilder, EachBeamIsPlacedWhereTheRobotWasAtItsTime) {
  const Trajectory turn = {{0, {0, 0, 0}}, {kNanosPerSecond, {0, 0, kPi / 2}}};
  Scan scan = Beams({2, 2, 2}, 0.0);
  scan.beam_period_s = 0.5;
  CloudBuilder builder(turn, {.max_pose_gap_s = 2.0});
  ASSERT_TRUE(builder.Add(scan));
  ASSERT_EQ(builder.cloud().size(), 3U);
  ExpectPoint(builder.cloud()[0], 0, -2, 0);
  ExpectPoint(builder.cloud()[1], std::sqrt(2.0), std::sqrt(2.0), 0);
  ExpectPoint(builder.cloud()[2], -2, 0, 0);
  scan.stamp = kNanosPerSecond;  // The path ends during the scan.
  ASSERT_TRUE(builder.Add(scan));
  ASSERT_EQ(builder.cloud().size(), 6U);
  ExpectPoint(builder.cloud()[5], -2, 0, 0);
}

TEST(ScanPoints3, OnlyHitsInRangeBecomePoints) {
  PointCloud cloud;
  AppendPoints(Beams({INFINITY, NAN, 0.0F}, 0.1), {}, 100.0, &cloud);
  EXPECT_TRUE(cloud.empty());
  AppendPoints(Beams({40, 8, 3}, 0.1), {}, 5.0, &cloud);
  EXPECT_EQ(cloud.size(), 1u);
}

const Trajectory kPath = {{0, {0, 0, 0}}, {kNanosPerSecond, {2, 0, 0}}, {9 * kNanosPerSecond, {2, 0, 1}}};

TEST(PoseOnPath, LiesBetweenNeighboursThatAreNear) {
  EXPECT_EQ(PoseOn(kPath, kNanosPerSecond, 1.0), (Pose2{2, 0, 0}));
  EXPECT_NEAR(PoseOn(kPath, kNanosPerSecond / 4, 1.0)->x, 0.5, 1e-12);
  EXPECT_FALSE(PoseOn(kPath, 5 * kNanosPerSecond, 1.0)) << "a hole in the path";
  EXPECT_TRUE(PoseOn(kPath, 5 * kNanosPerSecond, 10.0));
  EXPECT_FALSE(PoseOn(kPath, -1, 1.0));
  EXPECT_FALSE(PoseOn(kPath, 10 * kNanosPerSecond, 1.0));
  EXPECT_FALSE(PoseOn({}, 0, 1.0));
  EXPECT_FALSE(PoseOn({{INT64_MIN, {}}, {INT64_MAX, {}}}, 0, 1.0)) << "no overflow";
}

TEST(CloudBuilder, PlacesEveryScanOrSaysWhyNot) {
  CloudBuilder builder(kPath, {.tilted_only = true});
  ASSERT_TRUE(builder.Add(Beams({1, 1, 1}, 0.2, kNanosPerSecond / 2)));
  ASSERT_TRUE(builder.Add(Beams({1, 1, 1}, 0.0, kNanosPerSecond / 2)));
  ASSERT_TRUE(builder.Add(Beams({1, 1, 1}, 0.2, 5 * kNanosPerSecond)));
  ASSERT_TRUE(builder.Add(Beams({}, 0.2, 0)));
  EXPECT_EQ(builder.scans_used(), 1);
  EXPECT_EQ(builder.scans_tilted(), 1);
  EXPECT_EQ(builder.scans_level(), 1);
  EXPECT_EQ(builder.scans_without_pose(), 1);
  EXPECT_EQ(builder.scans_invalid(), 1);
  ASSERT_EQ(builder.cloud().size(), 3u);
  ExpectPoint(builder.cloud()[0], 1.0, -1.0, 0.0);
}

TEST(CloudBuilder, OnePointPerCubeAndABound) {
  CloudBuilder thin(kPath, {.voxel_m = 0.1});
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(thin.Add(Beams({1, 1, 1}, 0.2, 0)));
  EXPECT_EQ(thin.cloud().size(), 3u);
  CloudBuilder bounded(kPath, {.max_points = 10});
  Result<void> added;
  for (int i = 0; i < 4; ++i) added = bounded.Add(Beams({1, 1, 1}, 0.2, 0));
  ASSERT_FALSE(added);
  EXPECT_EQ(added.error().code, StatusCode::kResourceExhausted);
}

TEST(CloudBuilder, RefusesImpossibleOptions) {
  EXPECT_TRUE(Validate(CloudOptions{}));
  EXPECT_FALSE(Validate(CloudOptions{.height_m = NAN}));
  EXPECT_FALSE(Validate(CloudOptions{.max_range_m = 0.0}));
  EXPECT_FALSE(Validate(CloudOptions{.voxel_m = 1e-9}));
  EXPECT_FALSE(Validate(CloudOptions{.max_pose_gap_s = -1.0}));
}

}  // namespace
}  // namespace cairn
