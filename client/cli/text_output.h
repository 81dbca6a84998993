// Formats values of the server as text for people. Stateless.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "client/cli/log_check.h"
#include "client/cli/trajectory_crispness.h"
#include "client/cli/trajectory_error.h"
#include "common/service/request.h"

namespace cairn::client {

// One line: the pose, its standard deviations, and how it was found.
[[nodiscard]] std::string FormatPose(const PoseReport& pose);
// One line: state, progress, costs, message.
[[nodiscard]] std::string FormatJob(const Job& job);
// The functions below return several lines, each with its line end.
[[nodiscard]] std::string FormatRobot(const RobotStatus& robot);
// How busy the server is: one line; empty where it has not said so. With `before`, its processor time is that of the
// time since then, else that since its start.
[[nodiscard]] std::string FormatLoad(const ServerLoad& now, const ServerLoad* before = nullptr);
// What the server refused; empty where DDS Security is off and nothing was refused.
[[nodiscard]] std::string FormatRefusals(const Refusals& refused);
[[nodiscard]] std::size_t RobotsOffMap(const Ros2Report& report);
// How many ROS 2 robots are not on the map, and where `problems` is given, how many problems there are: one line. Empty
// where the server does not serve ROS 2 robots, or there is neither.
[[nodiscard]] std::string FormatRos2Door(const Ros2Report& report, std::size_t problems = 0);
// What sites have given up to stay below maps.max_memory_mib, a line for each of these. Empty where none has.
[[nodiscard]] std::string FormatMemoryNotes(std::span<const MapInfo> maps);
[[nodiscard]] std::string FormatMap(const MapInfo& map);
[[nodiscard]] std::string FormatEdit(const MapEdit& edit);
[[nodiscard]] std::string FormatTrajectoryError(const TrajectoryError& error);
// A table with one line for each trajectory.
[[nodiscard]] std::string FormatCrispness(const std::vector<NamedCrispness>& rows);
[[nodiscard]] std::string FormatLogReport(const LogReport& report);

}  // namespace cairn::client
