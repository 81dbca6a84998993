// Garbled and truncated logs: each bad line is named and skipped, the rest is read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/sensor/log_fields.h"
#include "tests/common/sensor/read_log.h"

namespace cairn {
namespace {

using testing::HasSubstr;

struct BadLine {
  const char* name;
  const char* line;
  const char* reason;
};

class BadLogLine : public testing::TestWithParam<BadLine> {};

TEST_P(BadLogLine, IsNamedAndSkipped) {
  const std::string good = "ODOM 1 2 0.5 0 0 0 5.0 h 0\n", also_good = "ODOM 1 2 0.5 0 0 0 6.0 h 0\n";
  const auto log = ReadText(good + GetParam().line + "\n" + also_good);
  EXPECT_EQ(log.odometries.size(), 2u);
  EXPECT_TRUE(log.scans.empty());
  ASSERT_EQ(log.summary.complaint_count, 1);
  EXPECT_EQ(log.summary.complaints[0].line, 2);
  EXPECT_THAT(log.summary.complaints[0].reason, HasSubstr(GetParam().reason));
}

INSTANTIATE_TEST_SUITE_P(
    Lines, BadLogLine,
    testing::Values(BadLine{"NoCount", "FLASER", "number of readings is missing"},
                    BadLine{"NegativeCount", "FLASER -3 1 2 3 0 0 0 0 0 0 1 h 0", "number of readings is not valid"},
                    BadLine{"ZeroCount", "FLASER 0 0 0 0 0 0 0 1 h 0", "number of readings is not valid: '0'"},
                    BadLine{"NanCount", "FLASER nan 1 2 0 0 0 0 0 0 1 h 0", "number of readings is not valid: 'nan'"},
                    BadLine{"FractionalCount", "FLASER 2.5 1 2 0 0 0 0 0 0 1 h 0", "number of readings"},
                    BadLine{"HugeCount", "FLASER 2000000000 1 2 0 0 0 0 0 0 1 h 0", "number of readings"},
                    BadLine{"CountBeyondInt", "FLASER 99999999999999999999 1 2", "number of readings"},
                    BadLine{"JustTooManyReadings", "FLASER 100001 1 2", "number of readings"},
                    BadLine{"TruncatedInRanges", "FLASER 4 1.0 2.0", "a range is missing"},
                    BadLine{"TruncatedInPoses", "FLASER 2 1.0 2.0 0 0 0 0", "robot y is missing"},
                    BadLine{"TruncatedBeforeStamp", "FLASER 2 1.0 2.0 0 0 0 0 0 0", "stamp is missing"},
                    BadLine{"TruncatedBeforeHost", "FLASER 2 1.0 2.0 0 0 0 0 0 0 1.5", "host name is missing"},
                    BadLine{"GarbledRange", "FLASER 2 1.0 2.x 0 0 0 0 0 0 1.5 h 0", "a range is not valid: '2.x'"},
                    BadLine{"NanPose", "FLASER 2 1.0 2.0 0 0 0 nan 0 0 1.5 h 0", "robot x is not valid: 'nan'"},
                    BadLine{"InfinitePose", "ODOM inf 2 0.5 0 0 0 5.5 h 0", "robot x"},
                    BadLine{"HugeHeading", "ODOM 1 2 1e300 0 0 0 5.5 h 0", "robot theta"},
                    BadLine{"NanStamp", "ODOM 1 2 0 0 0 0 nan h 0", "stamp is not valid: 'nan'"},
                    BadLine{"StampBeyondInt64", "ODOM 1 2 0 0 0 0 99999999999 h 0", "stamp is not valid"},
                    BadLine{"OneFieldTooMany", "ODOM 1 2 0 0 0 0 5.5 h 0 0", "more fields"},
                    BadLine{"TwoMessagesOnALine", "ODOM 1 2 0 0 0 0 5.5 h 0ODOM 1 2 0 0 0 0 5.6 h 0", "logger stamp"},
                    BadLine{"RemissionsMissing", "ROBOTLASER1 0 0 1 1 30 0 0 2 1 2 5 1 1", "a range is missing"},
                    BadLine{"HugeRemissions", "RAWLASER1 0 0 1 1 30 0 0 2 1 2 4000000000 1", "number of remissions"},
                    BadLine{"NanStep", "RAWLASER1 0 0 1 nan 30 0 0 2 1 2 0 1 h 1", "angular resolution"},
                    BadLine{"Unknown", "hello world", "unknown message 'hello'"},
                    BadLine{"Binary", "\x01\xff\x80\x7f", "unknown message '?"},
                    BadLine{"DpslamInCarmen", "Odometry 1 2 3", "DP-SLAM message in a CARMEN log"}),
    [](const auto& fault) { return std::string(fault.param.name); });

TEST(BadLog, AMissingFileIsAnError) {
  const auto result = ReadLog("/nonexistent/log.clf", {}, [](LogRecord&&) { return true; });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, StatusCode::kNotFound);
  EXPECT_THAT(result.error().message, HasSubstr("/nonexistent/log.clf"));
}

TEST(BadLog, ADirectoryIsAnError) {
  const TempDirectory directory;
  EXPECT_FALSE(ReadLog(directory.path(), {}, [](LogRecord&&) { return true; }));
}

TEST(BadLog, OtherFilesAreNoRobotLogs) {
  const TempDirectory directory;
  for (const std::string& text : {std::string(), std::string("\n\n\n"), std::string("Dear diary,\ntoday\n"),
                                  std::string("#!CARMEN\nPARAM a b\n"), std::string(300'000, '\0')}) {
    const auto result = ReadLog(directory.Write("file", text), {}, [](LogRecord&&) { return true; });
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, StatusCode::kInvalidArgument);
    EXPECT_THAT(result.error().message, HasSubstr("not a robot log"));
  }
}

TEST(BadLog, ALogWhoseOnlyMessageIsTruncatedIsStillALog) {
  const auto log = ReadText("FLASER 180 1.0 1.1");
  EXPECT_EQ(log.summary.scans, 0);
  EXPECT_EQ(log.summary.complaint_count, 1);
}

TEST(BadLog, AnEndlessLineIsSkippedInBoundedMemory) {
  const std::string good = "ODOM 1 2 0.5 0 0 0 5.0 h 0\n";
  const std::string endless(LogLines::kMaxLength + 1'000'000, '7');
  const auto log = ReadText(good + endless + "\nODOM 1 2 0.5 0 0 0 6.0 h 0\n");
  EXPECT_EQ(log.odometries.size(), 2u);
  ASSERT_EQ(log.summary.complaint_count, 1);
  EXPECT_EQ(log.summary.complaints[0].line, 2);
  EXPECT_THAT(log.summary.complaints[0].reason, HasSubstr("line longer than"));
}

TEST(BadLog, AllComplaintsAreCountedAndTheFirstHundredKept) {
  std::string text = "ODOM 1 2 0.5 0 0 0 5.0 h 0\n";
  for (int i = 0; i < 250; ++i) text += "FLASER x\n";
  const auto log = ReadText(text);
  EXPECT_EQ(log.summary.complaint_count, 250);
  EXPECT_EQ(log.summary.complaints.size(), 100u);
}

}  // namespace
}  // namespace cairn
