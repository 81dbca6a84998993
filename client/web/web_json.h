// What the page reads, as JSON: short names, metres, radians, and only what it shows. Numbers that may exceed what a
// browser can hold exactly (ids of jobs) are texts. Stateless.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/lib/tile_mirror.h"
#include "client/web/server_watch.h"
#include "common/map/map_edit.h"
#include "common/sensor/trajectory.h"

namespace cairn::web {

// The server and one site; where `site` is empty or unknown, the server and the names of its sites.
[[nodiscard]] std::string StateJson(const ServerView& view, const std::string& site, bool commands);
[[nodiscard]] std::string TilesJson(const client::TileChanges& changes);
// The samples after `since_ms`.
[[nodiscard]] std::string FlowJson(const Flow& flow, std::int64_t since_ms);
// Thinned to at most `most` points, which are at least 5 cm apart.
[[nodiscard]] std::string PathJson(const Trajectory& path, std::size_t most);
[[nodiscard]] std::string LandmarksJson(const std::vector<LandmarkReport>& landmarks);
[[nodiscard]] std::string JobJson(const Job& job);
[[nodiscard]] std::string EditsJson(const std::vector<MapEdit>& edits);
// INVALID_ARGUMENT, with what is wrong in the words of the page.
[[nodiscard]] Result<MapEdit> EditFromJson(const nlohmann::json& json);
// Why robots are not on the map: `ros2` in the words of the doctor (client/lib/ros2_findings.h), null where the server
// has no door for them; `strays`, the robots without a session.
[[nodiscard]] std::string DoctorJson(const ServerView& view);

}  // namespace cairn::web
