// "What is the map of a site (or of every site) at this moment, and which versions does it have?"
// Pure function of snapshots.
#pragma once

#include <memory>
#include <vector>

#include "common/service/request.h"
#include "server/maps/map_snapshot.h"

namespace cairn::server {

[[nodiscard]] Reply AnswerMapInfo(const Request& request, const std::vector<std::shared_ptr<const MapSnapshot>>& maps);

}  // namespace cairn::server
