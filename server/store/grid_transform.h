// Grids and paths of one map frame in another one. Stateless, thread-safe.
#pragma once

#include "server/store/records.h"

namespace cairn::server {

// Every cell of the result takes the value of the cell of `grid` that contains its centre, so walls keep their
// thickness to one cell. Exact where the transform moves by whole cells and does not turn. `resolution_m`: of the
// cells.
[[nodiscard]] StoredGrid Transformed(const StoredGrid& grid, const Pose2& T_to_from, double resolution_m);
[[nodiscard]] std::shared_ptr<const Trajectory> Transformed(const Trajectory& path_from, const Pose2& T_to_from);

}  // namespace cairn::server
