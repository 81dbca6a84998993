#include "tests/bench/bench_input.h"

#include <array>
#include <cmath>
#include <optional>
#include <sstream>

#include "server/slam/motion/motion_gate.h"
#include "server/slam/tracking/front_end.h"
#include "tests/real_log_path.h"
#include "tests/studies/logs.h"
#include "tests/studies/scene.h"

namespace cairn::bench {
namespace {

constexpr std::size_t kMostKeyframes = 150;

BenchInput FromLog(const studies::StudyLog& log) {
  BenchInput input{log.name, {}};
  std::optional<Pose2> T_odom_robot;
  for (const LogRecord& record : log.records) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) T_odom_robot = odometry->T_odom_robot;
    const auto* scan = std::get_if<Scan>(&record);
    if (scan == nullptr || !T_odom_robot || !ValidateScan(*scan)) continue;
    if (!input.keyframes.empty() && !slam::MovedEnough(Between(input.keyframes.back().T_odom_robot, *T_odom_robot), {}))
      continue;
    input.keyframes.push_back({*scan, slam::Look(*scan, slam::FrontEndOptions{}), *T_odom_robot});
    if (input.keyframes.size() == kMostKeyframes) break;
  }
  return input;
}

BenchInput Simulated(int beams, double degrees) {
  sim::FleetOptions options;
  options.laser = studies::Sick(0.01);
  options.laser.beams = beams;
  options.laser.field_of_view_rad = Radians(degrees);
  BenchInput input = FromLog(studies::SimulateLog("building", 90.0, options));
  input.name += ", " + std::to_string(beams) + " beams";
  return input;
}

BenchInput Published(const std::string& name) {
  const auto path = RealLog(name + ".clf");
  if (!std::filesystem::exists(path)) return {name, {}};
  std::ostringstream unread;
  studies::Report report({}, "", unread);
  studies::StudyContext context{report};
  const auto log = studies::OpenLogFile(context, path, 3000);
  return log ? FromLog(*log) : BenchInput{name, {}};
}

}  // namespace

const BenchInput& InputOf(std::int64_t index) {
  static const std::array<BenchInput, 4> inputs{Simulated(181, 180.0), Simulated(1081, 270.0), Published("intel"),
                                                Published("mit-csail")};
  return inputs.at(static_cast<std::size_t>(index));
}

const BenchInput* InputOf(benchmark::State& state) {
  const BenchInput& input = InputOf(state.range(0));
  state.SetLabel(input.name);
  if (!input.keyframes.empty()) return &input;
  state.SkipWithError("the log is not at hand; set CAIRN_DATA");
  return nullptr;
}

}  // namespace cairn::bench
