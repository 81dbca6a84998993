// The subcommands of `cairn`, one file per thing they are about. Each function adds the options of its command to the
// command line and names the work to do when the command is chosen (Program::OnChosen).
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/program.h"

namespace cairn::client {

void AddReplay(CLI::App& app, Program& program);
void AddRecord(CLI::App& app, Program& program);
void AddSim(CLI::App& app, Program& program);
void AddPose(CLI::App& app, Program& program);
void AddPath(CLI::App& app, Program& program);
void AddStatus(CLI::App& app, Program& program);
void AddTop(CLI::App& app, Program& program);
void AddTiles(CLI::App& app, Program& program);
void AddPing(CLI::App& app, Program& program);
void AddCheckLog(CLI::App& app, Program& program);
void AddEval(CLI::App& app, Program& program);

void AddMap(CLI::App& app,
            Program& program);  // All commands of maps; those that draw, `map edit` and `map import` have own files.
void AddMapAnimate(CLI::App& map, Program& program);
void AddMapDraw(CLI::App& map, Program& program);
void AddMapEdit(CLI::App& map, Program& program);
void AddMapImport(CLI::App& map, Program& program);
void AddJob(CLI::App& app, Program& program);
void AddCloud(CLI::App& app, Program& program);
void AddSite(CLI::App& app, Program& program);  // All commands of sites; those that need no server have their own file.
void AddStoredSites(CLI::App& site, Program& program);
ExitCode ListSites(Program& program);  // The sites of the running server.
void AddSession(CLI::App& app, Program& program);
void AddRobot(CLI::App& app, Program& program);
void AddRos2(CLI::App& app, Program& program);

}  // namespace cairn::client
