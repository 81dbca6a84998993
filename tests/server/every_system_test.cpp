// Every matcher and every filter, chosen by its name as users choose it: through the server and in the pipeline alone
// the same poses, and a robot with bad wheels kept where it is.
#include <gtest/gtest.h>

#include "common/map/map_lines.h"
#include "common/options/config.h"
#include "server/setup/known_map.h"
#include "tests/server/support/whole_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

constexpr ClientId kOwner = 7;
constexpr int kDriven = 60;

struct Choice {
  std::string matcher, filter;
};

// What the wheels say: they turn too little and slip, 0.35 m and 12 deg off at the end.
Odometry BadOdometry(int step) {
  Odometry odometry = RoomOdometry(step);
  odometry.T_odom_robot = {};
  for (int k = 1; k <= step; ++k) {
    Pose2 moved = Between(TruePose(k - 1), TruePose(k));
    moved.x *= 0.9;
    moved.theta += 0.0035;
    odometry.T_odom_robot = odometry.T_odom_robot * moved;
  }
  return odometry;
}

// The walls of the room world, as a user would draw them.
constexpr const char* kRoomLines = R"(cairn-map-lines 1
side -6 -4  6 -4
side  6 -4  6  4
side  6  4 -6  4
side -6  4 -6 -4
side 1 1  1 2  # The box, from outside.
side 1 2  2.5 2
side 2.5 2  2.5 1
side 2.5 1  1 1
)";

class EverySystem : public ::testing::TestWithParam<Choice> {};

TEST_P(EverySystem, KeepsTheRobotWhereItIsInTheServerAsAlone) {
  ServerOptions options = TestOptions();
  const auto applied = ApplySet({"slam.matcher=" + GetParam().matcher, "slam.filter=" + GetParam().filter},
                                [&](OptionVisitor& visitor) { Visit(visitor, options); });
  ASSERT_TRUE(applied) << applied.error().message;
  const TempDirectory directory;
  options.slam.filter.line_match.file = directory.Write("room.lines", kRoomLines);
  ASSERT_TRUE(LoadKnownMap(options.slam));
  Trajectory alone;
  slam::ScanPipeline pipeline(options.slam, {}, slam::SerialFor,
                              {.used =
                                   [&](const Scan& scan, const slam::ScanOutcome& outcome) {
                                     alone.push_back({scan.stamp, outcome.T_map_robot});
                                   },
                               .dropped = [](const Scan&, DropReason) { FAIL(); }});
  WholeServer house(options);
  house.Open("r1", kOwner);
  for (int step = 0; step < kDriven; ++step) {
    EXPECT_TRUE(pipeline.Add(BadOdometry(step)));
    pipeline.Add(std::make_shared<const Scan>(RoomScan(step)));
    house.SendOdometry("r1", kOwner, BadOdometry(step));
    house.SendScan("r1", kOwner, RoomScan(step));
    if (step % 16 == 15) house.WaitSettled("r1", static_cast<std::uint64_t>(step) + 1);
  }
  house.WaitSettled("r1", kDriven);
  const auto poses = house.All<PoseReport>();
  ASSERT_EQ(poses.size(), alone.size());
  for (std::size_t i = 0; i < alone.size(); ++i) EXPECT_EQ(poses[i].T_map_robot, alone[i].T_map_robot);

  const Pose2 wheels = Between(TruePose(kDriven - 1), BadOdometry(kDriven - 1).T_odom_robot);
  EXPECT_GT(wheels.translation().norm(), 0.3);
  const Pose2 error = Between(TruePose(kDriven - 1), alone.back().T_map_robot);
  EXPECT_LT(error.translation().norm(), 0.06);
  EXPECT_LT(std::abs(error.theta), Radians(1.5));
}

std::string NameOf(const ::testing::TestParamInfo<Choice>& info) {
  return info.param.matcher + "_" + info.param.filter;
}

constexpr const char* kDefaultFilter = "fastslam2_points";
INSTANTIATE_TEST_SUITE_P(Matchers, EverySystem,
                         ::testing::Values(Choice{"voting", kDefaultFilter}, Choice{"line_lsq", kDefaultFilter},
                                           Choice{"hough", kDefaultFilter}, Choice{"ndt", kDefaultFilter},
                                           Choice{"ndt_de", kDefaultFilter}, Choice{"icp", kDefaultFilter},
                                           Choice{"correlative", kDefaultFilter}),
                         NameOf);
INSTANTIATE_TEST_SUITE_P(Filters, EverySystem,
                         ::testing::Values(Choice{"voting", "fastslam2_oriented"}, Choice{"voting", "fastslam1"},
                                           Choice{"voting", "ekf"}, Choice{"voting", "dpslam"},
                                           Choice{"voting", "landmark_correction"}, Choice{"voting", "none"},
                                           Choice{"voting", "line_match"}),
                         NameOf);

}  // namespace
}  // namespace cairn::server::testing
