// cairn-offline runs the estimator over a log, without a server and without DDS.
// Exit codes: 0 done, 1 failed, 2 wrong command line.
#include <iostream>

#include "server/tools/log_run/json_line.h"
#include "server/tools/offline/options.h"
#include "server/tools/offline/run.h"

int main(int argc, char** argv) {
  int exit_code = 0;
  const auto options = cairn::server::ParseOfflineOptions(argc, argv, exit_code);
  if (!options) return exit_code;
  const auto report = cairn::server::RunOffline(*options);
  if (!report) {
    if (options->json) std::cout << cairn::server::ErrorJson(report.error());
    std::cerr << "cairn-offline: " << report.error().message << '\n';
    return 1;
  }
  std::cout << (options->json ? ReportJson(*report) : ReportText(*report));
  return 0;
}
