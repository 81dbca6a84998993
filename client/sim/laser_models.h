// Scanners by name: field of view, resolution, range, error, and for lidars of today also how long a turn takes and to
// which side they turn. Sources are beside the table in laser_models.cpp. Mounting and height are those of
// LaserOptions' defaults; so are dropouts and sweep of the models of thesis C, which states neither.
#pragma once

#include <string>
#include <vector>

#include "client/sim/laser.h"
#include "common/status.h"

namespace cairn::sim {

[[nodiscard]] std::vector<std::string> LaserModelNames();

struct ModelledLaser {
  LaserOptions laser;
  double scan_hz = 0.0;  // 0: the model does not say.
};

// `laser` with all that the model says; its bias stays.
[[nodiscard]] Result<ModelledLaser> WithModel(const LaserOptions& laser, const std::string& name);

}  // namespace cairn::sim
