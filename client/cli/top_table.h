// The table of `cairn top`: one line for each robot, with rates from two answers of the server.
#pragma once

#include <string>
#include <vector>

#include "client/lib/query_client.h"

namespace cairn::client {

// What the server said at one moment.
struct TopView {
  StatusAnswer status;
  std::vector<Job> jobs;
  double seconds = 0.0;  // On any steady clock.
};

// Several lines, each with its line end. `before` is null for the first table, which has no rates.
[[nodiscard]] std::string FormatTop(const TopView& now, const TopView* before);

}  // namespace cairn::client
