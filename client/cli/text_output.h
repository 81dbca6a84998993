// Formats values of the server as text for people. Stateless.
#pragma once

#include <string>

#include "client/cli/log_check.h"
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
[[nodiscard]] std::string FormatMap(const MapInfo& map);
[[nodiscard]] std::string FormatEdit(const MapEdit& edit);
[[nodiscard]] std::string FormatTrajectoryError(const TrajectoryError& error);
[[nodiscard]] std::string FormatLogReport(const LogReport& report);

}  // namespace cairn::client
