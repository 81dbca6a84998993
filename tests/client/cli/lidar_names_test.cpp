#include "client/cli/lidar_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::client {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::ResultOf;

TEST(LidarNames, AreThoseOfTheTopics) {
  EXPECT_THAT(LidarNames({"/front/scan", "/rear/scan", "/scan"}), ElementsAre("front.scan", "rear.scan", "scan"));
  EXPECT_THAT(LidarNames({"/robots/r1/scan/front", "/robots/r1/scan/rear"}), ElementsAre("front", "rear"));
}

TEST(LidarNames, AreValidAndDifferWhateverTheTopics) {
  const std::vector<std::string> names =
      LidarNames({"/a b", "", "/", "/x/" + std::string(100, 'l'), "/x/" + std::string(101, 'l'), "/a/b", "/a.b"});
  EXPECT_THAT(names,
              Each(ResultOf([](const std::string& name) { return ValidateName("a sensor", name).has_value(); }, true)));
  for (std::size_t i = 0; i < names.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) EXPECT_NE(names[i], names[k]);
}

}  // namespace
}  // namespace cairn::client
