#include "server/robots/scan_merge.h"

#include <gtest/gtest.h>

#include <limits>
#include <memory>

namespace cairn::server {
namespace {

using std::chrono::milliseconds;

constexpr NameId kFront = 1, kBack = 2;

class TwoLidars : public ::testing::Test {
 protected:
  static Stamp At(int ms) { return static_cast<Stamp>(ms) * 1'000'000; }
  std::vector<Stamp> Add(NameId sensor, Stamp stamp) {
    auto scan = std::make_shared<Scan>();
    scan->stamp = stamp;
    ScanArrival arrival;
    arrival.stream.sensor_id = sensor;
    arrival.scan = std::move(scan);
    return StampsOf(merge_.Add(std::move(arrival), now_));
  }
  static std::vector<Stamp> StampsOf(const std::vector<ScanArrival>& scans) {
    std::vector<Stamp> stamps;
    for (const ScanArrival& scan : scans) stamps.push_back(scan.scan->stamp);
    return stamps;
  }

  ScanMerge merge_;
  ScanMerge::Clock::time_point now_ = ScanMerge::Clock::time_point() + std::chrono::hours(1);
};

TEST_F(TwoLidars, ASingleOneIsNotDelayed) {
  for (const int ms : {0, 100, 50, 200}) EXPECT_EQ(Add(kFront, At(ms)), (std::vector<Stamp>{At(ms)}));
}

// The driver of the second one delivers 60 ms late, so that every scan of it is older than the last of the first.
TEST_F(TwoLidars, ScansOfOneThatIsAlwaysLateFindTheirPlace) {
  std::vector<Stamp> all;
  const auto note = [&all](const std::vector<Stamp>& passed) { all.insert(all.end(), passed.begin(), passed.end()); };
  for (int i = 0; i < 50; ++i) {
    note(Add(kFront, At(100 * i)));
    now_ += milliseconds(50);
    note(Add(kBack, At(100 * i - 10)));
    now_ += milliseconds(50);
  }
  note(StampsOf(merge_.TakeAll()));
  // Before the second one has sent anything, nobody waits for it.
  ASSERT_EQ(all.size(), 100U);
  for (std::size_t i = 2; i < all.size(); ++i) EXPECT_LT(all[i - 1], all[i]) << i;
}

TEST_F(TwoLidars, OneThatHasStoppedIsWaitedForOnlySoLong) {
  static_cast<void>(Add(kFront, At(0)));
  static_cast<void>(Add(kBack, At(10)));
  EXPECT_EQ(Add(kFront, At(100)), (std::vector<Stamp>{At(10)}));
  now_ += milliseconds(150);
  EXPECT_TRUE(merge_.TakeDue(now_).empty());
  now_ += milliseconds(50);
  EXPECT_EQ(StampsOf(merge_.TakeDue(now_)), (std::vector<Stamp>{At(100)}));
  now_ += std::chrono::seconds(1);
  EXPECT_EQ(Add(kFront, At(1300)), (std::vector<Stamp>{At(1300)}));
}

TEST_F(TwoLidars, ScansOfOneMomentAreBothUsed) {
  static_cast<void>(Add(kFront, At(0)));
  EXPECT_EQ(Add(kBack, At(0)), (std::vector<Stamp>{At(0) + 1000}));
  EXPECT_TRUE(Add(kFront, At(100)).empty());
  EXPECT_EQ(Add(kBack, At(100)), (std::vector<Stamp>{At(100), At(100) + 1000}));
  // The same scan twice is not two.
  static_cast<void>(Add(kBack, At(200)));
  EXPECT_TRUE(Add(kBack, At(200)).empty());
  EXPECT_EQ(StampsOf(merge_.TakeAll()), (std::vector<Stamp>{At(200), At(200)}));
}

// As cameras and lidars that are triggered together.
TEST_F(TwoLidars, FourScansOfOneMomentAreAllUsed) {
  for (const NameId sensor : {1, 2, 3, 4}) static_cast<void>(Add(sensor, At(0)));
  for (const NameId sensor : {3, 1, 4}) EXPECT_TRUE(Add(sensor, At(100)).empty());
  EXPECT_EQ(Add(2, At(100)), (std::vector<Stamp>{At(100), At(100) + 1000, At(100) + 2000, At(100) + 3000}));
}

TEST_F(TwoLidars, ABrokenClockHoldsNothingBackForLong) {
  constexpr Stamp kEnd = std::numeric_limits<Stamp>::max();
  static_cast<void>(Add(kFront, kEnd));
  EXPECT_EQ(Add(kBack, kEnd), (std::vector<Stamp>{kEnd}));
  static_cast<void>(Add(kFront, std::numeric_limits<Stamp>::min()));
  EXPECT_TRUE(Add(kBack, At(0)).empty());
  now_ += ScanMerge::kPatience;
  EXPECT_EQ(merge_.TakeDue(now_).size(), 1U);
}

TEST_F(TwoLidars, NotMoreThanSomeAreHeld) {
  static_cast<void>(Add(kBack, At(0)));
  std::size_t passed = 0;
  for (int i = 1; i <= 100; ++i) passed += Add(kFront, At(i)).size();
  EXPECT_EQ(passed, 100U - ScanMerge::kMostHeld);
  EXPECT_EQ(merge_.TakeAll().size(), ScanMerge::kMostHeld);
}

// Its odometry comes on a topic of its own, and a client that sends what it has kept may be seconds ahead with its
// scans.
class FirstScans : public TwoLidars {
 protected:
  FirstScans() { merge_ = ScanMerge(std::chrono::seconds(2), 4); }
};

TEST_F(FirstScans, WaitForTheFirstOdometry) {
  for (const int ms : {0, 1000, 2000}) EXPECT_TRUE(Add(kFront, At(ms)).empty());
  merge_.OdometryCame();
  EXPECT_EQ(StampsOf(merge_.TakeDue(now_)), (std::vector<Stamp>{At(0), At(1000), At(2000)}));
  EXPECT_EQ(Add(kFront, At(3000)), (std::vector<Stamp>{At(3000)}));
}

TEST_F(FirstScans, PassWhereNoOdometryComes) {
  EXPECT_TRUE(Add(kFront, At(0)).empty());
  now_ += milliseconds(1999);
  EXPECT_TRUE(Add(kFront, At(100)).empty());
  now_ += milliseconds(1);
  EXPECT_EQ(StampsOf(merge_.TakeDue(now_)), (std::vector<Stamp>{At(0), At(100)}));
  EXPECT_EQ(Add(kFront, At(200)), (std::vector<Stamp>{At(200)}));
}

TEST_F(FirstScans, WaitOnlyAsLongAsThereIsRoomForThem) {
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(Add(kFront, At(i)).empty());
  EXPECT_EQ(Add(kFront, At(3)).size(), 4U);
}

TEST_F(FirstScans, PassWhenNothingMoreWillCome) {
  EXPECT_TRUE(Add(kFront, At(0)).empty());
  EXPECT_EQ(StampsOf(merge_.TakeAll()), (std::vector<Stamp>{At(0)}));
}

}  // namespace
}  // namespace cairn::server
