#include "common/bag/scan_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace cairn::bag {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr Stamp kMillisecond = 1'000'000;

class ScansOfLidars : public ::testing::Test {
 protected:
  // "a" is the first lidar; the number is the stamp in milliseconds.
  bool Add(ScanOrder& order, std::size_t lidar, Stamp milliseconds) const {
    Scan scan;
    scan.stamp = milliseconds * kMillisecond;
    return order.Add(std::move(scan), lidar);
  }
  ScanOrder::Sink Keep() {
    return [this](Scan&& scan, std::size_t lidar) {
      stamps_.push_back(scan.stamp);
      passed_.push_back(static_cast<char>('a' + lidar) + std::to_string(scan.stamp / kMillisecond));
      return true;
    };
  }

  std::vector<Stamp> stamps_;
  std::vector<std::string> passed_;
};

TEST_F(ScansOfLidars, OfOnePassAtOnceAsTheyAre) {
  ScanOrder order(1, Keep());
  for (const Stamp stamp : {5, 5, 3, 4'000}) EXPECT_TRUE(Add(order, 0, stamp));
  EXPECT_THAT(passed_, ElementsAre("a5", "a5", "a3", "a4000"));
}

TEST_F(ScansOfLidars, WaitForTheOther) {
  ScanOrder order(2, Keep());
  Add(order, 0, 100);
  Add(order, 0, 200);
  EXPECT_THAT(passed_, IsEmpty());
  Add(order, 1, 90);
  EXPECT_THAT(passed_, ElementsAre("b90"));
  Add(order, 1, 150);
  EXPECT_THAT(passed_, ElementsAre("b90", "a100", "b150"));
  order.Finish();
  EXPECT_THAT(passed_, ElementsAre("b90", "a100", "b150", "a200"));
}

TEST_F(ScansOfLidars, OfOneMomentAreApart) {
  ScanOrder order(3, Keep());
  for (const std::size_t lidar : {0, 1, 2}) Add(order, lidar, 7);
  order.Finish();
  EXPECT_THAT(stamps_, ElementsAre(7'000'000, 7'001'000, 7'002'000));
}

TEST_F(ScansOfLidars, DoNotWaitForOneThatSendsNoMore) {
  ScanOrder order(2, Keep());
  Add(order, 1, 0);
  for (Stamp stamp = 100; stamp <= 1'500; stamp += 100) Add(order, 0, stamp);
  EXPECT_THAT(passed_, SizeIs(16)) << "more than a second later";
}

TEST_F(ScansOfLidars, AreBoundedAndSurviveAnyStamps) {
  ScanOrder order(2, Keep());
  for (Stamp stamp = 0; stamp < 200; ++stamp) Add(order, 0, stamp);
  EXPECT_THAT(passed_, SizeIs(200 - ScanOrder::kMostHeld));
  Scan scan;
  for (const Stamp stamp : {std::numeric_limits<Stamp>::min(), std::numeric_limits<Stamp>::max(), Stamp{0}})
    for (const std::size_t lidar : {1, 0}) {
      scan.stamp = stamp;
      EXPECT_TRUE(order.Add(Scan(scan), lidar));
    }
  order.Finish();
  EXPECT_THAT(passed_, SizeIs(206)) << "after the clock was set back, too";
}

TEST_F(ScansOfLidars, StopWhereNoMoreIsWanted) {
  int passed = 0;
  ScanOrder order(1, [&](Scan&&, std::size_t) { return ++passed < 2; });
  EXPECT_TRUE(Add(order, 0, 1));
  EXPECT_FALSE(Add(order, 0, 2));
  EXPECT_FALSE(order.Finish());
  EXPECT_EQ(passed, 2);
}

}  // namespace
}  // namespace cairn::bag
