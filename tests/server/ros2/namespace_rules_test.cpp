#include "server/ros2/namespace_rules.h"

#include <gtest/gtest.h>

#include "server/ros2/ros2_options.h"

namespace cairn::server {
namespace {

NamespaceRules Rules(const std::string& text) {
  auto rules = NamespaceRules::Parse(text, "lab");
  EXPECT_TRUE(rules) << rules.error().message;
  return *rules;
}

TEST(NamespaceRules, NamesRobotsAndSites) {
  EXPECT_EQ(Rules("/{robot}").PlaceOf("/r1"), (RobotPlace{"r1", "lab"}));
  EXPECT_EQ(Rules("/{site}/{robot}").PlaceOf("/hall/r1"), (RobotPlace{"r1", "hall"}));
  EXPECT_EQ(Rules("/fleet/{robot}").PlaceOf("/fleet/r1"), (RobotPlace{"r1", "lab"}));
  EXPECT_EQ(Rules("/=turtle").PlaceOf("/"), (RobotPlace{"turtle", "lab"}));
  EXPECT_EQ(Rules("/agv7=hall/r7, /{robot}").PlaceOf("/agv7"), (RobotPlace{"r7", "hall"}));
}

TEST(NamespaceRules, OfSeveralRulesTheFirstThatFitsCounts) {
  const NamespaceRules rules = Rules("/cairn/{robot}, /{site}/{robot}, /{robot}");
  EXPECT_EQ(rules.PlaceOf("/cairn/a"), (RobotPlace{"a", "lab"}));
  EXPECT_EQ(rules.PlaceOf("/b/a"), (RobotPlace{"a", "b"}));
  EXPECT_EQ(rules.PlaceOf("/a"), (RobotPlace{"a", "lab"}));
}

TEST(NamespaceRules, WhatFitsNoRuleIsNoRobot) {
  EXPECT_FALSE(Rules("/{robot}").PlaceOf("/"));
  EXPECT_FALSE(Rules("/{robot}").PlaceOf("/a/b"));
  EXPECT_FALSE(Rules("/fleet/{robot}").PlaceOf("/other/r1"));
  EXPECT_FALSE(Rules("/{robot}").PlaceOf("/" + std::string(65, 'r'))) << "a name of Cairn's has 64 characters at most";
  EXPECT_FALSE(Rules("/{robot}").PlaceOf("/a?b"));
}

TEST(NamespaceRules, WrongRulesAreRefusedAtTheStart) {
  for (const char* wrong : {"", "robot", "/fixed", "/{robot}/{robot}", "/{site}/{site}/{robot}", "/{robot}=r1",
                            "/a=", "/a=b/c/d", "/a b!/{robot}", "/=-r"}) {
    EXPECT_FALSE(NamespaceRules::Parse(wrong, "lab")) << wrong;
    Ros2Options options;
    options.enabled = true;
    options.namespaces = wrong;
    EXPECT_FALSE(Validate(options)) << wrong;
  }
}

TEST(TopicNames, AreTakenApartAndPutTogether) {
  EXPECT_EQ(NamespaceOf("rt/scan", "scan"), "/");
  EXPECT_EQ(NamespaceOf("rt/r1/scan", "scan"), "/r1");
  EXPECT_EQ(NamespaceOf("rt/hall/r1/front/scan", "front/scan"), "/hall/r1");
  EXPECT_FALSE(NamespaceOf("rt/r1/myscan", "scan"));
  EXPECT_FALSE(NamespaceOf("rq/r1/scan", "scan"));
  EXPECT_FALSE(NamespaceOf("scan", "scan"));
  EXPECT_EQ(TopicIn("/", "tf"), "rt/tf");
  EXPECT_EQ(TopicIn("/hall/r1", "cairn/pose"), "rt/hall/r1/cairn/pose");
  EXPECT_EQ(TopicPart("hall-2.a"), "hall_2_a");
  EXPECT_EQ(TopicPart("2nd"), "site_2nd") << "a part of a topic begins with no digit";
}

}  // namespace
}  // namespace cairn::server
