// The options of `cairn sim` that say what the robots carry: laser, tilting mount, wheels.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "client/sim/fleet.h"

namespace cairn::client {

// Answers where the name of a laser model will be after parsing; empty: the single options count.
[[nodiscard]] std::shared_ptr<std::string> AddSensorOptions(CLI::App& command, sim::FleetOptions& fleet);

}  // namespace cairn::client
