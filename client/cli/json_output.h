// What the program prints as JSON. The functions are those by which nlohmann::json converts values of these types, so
// that a value can stand wherever a JSON value can. Names are those of the wire, with units; stamps are integers of
// nanoseconds, angles are radians, and numbers that are not finite become null. Stateless.
#pragma once

#include <nlohmann/json.hpp>

#include "client/cli/log_check.h"
#include "client/cli/scan_account.h"
#include "client/cli/trajectory_crispness.h"
#include "client/cli/trajectory_error.h"
#include "common/service/request.h"

namespace cairn {

void to_json(nlohmann::json& json, const Status& status);
void to_json(nlohmann::json& json, const Pose2& pose);
void to_json(nlohmann::json& json, const PoseReport& pose);
void to_json(nlohmann::json& json, const Ledger& ledger);
void to_json(nlohmann::json& json, const LearnedValue& learned);
void to_json(nlohmann::json& json, const RobotStatus& robot);
void to_json(nlohmann::json& json, const MapVersionInfo& version);
void to_json(nlohmann::json& json, const MapInfo& map);
void to_json(nlohmann::json& json, const MapEdit& edit);
void to_json(nlohmann::json& json, const Tile& tile);  // Without the tile's bytes, but with their number.
void to_json(nlohmann::json& json, const Job& job);
void to_json(nlohmann::json& json, const SavedSite& saved);
void to_json(nlohmann::json& json, const Refusals& refused);
void to_json(nlohmann::json& json, const ServerLoad& load);
void to_json(nlohmann::json& json, const PoseHypothesis& hypothesis);
void to_json(nlohmann::json& json, const Ros2Report& report);
void to_json(nlohmann::json& json, const LogComplaint& complaint);

}  // namespace cairn

namespace cairn::client {

void to_json(nlohmann::json& json, const ScanAccount& account);
void to_json(nlohmann::json& json, const TrajectoryError& error);
void to_json(nlohmann::json& json, const NamedCrispness& row);
void to_json(nlohmann::json& json, const StampSummary& stamps);
void to_json(nlohmann::json& json, const Finding& finding);
void to_json(nlohmann::json& json, const LogReport& report);

}  // namespace cairn::client
