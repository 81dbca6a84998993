// The server's status in the text format of Prometheus (version 0.0.4:
// https://prometheus.io/docs/instrumenting/exposition_formats/). Stateless.
#pragma once

#include <string>

#include "client/web/server_watch.h"

namespace cairn::web {

// Without an answer of the server: cairn_up 0 and nothing else, because old figures would look like new ones.
[[nodiscard]] std::string MetricsText(const ServerView& view);

}  // namespace cairn::web
