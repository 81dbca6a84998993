#include "server/robots/checkpoint_pace.h"

#include <gtest/gtest.h>

namespace cairn::server {
namespace {

using std::chrono::milliseconds;

constexpr CheckpointPace::Limits kLimits{.entries = 100, .work = milliseconds(80)};

TEST(CheckpointPace, IsDueAfterSoManyEntries) {
  CheckpointPace pace(kLimits);
  EXPECT_FALSE(pace.IsDue(99));
  EXPECT_TRUE(pace.IsDue(100));
  pace.Begun(100);
  EXPECT_FALSE(pace.IsDue(199));
  EXPECT_TRUE(pace.IsDue(200));
}

TEST(CheckpointPace, IsDueAfterSoMuchWork) {
  CheckpointPace pace(kLimits);
  pace.Worked(milliseconds(79));
  EXPECT_FALSE(pace.IsDue(5));
  pace.Worked(milliseconds(1));
  EXPECT_TRUE(pace.IsDue(5));
  pace.Begun(5);
  pace.Worked(milliseconds(79));
  EXPECT_FALSE(pace.IsDue(10));
}

TEST(CheckpointPace, IsOverdueWhereNoneCanBeMadeForVeryLong) {
  CheckpointPace pace(kLimits);
  EXPECT_FALSE(pace.IsOverdue(5000)) << "nobody has tried";
  for (int i = 0; i < 100; ++i) pace.Refused();
  EXPECT_FALSE(pace.IsOverdue(4999));
  EXPECT_TRUE(pace.IsOverdue(5000));
  pace.Begun(5000);
  EXPECT_FALSE(pace.IsOverdue(20000));
}

TEST(CheckpointPace, IsNotDueWhereNothingIsNew) {
  CheckpointPace pace(kLimits);
  pace.Begun(5);
  pace.Worked(milliseconds(1000));
  EXPECT_FALSE(pace.IsDue(5));
}

// The server that was killed would otherwise repeat the same again after the next kill.
TEST(CheckpointPace, WhatARestartHasRepeatedCountsAsWork) {
  CheckpointPace pace(kLimits);
  pace.Worked(milliseconds(80));
  pace.RestoredFrom(40);
  EXPECT_TRUE(pace.IsDue(60));
}

// One that is killed soon after every start would otherwise never reach the work after which a checkpoint is due, and
// repeat more at each start.
TEST(CheckpointPace, IsDueSoonAfterARestartThatHasRepeatedMoreThanLittle) {
  CheckpointPace little(kLimits), more(kLimits);
  little.Worked(milliseconds(19));
  little.RestoredFrom(40);
  more.Worked(milliseconds(20));
  more.RestoredFrom(40);
  EXPECT_FALSE(little.IsDue(41));
  EXPECT_TRUE(more.IsDue(41));
}

TEST(CheckpointPace, CheckpointsTakeATwentiethOfTheTime) {
  CheckpointPace pace(kLimits);
  *pace.cost() = CheckpointPace::Time(milliseconds(10)).count();
  pace.Worked(milliseconds(199));
  EXPECT_FALSE(pace.IsDue(5));
  pace.Worked(milliseconds(1));
  EXPECT_TRUE(pace.IsDue(5));
  EXPECT_TRUE(CheckpointPace(kLimits).IsDue(100)) << "entries bound it whatever it costs";
}

TEST(CheckpointPace, IsNotTriedAgainAtOnce) {
  CheckpointPace pace(kLimits);
  pace.Worked(milliseconds(80));
  pace.Refused();
  EXPECT_FALSE(pace.IsDue(5));
  EXPECT_FALSE(pace.IsDue(100));
  pace.Worked(milliseconds(10));
  EXPECT_TRUE(pace.IsDue(5));
}

}  // namespace
}  // namespace cairn::server
