// What learned turns of the wheels are worth where the scans correct turns as well: the headings of simulated drives.
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "server/slam/scan/wheel_correction.h"
#include "tests/studies/lowcost/mapped.h"

namespace cairn::studies {
namespace {

constexpr std::uint64_t kFirstSeed = 11;  // As `cairn sim --seed 11`.

// Means over the poses of a drive, without alignment: the robot is told where it starts.
struct HeadingErrors {
  double heading_deg = 0.0;
  double position_m = 0.0;
};

HeadingErrors HeadingErrorsOf(const Trajectory& path, const Trajectory& truth) {
  HeadingErrors sum;
  double compared = 0.0;
  for (const StampedPose& pose : path) {
    const auto T_map_robot = PoseOn(truth, pose.stamp, 1.0);
    if (!T_map_robot) continue;
    sum.heading_deg += std::abs(Degrees(AngleDiff(pose.T_map_robot.theta, T_map_robot->theta)));
    sum.position_m += (pose.T_map_robot.translation() - T_map_robot->translation()).norm();
    compared += 1.0;
  }
  return {sum.heading_deg / compared, sum.position_m / compared};
}

// What was learned at the end of a drive, in the order of Mapper::learned. `turns`: with what was learned of turns.
slam::WheelCorrection LearnedWheels(const std::vector<LearnedValue>& learned, bool turns) {
  slam::WheelCorrection wheels;
  if (learned.size() < 3) return wheels;
  wheels.wheel_scale = learned[0].value;
  if (!turns) return wheels;
  wheels.turn_scale = learned[1].value;
  wheels.turn_per_m = learned[2].value;
  return wheels;
}

}  // namespace

void RunLearnedHeadings(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Headings with and without learned turns");
  const int drives = context.Pick(6, 1);
  report.Text("One robot in `building`, whose wheels differ from what it believes as those of `cairn sim` do, " +
              Count(drives) + " seeds from " + Count(kFirstSeed) +
              " on. Then the same drives once more, with what was learned at their end known from the beginning, and "
              "nothing learned while driving. Mean errors of the online poses, not aligned.");
  constexpr std::array<const char*, 4> kNames = {"nothing", "while driving", "before, the way only",
                                                 "before, way and turns"};
  std::array<HeadingErrors, kNames.size()> means{};
  Table each({"seed", "turn learned (%)", "turn learned (rad/m)", "nothing (deg)", "while driving (deg)",
              "way only (deg)", "way and turns (deg)"});
  for (int k = 0; k < drives; ++k) {
    sim::FleetOptions robot;
    robot.seed = kFirstSeed + static_cast<std::uint64_t>(k);
    const StudyLog log = SimulateLog("building", context.Pick(300.0, 40.0), robot);
    std::vector<LearnedValue> learned;
    const auto errors_with = [&](bool learning, const slam::WheelCorrection& wheels) {
      slam::MapperOptions options;
      options.seed = static_cast<std::int64_t>(context.seed);
      options.learning.enabled = learning;
      options.pairing.wheels = wheels;
      const LogRun run = RunOverLog(log, options);
      if (learning) learned = run.learned;
      return HeadingErrorsOf(run.online, log.truth);
    };
    std::array<HeadingErrors, kNames.size()> errors{};
    errors[0] = errors_with(false, {});
    errors[1] = errors_with(true, {});
    errors[2] = errors_with(false, LearnedWheels(learned, false));
    errors[3] = errors_with(false, LearnedWheels(learned, true));
    const slam::WheelCorrection wheels = LearnedWheels(learned, true);
    each.Add({Count(static_cast<long long>(robot.seed)), Number(100.0 * (wheels.turn_scale - 1.0), 2),
              Number(wheels.turn_per_m, 4), Number(errors[0].heading_deg, 3), Number(errors[1].heading_deg, 3),
              Number(errors[2].heading_deg, 3), Number(errors[3].heading_deg, 3)});
    for (std::size_t i = 0; i < errors.size(); ++i) {
      means[i].heading_deg += errors[i].heading_deg / drives;
      means[i].position_m += errors[i].position_m / drives;
    }
  }
  report.Add(each, "learned headings of each drive");
  Table table({"learned", "heading (deg)", "position (m)"});
  for (std::size_t i = 0; i < means.size(); ++i)
    table.Add({kNames[i], Number(means[i].heading_deg, 3), Number(means[i].position_m, 3)});
  report.Add(table, "learned headings");
  // Learning must not harm by more than another seed may.
  report.Expect(means[1].heading_deg <= 1.1 * means[0].heading_deg || context.quick,
                "what is learned while driving makes headings worse: " + Number(means[1].heading_deg, 3) +
                    " degrees, and " + Number(means[0].heading_deg, 3) + " where nothing is learned");
}

}  // namespace cairn::studies
