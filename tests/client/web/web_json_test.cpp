// What the page reads.
#include "client/web/web_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace cairn::web {
namespace {

using nlohmann::json;

json RobotOf(bool localise_only, const Status& status) {
  ServerView view;
  view.status.robots.resize(1);
  SessionState& session = view.status.robots[0].session;
  session.robot = "r1";
  session.site = "hall";
  session.localise_only = localise_only;
  session.status = status;
  return json::parse(StateJson(view, "hall", false)).at("robots").at(0);
}

TEST(WebJson, ARobotMapsOrIsOnlyLocalisedWhateverItsStatusSays) {
  const Status ok{StatusCode::kOk, "only localised: nothing is drawn of it"};
  const Status stale{StatusCode::kUnavailable, "stale: nothing arrives of laser"};
  EXPECT_EQ(RobotOf(false, {})["mode"], "map");
  EXPECT_EQ(RobotOf(false, ok)["mode"], "map");
  EXPECT_EQ(RobotOf(false, stale)["mode"], "map");
  EXPECT_EQ(RobotOf(true, ok)["mode"], "localise");
  EXPECT_EQ(RobotOf(true, ok)["note"], "") << "the mode says it already";
  EXPECT_EQ(RobotOf(true, stale)["mode"], "localise");
  EXPECT_EQ(RobotOf(true, stale)["note"], stale.message);
}

// Also a lost one, whose pose says only that it is lost: the page must not draw it at a place in its own frame.
TEST(WebJson, ARobotThatIsNotJoinedIsAFragmentWhateverItsPoseSays) {
  ServerView view;
  view.status.robots.resize(1);
  RobotStatus& robot = view.status.robots[0];
  robot.session.site = "hall";
  robot.pose.reason = PoseReason::kLost;
  const auto fragment = [&view] {
    return json::parse(StateJson(view, "hall", false)).at("robots").at(0).at("fragment");
  };
  EXPECT_EQ(fragment(), false);
  robot.session.fragment = true;
  EXPECT_EQ(fragment(), true);
}

TEST(WebJson, TheDoctorsWordsAreNotChanged) {
  ServerView view;
  EXPECT_EQ(json::parse(DoctorJson(view)), json::parse(R"({"ros2": null, "strays": []})"));
  Ros2Report report;
  report.namespaces.resize(1);
  report.namespaces[0].name = "/<b>\"r1\"&\xff";  // The page sets names as text; JSON needs valid UTF-8.
  report.namespaces[0].problems = {"first", "second"};
  view.ros2 = std::make_shared<const Ros2Report>(report);
  view.strays = {{.robot = "r7", .dropped = 12, .why = "no session"}};
  const json doctor = json::parse(DoctorJson(view));
  EXPECT_EQ(doctor["ros2"]["namespaces"][0]["name"], "/<b>\"r1\"&\xef\xbf\xbd");
  EXPECT_EQ(doctor["ros2"]["namespaces"][0]["problems"], (std::vector<std::string>{"first", "second"}));
  EXPECT_EQ(doctor["strays"][0]["dropped"], 12);
}

}  // namespace
}  // namespace cairn::web
