// Checks that an IDL value keeps within limits.h and names only known enum values, before it is converted or
// sent. The meaning is not checked: the receiver decides about a NaN range or an unknown site. Errors name
// the field. Middleware neither enforces the bounds of sequences nor the range of enums on receive (measured,
// idl/README.md).
#pragma once

#include "cairn/job.h"
#include "cairn/ledger.h"
#include "cairn/map.h"
#include "cairn/odometry.h"
#include "cairn/pose.h"
#include "cairn/query.h"
#include "cairn/scan.h"
#include "cairn/session.h"
#include "cairn/tile.h"
#include "common/status.h"

namespace cairn::wire {

[[nodiscard]] Result<void> CheckBounds(const v1::SessionRequest& request);
[[nodiscard]] Result<void> CheckBounds(const v1::SessionState& state);
[[nodiscard]] Result<void> CheckBounds(const v1::SessionRefusal& refusal);
[[nodiscard]] Result<void> CheckBounds(const v1::Scan& scan);
[[nodiscard]] Result<void> CheckBounds(const v1::Odometry& odometry);
[[nodiscard]] Result<void> CheckBounds(const v1::PoseReport& report);
[[nodiscard]] Result<void> CheckBounds(const v1::Ledger& ledger);
[[nodiscard]] Result<void> CheckBounds(const v1::MapInfo& info);
[[nodiscard]] Result<void> CheckBounds(const v1::Tile& tile);
[[nodiscard]] Result<void> CheckBounds(const v1::Job& job);
[[nodiscard]] Result<void> CheckBounds(const v1::Request& request);
[[nodiscard]] Result<void> CheckBounds(const v1::Reply& reply);

}  // namespace cairn::wire
