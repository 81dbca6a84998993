#include "client/sim/world.h"

#include "client/sim/closed_path.h"

namespace cairn::sim {

Disc WalkerAt(const Walker& walker, double seconds) {
  return {PlaceOnPath(walker.path_map, walker.speed_m_s * seconds).p_map, walker.radius_m};
}

}  // namespace cairn::sim
