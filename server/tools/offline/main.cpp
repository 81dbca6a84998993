// cairn-offline runs the estimator over one log or several, without a server and without DDS.
// Exit codes: 0 done, 1 failed, 2 wrong command line.
#include <iostream>

#include "server/tools/log_run/json_line.h"
#include "server/tools/offline/joint_run.h"
#include "server/tools/offline/options.h"
#include "server/tools/offline/run.h"

int main(int argc, char** argv) {
  int exit_code = 0;
  const auto options = cairn::server::ParseOfflineOptions(argc, argv, exit_code);
  if (!options) return exit_code;
  const auto print = [&options](const auto& report, const auto& text_of) {
    if (report) {
      std::cout << (options->json ? cairn::server::JsonLine(JsonOf(*report)) : text_of(*report));
      return 0;
    }
    if (options->json) std::cout << cairn::server::ErrorJson(report.error());
    std::cerr << "cairn-offline: " << report.error().message << '\n';
    return 1;
  };
  if (options->logs.size() > 1) return print(cairn::server::RunJoint(*options), cairn::server::JointText);
  return print(cairn::server::RunOffline(*options), cairn::server::ReportText);
}
