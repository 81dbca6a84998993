#include "server/tools/log_run/server_sections.h"

#include <gtest/gtest.h>

#include <array>
#include <sstream>

#include "server/tools/calibrate/command_line.h"
#include "server/tools/offline/options.h"

namespace cairn::server {
namespace {

// A section that cairnd gained later, `store`, made its file unreadable for both programs.
TEST(ServerSections, CairnOfflineReadsTheDefaultConfigurationOfCairnd) {
  std::string program = "cairn-offline", log = "absent.log", option = "--config", file = CAIRND_DEFAULT_CONFIG;
  std::array<char*, 4> arguments = {program.data(), log.data(), option.data(), file.data()};
  int exit_code = 0;
  EXPECT_TRUE(ParseOfflineOptions(static_cast<int>(arguments.size()), arguments.data(), exit_code));
  EXPECT_EQ(exit_code, 0);
}

TEST(ServerSections, CairnCalibrateReadsTheDefaultConfigurationOfCairnd) {
  std::ostringstream out, err;
  static_cast<void>(RunCalibrate({"motion", "absent.log", "--config", CAIRND_DEFAULT_CONFIG}, out, err));
  // The file is read first; only the log is wrong.
  EXPECT_EQ(err.str().rfind("cairn-calibrate: absent.log", 0), 0U) << err.str();
}

}  // namespace
}  // namespace cairn::server
