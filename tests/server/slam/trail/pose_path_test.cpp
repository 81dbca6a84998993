#include "server/slam/trail/pose_path.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "server/slam/state/archive.h"

namespace cairn::slam {
namespace {

constexpr int kPoses = 5000;

// A robot that turns at random and so comes back to many places.
Pose2 NextPose(const Pose2& pose, std::mt19937& random) {
  const double turn = std::uniform_real_distribution<double>(-0.5, 0.5)(random);
  return pose * Pose2{0.2, 0.0, turn};
}

PosePath RandomPath(std::mt19937& random) {
  PosePath path;
  Pose2 pose;
  for (int i = 0; i < kPoses; ++i) path.Append(pose = NextPose(pose, random));
  return path;
}

std::vector<std::size_t> Near(const PosePath& path, std::size_t end, const Eigen::Vector2d& p, double distance_m) {
  std::vector<std::size_t> near;
  ForEachNear(path, end, p, distance_m, [&](std::size_t k, const Pose2& pose) {
    EXPECT_TRUE(pose == path[k]);
    if ((pose.translation() - p).norm() <= distance_m) near.push_back(k);
  });
  return near;
}

void ExpectFindsAll(const PosePath& path) {
  for (std::size_t here = 0; here < path.size(); here += 331) {
    for (const double distance_m : {0.0, 0.3, 3.0, 40.0}) {
      const Eigen::Vector2d p = path[here].translation();
      const std::size_t end = path.size() - here / 2;
      std::vector<std::size_t> all;
      for (std::size_t k = 0; k < end; ++k)
        if ((path[k].translation() - p).norm() <= distance_m) all.push_back(k);
      ASSERT_EQ(Near(path, end, p, distance_m), all) << here << ", " << distance_m;
    }
  }
}

TEST(PosePath, FindsInOrderAllPosesThatAreNear) {
  std::mt19937 random(1);
  ExpectFindsAll(RandomPath(random));
  EXPECT_TRUE(Near({}, 0, {0.0, 0.0}, 1.0).empty());
}

TEST(PosePath, FindsPosesWhereTheyAreAfterACopyWasChanged) {
  std::mt19937 random(2);
  const PosePath path = RandomPath(random);
  PosePath copy = path;
  for (std::size_t k = 100; k < 4900; k += 7) copy.Set(k, Pose2{0.0, 30.0, 1.0} * copy[k]);
  for (int i = 0; i < 600; ++i) copy.Append({-70.0, 0.01 * i, 0.0});
  ExpectFindsAll(path);
  ExpectFindsAll(copy);
}

TEST(PosePath, FindsThemAfterTheStateWasRead) {
  std::mt19937 random(3);
  std::vector<PosePath> paths = {RandomPath(random)};
  paths.push_back(paths.front());  // They share their nodes.
  paths.back().Append({200.0, 0.0, 0.0});
  StateWriter writer;
  writer(paths);
  const std::string bytes = writer.Bytes();
  StateReader reader(bytes);
  std::vector<PosePath> read;
  reader(read);
  ASSERT_TRUE(reader.done());
  ASSERT_EQ(read.size(), 2U);
  ExpectFindsAll(read[0]);
  ExpectFindsAll(read[1]);
  read[1].Append({200.0, 0.5, 0.0});
  EXPECT_EQ(Near(read[1], read[1].size(), {200.0, 0.0}, 1.0).size(), 2U);
}

// It is not worth having if it looks at everything.
TEST(PosePath, LooksAtFewPosesThatAreNotNear) {
  PosePath path;
  for (int i = 0; i < kPoses; ++i) path.Append({0.2 * i, 0.0, 0.0});
  int looked_at = 0;
  ForEachNear(path, path.size(), {500.0, 0.0}, 3.0, [&](std::size_t, const Pose2&) { ++looked_at; });
  EXPECT_GE(looked_at, 31);
  EXPECT_LE(looked_at, 31 + 2 * 16);
}

}  // namespace
}  // namespace cairn::slam
