// What `cairn status` says of a robot.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "client/cli/json_output.h"
#include "client/cli/text_output.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(StatusText, SaysWhetherARobotIsJoinedAndWhetherItMaps) {
  RobotStatus robot;
  robot.session.robot = "r1";
  robot.session.site = "lab";
  EXPECT_THAT(FormatRobot(robot), Not(HasSubstr("not joined")));
  robot.session.fragment = true;
  EXPECT_THAT(FormatRobot(robot), HasSubstr("not joined with the map"));
  EXPECT_THAT(FormatRobot(robot), Not(HasSubstr("only localised")));
  robot.session.localise_only = true;
  EXPECT_THAT(FormatRobot(robot), HasSubstr("only localised"));
  const nlohmann::json json = robot;
  EXPECT_EQ(json.at("fragment"), true);
  EXPECT_EQ(json.at("localise_only"), true);
}

}  // namespace
}  // namespace cairn::client
