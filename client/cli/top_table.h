// What `cairn top` shows: the server's load, its sites, ROS 2 robots with problems, jobs, and one line for each robot,
// with rates from two answers of the server. It fits the terminal. Stateless.
#pragma once

#include <string>
#include <vector>

#include "client/lib/query_client.h"

namespace cairn::client {

// What the server said at one moment.
struct TopView {
  StatusAnswer status;
  std::vector<MapInfo> maps;
  Ros2Report ros2;  // Not enabled where the server did not answer the question.
  std::vector<Job> jobs;
  double seconds = 0.0;  // On any steady clock.
};

// In characters. 0: no limit, as for a file.
struct TerminalSize {
  int rows = 0;
  int columns = 0;

  bool operator==(const TerminalSize&) const = default;
};

// Several lines, each with its line end. `before` is null for the first table, which has no rates. With a size, parts
// that are too long are cut and say how many lines they lack, so that the text and the cursor below it fit; it is then
// cut as by FitTerminal.
[[nodiscard]] std::string FormatTop(const TopView& now, const TopView* before, const TerminalSize& size = {});

// Cuts lines that are too wide, and those that are too many. With a limit, bytes that would control the terminal are
// shown as `?`, because some texts come from other programs.
[[nodiscard]] std::string FitTerminal(const std::string& text, const TerminalSize& size);

}  // namespace cairn::client
