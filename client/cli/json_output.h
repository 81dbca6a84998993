// The server's values as JSON for machines. Names are the wire's, with units; stamps are integers of nanoseconds;
// angles radians. Numbers that are not finite come out as null. Stateless.
#pragma once

#include <nlohmann/json.hpp>

#include "client/cli/log_check.h"
#include "client/cli/scan_account.h"
#include "client/cli/trajectory_error.h"
#include "common/service/request.h"

namespace cairn::client {

[[nodiscard]] nlohmann::json ToJson(const Pose2& pose);
[[nodiscard]] nlohmann::json ToJson(const PoseReport& pose);
[[nodiscard]] nlohmann::json ToJson(const Ledger& ledger);
[[nodiscard]] nlohmann::json ToJson(const RobotStatus& robot);
[[nodiscard]] nlohmann::json ToJson(const MapInfo& map);
[[nodiscard]] nlohmann::json ToJson(const Job& job);
[[nodiscard]] nlohmann::json ToJson(const ScanAccount& account);
[[nodiscard]] nlohmann::json ToJson(const TrajectoryError& error);
[[nodiscard]] nlohmann::json ToJson(const LogReport& report);
// Without its bytes.
[[nodiscard]] nlohmann::json TileToJson(const Tile& tile);
[[nodiscard]] nlohmann::json StatusToJson(const Status& status);

}  // namespace cairn::client
