// Runs the estimator over several logs, each of one robot of the same site, one after the other, and then smooths all
// together (server/slam/site). The robots do not know of each other before that, so the order of their stamps does not
// matter. The same logs in the same order give the same bytes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "server/slam/site/site_smoothing.h"
#include "server/tools/offline/run.h"

namespace cairn::server {

struct JointRobot {
  std::filesystem::path log;
  OfflineReport report;
  slam::SmoothedSession smoothed;
  bool in_map = false;  // Its place in the joint map is known.
};

struct JointReport {
  std::vector<JointRobot> robots;
  double smoothing_s = 0.0;  // Processor time of the joint smoothing.
  double wall_s = 0.0;
  double cpu_s = 0.0;
  double peak_rss_mib = 0.0;
};

// Writes the requested files.
[[nodiscard]] Result<JointReport> RunJoint(const OfflineOptions& options);

[[nodiscard]] std::string JointText(const JointReport& report);
[[nodiscard]] Json JsonOf(const JointReport& report);

}  // namespace cairn::server
