// How a question reaches the snapshots it is answered from: functions that copy a shared pointer or a plain value under
// a short lock and never wait for an estimator. Handed in by the server.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/service/job.h"
#include "server/maps/map_snapshot.h"
#include "server/robots/session_snapshot.h"

namespace cairn::server {

struct Views {
  std::function<std::optional<SessionSnapshot>(const std::string& robot)> session;
  std::function<std::vector<SessionSnapshot>()> sessions;
  std::function<std::shared_ptr<const MapSnapshot>(const std::string& site)> map;  // Null: no such site.
  std::function<std::vector<std::shared_ptr<const MapSnapshot>>()> maps;
  std::function<Result<Job>(std::uint64_t id)> job;
  std::function<std::vector<Job>(const std::string& site)> jobs;
};

}  // namespace cairn::server
