#include "server/slam/trail/path_index.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace cairn::slam {
namespace {

// A robot that turns at random and so comes back to many places.
void AppendRandom(PosePath& path, int poses, std::mt19937& random) {
  Pose2 pose = path.empty() ? Pose2{} : path[path.size() - 1];
  for (int i = 0; i < poses; ++i) {
    pose = pose * Pose2{0.2, 0.0, std::uniform_real_distribution<double>(-0.5, 0.5)(random)};
    path.Append(pose);
  }
}

std::vector<std::size_t> Near(const PathIndex& index, const Eigen::Vector2d& p, double most_m) {
  std::vector<std::size_t> near;
  index.ForEachFrom(
      p, most_m, [](double) { return true; },
      [&](std::size_t k, const Pose2& pose) {
        EXPECT_EQ(pose, index.path()[k]);
        if ((pose.translation() - p).norm() <= most_m) near.push_back(k);
      });
  std::sort(near.begin(), near.end());
  return near;
}

void ExpectFindsAll(const PathIndex& index) {
  const PosePath& path = index.path();
  for (std::size_t here = 0; here < path.size(); here += 331) {
    for (const double most_m : {0.0, 0.3, 3.0, 1000.0}) {
      const Eigen::Vector2d p = path[here].translation();
      std::vector<std::size_t> all;
      for (std::size_t k = 0; k < path.size(); ++k)
        if ((path[k].translation() - p).norm() <= most_m) all.push_back(k);
      ASSERT_EQ(Near(index, p, most_m), all) << here << ", " << most_m;
    }
  }
}

TEST(PathIndex, FindsAllPosesThatAreNear) {
  std::mt19937 random(1);
  PosePath path;
  PathIndex index;
  for (const int poses : {1, 500, 4000}) {
    AppendRandom(path, poses, random);
    index.Follow(path);
    ExpectFindsAll(index);
  }
  EXPECT_GT(index.indexed(), 3000U);
}

// The best hypothesis is another one, which parted from the old one long ago, also before what is in the index.
TEST(PathIndex, FollowsAPathThatPartsFromTheOldOne) {
  std::mt19937 random(2);
  PosePath path;
  PathIndex index;
  AppendRandom(path, 1500, random);
  PosePath others = path;
  AppendRandom(path, 3000, random);
  AppendRandom(others, 2500, random);
  for (int i = 0; i < 3; ++i) {
    index.Follow(path);
    ExpectFindsAll(index);
    index.Follow(others);
    ExpectFindsAll(index);
    AppendRandom(path, 20, random);
    AppendRandom(others, 30, random);
  }
  for (std::size_t k = 700; k < others.size(); ++k) others.Set(k, Pose2{0.0, 300.0, 1.0} * others[k]);
  index.Follow(others);
  ExpectFindsAll(index);
  index.Follow({});
  EXPECT_EQ(index.indexed(), 0U);
  EXPECT_TRUE(Near(index, {0.0, 0.0}, 1000.0).empty());
}

// Every distance that it names is true: no pose that comes later is nearer.
TEST(PathIndex, VisitsTheNearerOnesFirst) {
  std::mt19937 random(3);
  PosePath path;
  AppendRandom(path, 6000, random);
  PathIndex index;
  index.Follow(path);
  const Eigen::Vector2d p = path[100].translation();
  double least_m = 0.0;
  int named = 0;
  index.ForEachFrom(
      p, 50.0,
      [&](double distance_m) {
        EXPECT_GE(distance_m, 0.0);
        least_m = distance_m;
        ++named;
        return true;
      },
      [&](std::size_t, const Pose2& pose) { EXPECT_GE((pose.translation() - p).norm(), least_m); });
  EXPECT_GT(named, 10);
}

// A hundred rounds along the same way: the nearest pose is found without looking at most of them.
TEST(PathIndex, LooksAtFewOfManyRounds) {
  PosePath path;
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0.0, 0.05);
  constexpr int kRounds = 100, kPoses = 200;
  for (int k = 0; k < kRounds * kPoses; ++k) {
    const double angle = 2.0 * kPi * k / kPoses;
    path.Append({6.4 * std::cos(angle) + noise(random), 6.4 * std::sin(angle) + noise(random), angle});
  }
  PathIndex index;
  index.Follow(path);
  const Eigen::Vector2d p(6.4, 0.0);
  double best_m = 3.0;
  int looked_at = 0;
  index.ForEachFrom(
      p, 3.0, [&](double distance_m) { return distance_m <= best_m; },
      [&](std::size_t, const Pose2& pose) {
        ++looked_at;
        best_m = std::min(best_m, (pose.translation() - p).norm());
      });
  double nearest_m = 3.0;
  for (std::size_t k = 0; k < path.size(); ++k) nearest_m = std::min(nearest_m, (path[k].translation() - p).norm());
  EXPECT_EQ(best_m, nearest_m);
  EXPECT_LT(looked_at, 600) << "of 3,000 within 3 m";
}

TEST(PathIndex, PosesAtTheEndOfTheWorldAreFound) {
  PosePath path;
  for (int k = 0; k < 3000; ++k) path.Append({k == 7 ? 1e11 : k == 8 ? -1e8 : 0.0, k == 9 ? 1e10 : 0.0, 0.0});
  PathIndex index;
  index.Follow(path);
  EXPECT_EQ(Near(index, {1e11, 0.0}, 1.0), (std::vector<std::size_t>{7}));
  EXPECT_EQ(Near(index, {-1e8, 0.0}, 1.0), (std::vector<std::size_t>{8}));
  EXPECT_EQ(Near(index, {0.0, 0.0}, 1.0).size(), 2997U);  // All at one place, which can not be divided.
  PosePath moved;
  for (int k = 0; k < 3000; ++k) moved.Append({1.0, 0.0, 0.0});
  index.Follow(moved);
  EXPECT_EQ(Near(index, {1.0, 0.0}, 0.1).size(), 3000U);
}

}  // namespace
}  // namespace cairn::slam
