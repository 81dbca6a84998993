// The subcommands of `cairn`, one per file. Each function adds the options of its command to the command line and names
// the work to do when the command is chosen (Program::OnChosen).
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/program.h"

namespace cairn::client {

void AddReplay(CLI::App& app, Program& program);
void AddSim(CLI::App& app, Program& program);
void AddPose(CLI::App& app, Program& program);
void AddPath(CLI::App& app, Program& program);
void AddStatus(CLI::App& app, Program& program);
void AddTiles(CLI::App& app, Program& program);
void AddPing(CLI::App& app, Program& program);
void AddCheckLog(CLI::App& app, Program& program);
void AddEval(CLI::App& app, Program& program);

void AddMap(CLI::App& app, Program& program);  // Adds the four below.
void AddMapInfo(CLI::App& map, Program& program);
void AddMapExport(CLI::App& map, Program& program);
void AddMapEnable(CLI::App& map, Program& program);  // Adds `map enable` and `map rollback`.
void AddMapDraw(CLI::App& map, Program& program);

void AddJob(CLI::App& app, Program& program);  // Adds the two below.
void AddJobSmooth(CLI::App& job, Program& program);
void AddJobQueries(CLI::App& job, Program& program);  // Adds `job list`, `job show` and `job cancel`.

void AddCloud(CLI::App& app, Program& program);  // cloud export.

void AddSession(CLI::App& app, Program& program);

}  // namespace cairn::client
