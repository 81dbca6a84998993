#include "client/cli/frame_option.h"

#include "common/map/building_frame.h"

namespace cairn::client {

CLI::Option* AddFrame(CLI::App& app, std::string& frame) {
  return app
      .add_option("--frame", frame,
                  "The frame of what is written: that of the map, or the building's (`cairn map edit origin`)")
      ->check(CLI::IsMember({"map", "building"}))
      ->capture_default_str();
}

Result<Pose2> FrameOf(Program& program, const std::string& frame, const std::string& site) {
  if (frame == "map") return Pose2{};
  const auto edits = program.Ask([&](QueryClient& server) { return server.MapEdits(site); });
  if (!edits) return tl::unexpected(edits.error());
  const auto T_map_building = BuildingFrameOf(*edits);
  if (!T_map_building) {
    return Fail(StatusCode::kFailedPrecondition,
                "the map of site '" + site + "' has no frame of the building; set it with `cairn map edit origin`");
  }
  return *T_map_building;
}

Result<Pose2> FrameOfRobot(Program& program, const std::string& frame, const std::string& robot) {
  if (frame == "map") return Pose2{};
  const auto robots = program.Ask([&](QueryClient& server) { return server.Robots(robot); });
  if (!robots) return tl::unexpected(robots.error());
  if (robots->empty()) return Fail(StatusCode::kNotFound, "the server does not know '" + robot + "'");
  const SessionState& session = robots->front().session;
  if (session.fragment) {
    return Fail(StatusCode::kFailedPrecondition, "'" + robot + "' is not joined with the map of site '" + session.site +
                                                     "', so its place in the building is not known");
  }
  return FrameOf(program, frame, session.site);
}

void MoveInto(Trajectory& path, const Pose2& T_map_frame) {
  for (StampedPose& pose : path) pose.T_map_robot = Between(T_map_frame, pose.T_map_robot);
}

}  // namespace cairn::client
