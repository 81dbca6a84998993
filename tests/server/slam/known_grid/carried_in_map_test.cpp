// Robots that are only localised in the map of others, and that somebody carries between two scans.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>
#include <variant>

#include "tests/server/slam/known_grid/half_mapped.h"

namespace cairn::slam {
namespace {

using test::Localised;
using test::Mapped;
using test::MappedOutcomes;

// What became of a robot that somebody has carried.
struct Carried {
  std::size_t wrong = 0;        // Scans at which the robot is localized and more than a metre off, ...
  std::size_t wrong_later = 0;  // ... and those of them at which it has driven more than 2 m since.
  bool noticed = false;
  bool found_again = false;
};

// The robot is carried between two scans, although nothing is missing in what it sends. `from`, `to`: shares of the
// part of the drive that was mapped. It stops at the first, and goes on from the second.
Carried CarryUnseen(double from, double to, const MapperOptions& options) {
  const auto& records = Mapped().drive.records;
  const auto scan_at = [&](double share) {
    auto i = static_cast<std::size_t>(share * static_cast<double>(Mapped().half));
    while (!std::holds_alternative<Scan>(records[i])) ++i;
    return i;
  };
  const auto odometry_before = [&](std::size_t i) {
    while (!std::holds_alternative<Odometry>(records[i])) --i;
    return std::get<Odometry>(records[i]).T_odom_robot;
  };
  const std::size_t last = scan_at(from), place = scan_at(to);
  const Stamp last_stamp = std::get<Scan>(records[last]).stamp;
  const Stamp earlier = std::get<Scan>(records[place]).stamp - last_stamp;
  const Pose2 T_new_old = odometry_before(last) * odometry_before(place).Inverse();
  Localised robot(Mapped().drive.T_map_robot_start, options);
  EXPECT_TRUE(robot.pipeline.mapper().LocaliseIn(Mapped().map, true));
  robot.Add(0, last + 1);
  EXPECT_TRUE(robot.outcomes.back().localized);
  const std::size_t before = robot.outcomes.size();
  for (std::size_t i = place + 1; i < records.size() && robot.outcomes.size() < before + 250; ++i) {
    if (const auto* const seen = std::get_if<Scan>(&records[i])) {
      auto scan = std::make_shared<Scan>(*seen);
      scan->stamp -= earlier;
      scan->sequence = 0;
      robot.pipeline.Add(std::move(scan));
    } else {
      auto odometry = std::get<Odometry>(records[i]);
      odometry.stamp -= earlier;
      odometry.sequence = 0;
      odometry.T_odom_robot = T_new_old * odometry.T_odom_robot;
      robot.pipeline.Add(odometry);
    }
  }
  Carried result;
  double way_m = 0.0;
  std::optional<Pose2> truth_before;
  for (const ScanOutcome& one : robot.outcomes) {
    if (one.stamp <= last_stamp) continue;
    const auto truth = std::find_if(MappedOutcomes().begin(), MappedOutcomes().end(),
                                    [&](const ScanOutcome& other) { return other.stamp == one.stamp + earlier; });
    if (truth == MappedOutcomes().end()) continue;
    const Eigen::Vector2d p = truth->T_map_robot.translation();
    if (truth_before) way_m += (p - truth_before->translation()).norm();
    truth_before = truth->T_map_robot;
    const bool wrong = one.localized && (one.T_map_robot.translation() - p).norm() > 1.0;
    result.noticed = result.noticed || !one.localized;
    result.wrong += wrong ? 1 : 0;
    result.wrong_later += wrong && way_m > 3.0 ? 1 : 0;
    result.found_again = one.localized && !wrong;
  }
  EXPECT_GT(way_m, 10.0);
  return result;
}

TEST(LocaliseIn, ARobotThatIsCarriedBetweenTwoScansIsLostAtOnceAndFoundAgain) {
  for (const auto& [from, to] : {std::pair(0.3, 0.7), std::pair(0.5, 0.2), std::pair(0.8, 0.4)}) {
    const Carried carried = CarryUnseen(from, to, Mapped().options);
    EXPECT_TRUE(carried.noticed) << from << " to " << to;
    EXPECT_EQ(carried.wrong, 0U) << from << " to " << to;
    EXPECT_TRUE(carried.found_again) << from << " to " << to;
  }
}

// Also where nothing looks for it: a scan that neither matches nor shows the map is no reference for the next ones.
TEST(LocaliseIn, ARobotWhoseScansShowNothingKnownIsNotLocalizedForLong) {
  MapperOptions options = Mapped().options;
  options.self_check.enabled = false;
  for (const auto& [from, to] : {std::pair(0.5, 0.2), std::pair(0.8, 0.4)}) {
    const Carried carried = CarryUnseen(from, to, options);
    EXPECT_TRUE(carried.noticed) << from << " to " << to;
    EXPECT_EQ(carried.wrong_later, 0U) << from << " to " << to;
  }
}

// The map shows only where the robot starts. Farther away it is followed, and told as localized as long as three
// standard deviations stay below half a metre.
TEST(LocaliseIn, ARobotOutsideOfTheMapIsNotLocalizedWhereItsDoubtReachesAnotherPlace) {
  constexpr double kMostSigmaM = 0.5 / 3.0;
  const Eigen::Vector2d start = Mapped().drive.T_map_robot_start.translation();
  KnownGrid::Source source = Mapped().map->source();
  const double side_m = source.resolution_m * kTileCells;
  std::erase_if(source.tiles, [&](const auto& tile) {
    const Eigen::Vector2d middle = side_m * Eigen::Vector2d(tile.first.x + 0.5, tile.first.y + 0.5);
    return (middle - start).norm() > 1.5 * side_m;
  });
  MapperOptions options = Mapped().options;
  options.filter.back_end.drift.trans_per_m *= 5.0;  // Enough for that within this drive.
  const auto map =
      std::make_shared<const KnownGrid>(std::move(source), options.recovery.place, options.self_check.near_m);
  Localised robot(Mapped().drive.T_map_robot_start, options);
  EXPECT_TRUE(robot.pipeline.mapper().LocaliseIn(map, true));
  robot.Add(0, Mapped().drive.records.size());
  EXPECT_GT(robot.localized(), 50U);
  EXPECT_LT(robot.localized(), robot.outcomes.size());
  for (const ScanOutcome& one : robot.outcomes) {
    const Eigen::Matrix2d position = one.covariance.topLeftCorner<2, 2>();
    const double sigma_m = std::sqrt(position.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff());
    EXPECT_TRUE(!one.localized || sigma_m < 1.1 * kMostSigmaM) << sigma_m;
    EXPECT_NE(one.reason, PoseReason::kLost);
  }
}

}  // namespace
}  // namespace cairn::slam
