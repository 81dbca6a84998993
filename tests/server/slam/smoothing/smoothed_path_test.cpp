#include <gtest/gtest.h>

#include "server/slam/smoothing/smoothed_map.h"

namespace cairn::slam {
namespace {

const Eigen::Matrix3d kTight = Eigen::Vector3d(1e-4, 1e-4, 1e-5).asDiagonal();

// Eleven keyframes along x, a metre apart, whose best particle wandered sideways and came back.
MapperSnapshot Wandered() {
  MapperSnapshot snapshot;
  for (std::size_t k = 0; k <= 10; ++k) {
    const double x = static_cast<double>(k);
    snapshot.full_path.push_back({x, 0.04 * x * (10.0 - x), 0.0});
    snapshot.scans.push_back({static_cast<Stamp>(10 * k), k, {}});
    snapshot.scans.push_back({static_cast<Stamp>(10 * k + 5), k, {0.5, 0.0, 0.0}});
    if (k > 0) snapshot.relations.push_back({k - 1, k, {1.0, 0.0, 0.0}, kTight, false});
  }
  return snapshot;
}

TEST(SmoothedPath, FitsTheRelationsNotTheSample) {
  const MapperSnapshot snapshot = Wandered();
  const std::vector<Pose2> path = SmoothedPath(snapshot);
  ASSERT_EQ(path.size(), snapshot.full_path.size());
  for (const Pose2& pose : path) EXPECT_NEAR(pose.y, 0.0, 0.01);
  EXPECT_EQ(path.front(), snapshot.full_path.front());
}

TEST(SmoothedPath, IsTheBestParticlesWhereToldSoOrNothingIsKnown) {
  MapperSnapshot snapshot = Wandered();
  snapshot.pose_graph.enabled = false;
  EXPECT_EQ(SmoothedPath(snapshot), snapshot.full_path);
  snapshot.pose_graph.enabled = true;
  snapshot.relations.clear();
  EXPECT_EQ(SmoothedPath(snapshot), snapshot.full_path);
  EXPECT_TRUE(SmoothedPath({}).empty());
}

TEST(SmoothedPath, EveryScanKeepsItsPlaceByItsKeyframe) {
  const MapperSnapshot snapshot = Wandered();
  const Trajectory trajectory = snapshot.TrajectoryAlong(SmoothedPath(snapshot));
  ASSERT_EQ(trajectory.size(), snapshot.scans.size());
  EXPECT_EQ(trajectory[3].stamp, 15);
  EXPECT_NEAR(trajectory[3].T_map_robot.x, 1.5, 0.01);
}

}  // namespace
}  // namespace cairn::slam
