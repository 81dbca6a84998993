// cairn-calibrate: what a robot's odometry and scan matching are worth, from measured runs or from a log. No DDS.
// Exit codes: 0 done, 1 failed, 2 wrong command line.
#include <iostream>
#include <string>
#include <vector>

#include "server/calibrate/command_line.h"

int main(int argc, char** argv) {
  return cairn::server::RunCalibrate(std::vector<std::string>(argv + 1, argv + argc), std::cout, std::cerr);
}
