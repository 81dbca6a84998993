#include "common/bag/bag_topics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace cairn::bag {
namespace {

using ::testing::HasSubstr;

TEST(TopicsOfARecording, AreThoseOfOneRobot) {
  const auto scans = [](const std::string& name) { return Topic{name, "foxglove.LaserScan", "protobuf"}; };
  const auto odometry = [](const std::string& name) { return Topic{name, "foxglove.PoseInFrame", "protobuf"}; };
  std::vector<Topic> topics = {scans("/robots/r1/scan/scan"), odometry("/robots/r1/odometry"),
                               scans("/robots/r1/scan/rear"), odometry("/robots/r1/pose")};
  const auto both = ChooseTopics(topics, "", "", true);
  ASSERT_TRUE(both) << both.error().message;
  EXPECT_EQ(both->lidars.size(), 2U);
  EXPECT_FALSE(ChooseTopics(topics, "", ""));
  topics.push_back(scans("/robots/r2/scan/scan"));
  topics.push_back(odometry("/robots/r2/odometry"));
  EXPECT_THAT(ChooseTopics(topics, "", "", true).error().message, HasSubstr("/robots/r2/scan/scan"));
  const auto second = ChooseTopics(topics, "/robots/r2/scan/scan", "", true);
  ASSERT_TRUE(second) << second.error().message;
  EXPECT_EQ(second->odometry->name, "/robots/r2/odometry");
}

}  // namespace
}  // namespace cairn::bag
