// Every matcher and every filter, chosen by its name as users choose it: through the server and in the pipeline alone
// the same poses, and a robot with bad wheels kept where it is; and every matcher keeps it there without anything else
// to help it.
#include <gtest/gtest.h>

#include <limits>

#include "common/map/map_lines.h"
#include "common/options/config.h"
#include "server/known_map.h"
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

ServerOptions OptionsWith(const std::vector<std::string>& assignments) {
  ServerOptions options = TestOptions();
  const auto applied = ApplySet(assignments, [&](OptionVisitor& visitor) { Visit(visitor, options); });
  EXPECT_TRUE(applied) << applied.error().message;
  return options;
}

// The whole drive in the pipeline alone.
std::vector<slam::ScanOutcome> RunAlone(const slam::MapperOptions& options) {
  std::vector<slam::ScanOutcome> outcomes;
  slam::ScanPipeline pipeline(
      options, {}, slam::SerialFor,
      {.used = [&](const Scan&, const slam::ScanOutcome& outcome) { outcomes.push_back(outcome); },
       .dropped = [](const Scan&, DropReason) { FAIL(); }});
  for (int step = 0; step < kDriven; ++step) {
    pipeline.Add(BadOdometry(step));
    pipeline.Add(std::make_shared<const Scan>(RoomScan(step)));
  }
  return outcomes;
}

void ExpectNearTruth(const Pose2& T_map_robot, double metres, double radians) {
  const Pose2 error = Between(TruePose(kDriven - 1), T_map_robot);
  EXPECT_LT(error.translation().norm(), metres);
  EXPECT_LT(std::abs(error.theta), radians);
}

class EverySystem : public ::testing::TestWithParam<Choice> {};

