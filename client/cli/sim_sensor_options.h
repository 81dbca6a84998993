// The options of `cairn sim` that say what the robots carry: laser, tilting mount, wheels.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "client/sim/fleet.h"

namespace cairn::client {

// `laser_model` gets the name given with --laser-model; where it stays empty, the laser's single options count.
void AddSensorOptions(CLI::App& command, sim::FleetOptions& fleet, std::string& laser_model);

}  // namespace cairn::client
