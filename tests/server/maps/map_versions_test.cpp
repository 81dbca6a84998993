#include "server/maps/map_versions.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace cairn::server {
namespace {

MapVersion Smoothed(const std::string& robot) {
  MapVersion version;
  version.smoothed[robot] = {1, std::make_shared<const Trajectory>(Trajectory{{1, {}}})};
  return version;
}

TEST(MapVersions, BeginWithTheLiveMapEnabled) {
  const MapVersions versions(4);
  ASSERT_EQ(versions.infos().size(), 1U);
  EXPECT_EQ(versions.infos()[0].version, 1U);
  EXPECT_TRUE(versions.infos()[0].enabled);
}

TEST(MapVersions, AVersionIsAddedDisabled) {
  MapVersions versions(4);
  EXPECT_EQ(versions.Add({}), 2U);
  EXPECT_EQ(versions.enabled(), 1U);
  EXPECT_FALSE(versions.Find(2)->info.enabled);
}

TEST(MapVersions, EnablingKeepsWhatTheOutgoingVersionGivesUp) {
  MapVersions versions(4);
  versions.Add({});
  versions.Enable(2, {{7, RobotGrid{{}, 12}}});
  EXPECT_EQ(versions.enabled(), 2U);
  EXPECT_EQ(versions.Find(1)->parts.at(7).keyframes, 12U);
  EXPECT_FALSE(versions.Find(1)->info.enabled);
  EXPECT_TRUE(versions.Find(2)->info.enabled);
}

MapVersion Of(const std::map<SessionId, RobotGrid>& parts) {
  MapVersion version;
  version.parts = parts;
  return version;
}

// A version that a job has made of one robot alone: others were not in it, and stayed behind in the map before.
TEST(MapVersions, TheEnabledOneTakesOverThePartsThatItDoesNotHave) {
  MapVersions versions(9);
  versions.Add(Of({{1, RobotGrid{{}, 10}}, {2, RobotGrid{{}, 20}}}));
  EXPECT_EQ(versions.Enable(2, {{1, RobotGrid{{}, 1}}, {2, RobotGrid{{}, 2}}}), std::vector<std::uint32_t>{1});
  versions.Add(Of({{2, RobotGrid{{}, 21}}, {3, RobotGrid{{}, 31}}}));
  // Version 1 shows session 3 as it was until now, and version 2 does as well.
  EXPECT_EQ(versions.Enable(3, {{2, RobotGrid{{}, 22}}, {3, RobotGrid{{}, 30}}}),
            (std::vector<std::uint32_t>{1, 3, 2}));
  EXPECT_EQ(versions.Find(3)->parts.at(1).keyframes, 10U);
  EXPECT_EQ(versions.Find(3)->parts.at(2).keyframes, 21U);
  EXPECT_EQ(versions.Find(2)->parts.at(2).keyframes, 22U);
  EXPECT_EQ(versions.Find(2)->parts.at(3).keyframes, 30U);
  EXPECT_EQ(versions.Find(1)->parts.at(2).keyframes, 2U);
  EXPECT_EQ(versions.Find(1)->parts.at(3).keyframes, 30U);
}

// After a robot was joined, and then all were smoothed, a roll back to the first version moved that robot alone.
TEST(MapVersions, AVersionShowsAllAsTheyWereAlsoWhereALaterOneIsOfOneRobotAlone) {
  MapVersions versions(9);
  versions.Add(Of({{3, RobotGrid{{}, 31}}}));
  versions.Enable(2, {{3, RobotGrid{{}, 30}}});
  versions.Add(Of({{1, RobotGrid{{}, 11}}, {3, RobotGrid{{}, 33}}}));
  versions.Enable(3, {{1, RobotGrid{{}, 10}}, {3, RobotGrid{{}, 32}}});
  EXPECT_EQ(versions.Find(1)->parts.at(1).keyframes, 10U);
  EXPECT_EQ(versions.Find(1)->parts.at(3).keyframes, 30U);
  EXPECT_EQ(versions.Find(2)->parts.at(1).keyframes, 10U);
  EXPECT_EQ(versions.Find(2)->parts.at(3).keyframes, 32U);
}

TEST(MapVersions, TheOldestThatNobodyNeedsIsForgotten) {
  MapVersions versions(3);
  versions.Add({});
  versions.Enable(2, {});
  versions.Add({});
  versions.Add({});
  EXPECT_NE(versions.Find(1), nullptr);
  EXPECT_NE(versions.Find(2), nullptr);
  EXPECT_EQ(versions.Find(3), nullptr);
  EXPECT_NE(versions.Find(4), nullptr);
}

TEST(MapVersions, TheLeastNeededIsTheOldestThatNoRollBackAndNoJobNeeds) {
  MapVersions versions(9);
  EXPECT_EQ(versions.LeastNeeded(true), std::nullopt);
  while (versions.Add({}) < 6) continue;
  versions.Enable(4, {});
  std::vector<std::uint32_t> gone;
  for (const bool last : {false, true}) {
    while (const auto version = versions.LeastNeeded(last)) {
      versions.Remove(*version);
      gone.push_back(*version);
    }
    if (last) break;
    EXPECT_EQ(gone, (std::vector<std::uint32_t>{1, 2, 5}));
  }
  EXPECT_EQ(gone, (std::vector<std::uint32_t>{1, 2, 5, 6, 3}));
  EXPECT_EQ(versions.Add({}), 7U);
}

// A job that ended while an older version was being enabled pushed that version out, and the switch ended the process.
TEST(MapVersions, TheOneThatIsBeingSwitchedToIsNotForgotten) {
  MapVersions versions(2);
  EXPECT_EQ(versions.Add({}), 2U);
  for (int i = 0; i < 3; ++i) versions.Add({}, 2);
  ASSERT_NE(versions.Find(2), nullptr);
  versions.Enable(2, {});
  EXPECT_EQ(versions.enabled(), 2U);
  EXPECT_EQ(versions.infos().size(), 3U);  // 1, 2 and the newest.
}

TEST(MapVersions, SmoothedPathsAreTheEnabledOnesOrTheNewest) {
  MapVersions versions(8);
  EXPECT_TRUE(versions.smoothed().empty());
  versions.Add(Smoothed("a"));
  versions.Add(Smoothed("b"));
  EXPECT_TRUE(versions.smoothed().contains("b"));
  versions.Enable(2, {});
  EXPECT_TRUE(versions.smoothed().contains("a"));
}

}  // namespace
}  // namespace cairn::server
