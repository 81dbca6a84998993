// Manual pages for man(1), made from the commands as the command line knows them, so that a new option is in its page:
// cairn.1 with the options of all commands and a table of contents, and cairn-COMMAND.1 for each command, with its
// subcommands, all their options and examples. Stateless.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "common/status.h"

namespace cairn::client {

struct ManualPage {
  std::string name;  // "cairn-map".
  std::string text;  // In the macros of man(7), in ASCII where the help is.
};

// `app` has all commands.
[[nodiscard]] std::vector<ManualPage> ManualPages(const CLI::App& app);

// Writes each page as NAME.1 into the directory, which is made where it is missing. Fails where it cannot be written.
[[nodiscard]] Result<void> WriteManualPages(const CLI::App& app, const std::filesystem::path& directory);

}  // namespace cairn::client