TEST_P(EverySystem, KeepsTheRobotWhereItIsInTheServerAsAlone) {
  ServerOptions options = OptionsWith({"slam.matcher=" + GetParam().matcher, "slam.filter=" + GetParam().filter});
  const TempDirectory directory;
  options.slam.filter.line_match.file = directory.Write("room.lines", kRoomLines);
  ASSERT_TRUE(LoadKnownMap(options.slam));
  const auto alone = RunAlone(options.slam);
  WholeServer house(options);
  house.Open("r1", kOwner);
  for (int step = 0; step < kDriven; ++step) {
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
  ExpectNearTruth(alone.back().T_map_robot, 0.06, Radians(1.5));
}

// With the refinement, or with a filter that corrects, a matcher that never converges goes unnoticed.
class EveryMatcher : public ::testing::TestWithParam<Choice> {};

TEST_P(EveryMatcher, KeepsTheRobotWhereItIsWithoutRefinementAndFilter) {
  const ServerOptions options = OptionsWith({"slam.matcher=" + GetParam().matcher, "slam.filter=none",
                                             "slam.front_end.refine.enabled=false", "slam.revisit.enabled=false"});
  const auto outcomes = RunAlone(options.slam);
  ASSERT_EQ(outcomes.size(), static_cast<std::size_t>(kDriven));
  int tracking = 0;
  for (const slam::ScanOutcome& outcome : outcomes) tracking += outcome.reason == PoseReason::kTracking ? 1 : 0;
  EXPECT_GT(tracking, kDriven * 9 / 10);
  ExpectNearTruth(outcomes.back().T_map_robot, 0.03, Radians(0.5));
}

// In the drives above a filter that does nothing goes unnoticed: the front-end alone keeps the robot where it is. Here
// the robot sees nothing for a while, its wheels slip and turn too far meanwhile, and nothing refines the steps, so
// that only the filter can put the heading right when the walls are seen again.
class EveryFilter : public ::testing::TestWithParam<std::string> {};

Pose2 ErrorAfterABlindStretch(const slam::MapperOptions& options) {
  constexpr int kSteps = 300, kBlindFrom = 60, kBlindTo = 75;  // More than one round of 251 steps.
  Pose2 last, T_odom_robot;
  slam::ScanPipeline pipeline(
      options, {}, slam::SerialFor,
      {.used = [&last](const Scan&, const slam::ScanOutcome& outcome) { last = outcome.T_map_robot; },
       .dropped = [](const Scan&, DropReason) { FAIL(); }});
  for (int step = 0; step < kSteps; ++step) {
    const bool blind = step >= kBlindFrom && step < kBlindTo;
    Pose2 moved = step > 0 ? Between(TruePose(step - 1), TruePose(step)) : Pose2{};
    if (blind) moved = {1.2 * moved.x, moved.y, moved.theta + 0.003};
    T_odom_robot = T_odom_robot * moved;
    Scan scan = RoomScan(step);
    if (blind) scan.ranges_m.assign(scan.ranges_m.size(), std::numeric_limits<float>::infinity());
    pipeline.Add(Odometry{scan.sequence, scan.stamp, T_odom_robot});
    pipeline.Add(std::make_shared<const Scan>(std::move(scan)));
  }
  return Between(TruePose(kSteps - 1), last);
}

TEST_P(EveryFilter, CorrectsTheHeadingAfterABlindStretch) {
  const TempDirectory directory;
  const auto heading_error = [&](const std::string& filter, int seed) {
    // The last two are for landmark_correction: in so small a room a landmark is never out of sight for 15 m, and it
    // corrects the heading only by landmarks whose direction is known better than the heading.
    ServerOptions options = OptionsWith(
        {"slam.filter=" + filter, "slam.seed=" + std::to_string(seed), "slam.particles=100",
         "slam.front_end.refine.enabled=false", "slam.line_match.start_known=true", "slam.correction.min_travel_m=4",
         filter == "landmark_correction" ? "slam.landmarks.slope_rad=0.01" : "slam.landmarks.slope_rad=0.05"});
    options.slam.filter.line_match.file = directory.Write("room.lines", kRoomLines);
    EXPECT_TRUE(LoadKnownMap(options.slam));
    return std::abs(ErrorAfterABlindStretch(options.slam).theta);
  };
  const double uncorrected_rad = heading_error("none", 1);
  EXPECT_GT(uncorrected_rad, Radians(2.0)) << "there must be something to correct";
  // With one seed in eight a filter of particles corrects less: the median of three counts.
  int corrected = 0;
  for (int seed = 1; seed <= 3 && corrected < 2; ++seed)
    corrected += heading_error(GetParam(), seed) < 0.5 * uncorrected_rad ? 1 : 0;
  EXPECT_EQ(corrected, 2);
}

std::string NameOf(const ::testing::TestParamInfo<Choice>& info) {
  return info.param.matcher + "_" + info.param.filter;
}

std::vector<Choice> EveryMatcherWith(const std::string& filter) {
  std::vector<Choice> choices;
  for (const std::string_view matcher : slam::MatcherNames()) choices.push_back({std::string(matcher), filter});
  return choices;
}

constexpr const char* kDefaultFilter = "fastslam2_points";
INSTANTIATE_TEST_SUITE_P(Matchers, EverySystem, ::testing::ValuesIn(EveryMatcherWith(kDefaultFilter)), NameOf);
INSTANTIATE_TEST_SUITE_P(Filters, EverySystem,
                         ::testing::Values(Choice{"voting", "fastslam2_oriented"}, Choice{"voting", "fastslam1"},
                                           Choice{"voting", "ekf"}, Choice{"voting", "dpslam"},
                                           Choice{"voting", "landmark_correction"}, Choice{"voting", "none"},
                                           Choice{"voting", "line_match"}),
                         NameOf);
INSTANTIATE_TEST_SUITE_P(Blind, EveryFilter,
                         ::testing::Values(kDefaultFilter, "fastslam2_oriented", "fastslam1", "ekf", "dpslam",
                                           "landmark_correction", "line_match"),
                         [](const ::testing::TestParamInfo<std::string>& row) { return row.param; });
INSTANTIATE_TEST_SUITE_P(Alone, EveryMatcher, ::testing::ValuesIn(EveryMatcherWith("none")), NameOf);

}  // namespace
}  // namespace cairn::server::testing
