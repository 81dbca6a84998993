// Grids as the store keeps them (server/store/records.h), and back. The cells are shared, not copied, on the way into
// the store. Stateless, thread-safe.
#pragma once

#include "server/maps/robot_grid.h"
#include "server/store/records.h"

namespace cairn::server {

[[nodiscard]] StoredGrid ToStored(const RobotGrid& grid);
[[nodiscard]] RobotGrid FromStored(const StoredGrid& stored);

}  // namespace cairn::server
