// "Which tiles of a level changed in an area since a version?" All zero area: everywhere. A since_epoch that is not the
// map's means the asker's tiles are void: everything is sent. INVALID_ARGUMENT for a level or an area that cannot be.
// Pure function of a snapshot.
#pragma once

#include "common/service/request.h"
#include "server/maps/map_snapshot.h"

namespace cairn::server {

[[nodiscard]] Reply AnswerTiles(const Request& request, const MapSnapshot& map);

}  // namespace cairn::server
