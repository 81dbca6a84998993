#include "common/wire/convert.h"

#include <gtest/gtest.h>

#include "common/wire/bounds.h"
#include "common/wire/limits.h"
#include "tests/common/wire/sample_values.h"

namespace cairn::wire {
namespace {

template <typename Value>
void ExpectRoundTrip(const Value& value) {
  auto wire = ToWire(value);
  const Result<void> bounds = CheckBounds(wire);
  ASSERT_TRUE(bounds) << bounds.error().message;
  EXPECT_TRUE(Same(FromWire(std::move(wire)), value));
}

TEST(Convert, KeepsEveryFieldOfASessionRequest) {
  ExpectRoundTrip(ExtremeSessionRequest());
}
TEST(Convert, KeepsEveryFieldOfASessionState) {
  ExpectRoundTrip(ExtremeSessionState());
}
TEST(Convert, KeepsEveryFieldOfARefusal) {
  ExpectRoundTrip(ExtremeSessionRefusal());
}
TEST(Convert, KeepsEveryFieldOfAScan) {
  ExpectRoundTrip(ExtremeScan(1081));
}
TEST(Convert, KeepsScansWithoutBeamsAndWithTooManyForTheServerToJudge) {
  ExpectRoundTrip(ExtremeScan(0));
  ExpectRoundTrip(ExtremeScan(kMaxBeams + 1));
  ExpectRoundTrip(ExtremeScan(kMaxRangesRead));
}
TEST(Convert, KeepsEveryFieldOfOdometry) {
  ExpectRoundTrip(ExtremeOdometry());
}
TEST(Convert, KeepsEveryFieldOfAPoseReport) {
  ExpectRoundTrip(ExtremePose());
}
TEST(Convert, KeepsEveryFieldOfALedger) {
  ExpectRoundTrip(ExtremeLedger());
}
TEST(Convert, KeepsEveryFieldOfMapInfo) {
  ExpectRoundTrip(ExtremeMapInfo());
}
TEST(Convert, KeepsEveryFieldOfATile) {
  ExpectRoundTrip(ExtremeTile(kMaxTileBytes));
}
TEST(Convert, KeepsEveryFieldOfAJob) {
  ExpectRoundTrip(ExtremeJob());
}
TEST(Convert, KeepsEveryFieldOfARequest) {
  ExpectRoundTrip(ExtremeRequest());
}
TEST(Convert, KeepsEveryFieldOfAReply) {
  ExpectRoundTrip(ExtremeReply());
}

TEST(Convert, ReadsLedgersOfServersWithFewerOrMoreDropReasons) {
  v1::Ledger wire = ToWire(ExtremeLedger());
  wire.dropped({5});
  EXPECT_EQ(FromWire(v1::Ledger(wire)).dropped_total(), 5U);
  wire.dropped(std::vector<std::uint64_t>(kDropReasonCount + 3, 1));
  EXPECT_EQ(FromWire(v1::Ledger(wire)).dropped_total(), static_cast<std::uint64_t>(kDropReasonCount));
}

TEST(Convert, NumbersOfTheIdlEnumsAreThoseOfTheValues) {
  EXPECT_EQ(static_cast<int>(v1::SESSION_SUSPENDED), static_cast<int>(SessionPhase::kSuspended));
  EXPECT_EQ(static_cast<int>(v1::POSE_NOT_JOINED), static_cast<int>(PoseReason::kNotJoined));
  EXPECT_EQ(static_cast<int>(v1::DROP_SESSION_ENDED), static_cast<int>(DropReason::kSessionEnded));
  EXPECT_EQ(static_cast<int>(v1::DROP_SESSION_FULL), static_cast<int>(DropReason::kSessionFull));
  EXPECT_EQ(static_cast<int>(v1::DROP_SESSION_FULL) + 1, kDropReasonCount);
  EXPECT_EQ(static_cast<int>(v1::TILE_PNG), static_cast<int>(TileEncoding::kPng));
  EXPECT_EQ(static_cast<int>(v1::JOB_RELOCALISE), static_cast<int>(JobKind::kRelocalise));
  EXPECT_EQ(static_cast<int>(v1::JOB_CANCELLED), static_cast<int>(JobState::kCancelled));
  EXPECT_EQ(static_cast<int>(v1::REQUEST_SESSION_END), static_cast<int>(RequestKind::kSessionEnd));
  EXPECT_EQ(static_cast<int>(v1::REQUEST_MAP_EDIT_REMOVE) + 1, kRequestKindCount);
}

// The number idl/README.md gives to writers of other clients.
TEST(Convert, NamesHashAsTheReadmeSays) {
  EXPECT_EQ(HashName("laser"), 13259333891047362604ULL);
}

TEST(Convert, TilesBeyondTheKeysBitsDoNotFit) {
  EXPECT_TRUE(FitsTileKey({0, -32768, 32767}));
  EXPECT_FALSE(FitsTileKey({0, -32769, 0}));
  EXPECT_FALSE(FitsTileKey({0, 0, 32768}));
  EXPECT_FALSE(FitsTileKey({-1, 0, 0}));
}

}  // namespace
}  // namespace cairn::wire
