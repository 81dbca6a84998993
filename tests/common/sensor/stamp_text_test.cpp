#include <gtest/gtest.h>

#include <limits>

#include "common/sensor/stamp.h"

namespace cairn {
namespace {

TEST(StampText, KeepsEveryNanosecond) {
  // As a double this stamp would be off by up to 119 ns.
  EXPECT_EQ(ParseStamp("1134864630.032484123"), 1134864630032484123);
  EXPECT_EQ(ParseStamp("976052857.337530"), 976052857337530000);
}

TEST(StampText, TakesWholeAndShortFractions) {
  EXPECT_EQ(ParseStamp("0"), 0);
  EXPECT_EQ(ParseStamp("17"), 17'000'000'000);
  EXPECT_EQ(ParseStamp(".5"), 500'000'000);
  EXPECT_EQ(ParseStamp("2."), 2'000'000'000);
  EXPECT_EQ(ParseStamp("-1.25"), -1'250'000'000);
}

TEST(StampText, RoundsTheTenthDecimal) {
  EXPECT_EQ(ParseStamp("1.0000000004"), 1'000'000'000);
  EXPECT_EQ(ParseStamp("1.0000000005"), 1'000'000'001);
  EXPECT_EQ(ParseStamp("1.9999999999999"), 2'000'000'000);
}

TEST(StampText, RefusesOtherText) {
  for (const char* text : {"", ".", "-", "-.", "1e9", "nan", "inf", "1.2.3", " 1", "1 ", "+1", "0x10", "1,5"}) {
    EXPECT_FALSE(ParseStamp(text)) << text;
  }
}

TEST(StampText, RefusesWhatInt64CannotHold) {
  EXPECT_EQ(ParseStamp("9223372036.854775807"), std::numeric_limits<Stamp>::max());
  for (const char* text : {"9223372036.854775808", "9223372036.8547758079", "9223372037", "18446744073.709551617",
                           "99999999999999999999999"}) {
    EXPECT_FALSE(ParseStamp(text)) << text;
  }
}

TEST(StampText, FormatsWithNineDecimals) {
  EXPECT_EQ(FormatStamp(0), "0.000000000");
  EXPECT_EQ(FormatStamp(1), "0.000000001");
  EXPECT_EQ(FormatStamp(-1), "-0.000000001");
  EXPECT_EQ(FormatStamp(1134864630032484123), "1134864630.032484123");
  EXPECT_EQ(FormatStamp(std::numeric_limits<Stamp>::min()), "-9223372036.854775808");
}

TEST(StampText, RoundTrips) {
  for (const Stamp stamp : {Stamp{0}, Stamp{-1}, Stamp{999'999'999}, Stamp{1'700'000'000'123'456'789},
                            Stamp{-1'500'000'000}, std::numeric_limits<Stamp>::max()}) {
    EXPECT_EQ(ParseStamp(FormatStamp(stamp)), stamp);
  }
}

}  // namespace
}  // namespace cairn
