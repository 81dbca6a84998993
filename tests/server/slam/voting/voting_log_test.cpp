// The voting matcher on a real log, in CAIRN_DATA or else in ../shared/data beside the repository. The test
// is skipped if the log is absent.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>

#include "common/sensor/log_reader.h"
#include "server/slam/features/feature_extraction.h"
#include "server/slam/voting/voting.h"
#include "tests/real_logs.h"

namespace cairn::slam {
namespace {

struct Place {
  ScanFeatures features;
  Pose2 T_odom_robot;
};

// Every scan that is 0.2 m or 5 deg from the previous one, with the odometry of the log.
std::vector<Place> PlacesOf(const std::filesystem::path& file) {
  std::vector<Place> places;
  Pose2 odometry;
  bool has_odometry = false;
  const auto summary = ReadLog(file, LogReaderOptions{}, [&](LogRecord&& record) {
    if (const auto* sample = std::get_if<Odometry>(&record)) {
      odometry = sample->T_odom_robot;
      has_odometry = true;
      return true;
    }
    if (!has_odometry) return true;
    const Pose2 moved = places.empty() ? Pose2{} : Between(places.back().T_odom_robot, odometry);
    if (places.empty() || moved.translation().norm() >= 0.2 || std::abs(moved.theta) >= Radians(5.0)) {
      places.push_back({ExtractFeatures(std::get<Scan>(record), FeatureOptions{}), odometry});
    }
    return true;
  });
  EXPECT_TRUE(summary.has_value());
  return places;
}

TEST(VotingOnALog, MatchesNearlyAllKeyframesOfMitCsail) {
  CAIRN_NEED_LOG(file, "mit-csail.clf");
  const std::vector<Place> places = PlacesOf(file);
  ASSERT_GT(places.size(), 1000U);
  int matched = 0, inverse = 0;
  const VotingOptions options;
  for (std::size_t k = 1; k < places.size(); ++k) {
    const Pose2 odometry = Between(places[k - 1].T_odom_robot, places[k].T_odom_robot);
    const MatchResult there = MatchByVoting(places[k - 1].features, places[k].features, odometry, options);
    EXPECT_TRUE(IsCovariance(there.covariance));
    EXPECT_TRUE(there.T_ref_curr.IsFinite());
    if (!there.converged) {
      EXPECT_EQ(there.T_ref_curr, odometry);
      continue;
    }
    ++matched;
    const MatchResult back = MatchByVoting(places[k].features, places[k - 1].features, odometry.Inverse(), options);
    const Pose2 loop = there.T_ref_curr * back.T_ref_curr;
    if (back.converged && loop.translation().norm() < 1e-3 && std::abs(loop.theta) < 1e-3) ++inverse;
  }
  const double share = 1.0 * matched / static_cast<double>(places.size() - 1);
  std::printf("mit-csail: %zu keyframes, %.1f %% matched, %.1f %% of these the inverse of the way back\n",
              places.size(), 100.0 * share, 100.0 * inverse / matched);
  EXPECT_GT(share, 0.9);
  EXPECT_GT(1.0 * inverse / matched, 0.97);
}

}  // namespace
}  // namespace cairn::slam
