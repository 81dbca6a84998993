// cairn-calibrate estimates the errors of a robot's odometry and scan matching, from measured runs or from a
// log. It does not use DDS.
// Exit codes: 0 done, 1 failed, 2 wrong command line.
#include <iostream>
#include <string>
#include <vector>

#include "server/tools/calibrate/command_line.h"

int main(int argc, char** argv) {
  return cairn::server::RunCalibrate(std::vector<std::string>(argv + 1, argv + argc), std::cout, std::cerr);
}
