// The option --frame of commands that write or print places: in the frame `map`, or in that of the building
// (common/map/building_frame.h), where people have set one with `cairn map edit origin`.
#pragma once

#include <string>

#include "client/cli/program.h"
#include "common/geometry/pose2.h"
#include "common/sensor/trajectory.h"

namespace cairn::client {

CLI::Option* AddFrame(CLI::App& app, std::string& frame);
// T_map_frame of what was chosen. FAILED_PRECONDITION: nobody has set the origin of the site's map.
[[nodiscard]] Result<Pose2> FrameOf(Program& program, const std::string& frame, const std::string& site);
// The same of the site in which a robot is. FAILED_PRECONDITION also: its poses are not in the frame of that map,
// because it is not joined with it.
[[nodiscard]] Result<Pose2> FrameOfRobot(Program& program, const std::string& frame, const std::string& robot);
void MoveInto(Trajectory& path, const Pose2& T_map_frame);

}  // namespace cairn::client
