#include "common/map/map_lines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/temp_directory.h"

namespace cairn {
namespace {

const MapLine kLong{{0.1, -1.0 / 3.0}, {12345.678901234, 2e-7}}, kShort{{1, 1}, {1, 2}};

TEST(MapLines, ReadBackToTheSameNumbers) {
  const TempDirectory directory;
  const std::vector<MapLine> lines{kLong, kShort};
  ASSERT_TRUE(WriteMapLines(lines, directory / "lines.txt"));
  const auto read = ReadMapLines(directory / "lines.txt");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(*read, lines);
}

TEST(MapLines, AWallIsSeenFromBothSides) {
  const auto read = ParseMapLines("# drawn by hand\ncairn-map-lines 1\n\n wall 1 1 1 2  # by the door\r\n", "plan");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_THAT(*read, testing::ElementsAre(kShort, MapLine{kShort.b, kShort.a}));
}

TEST(MapLines, ErrorsNameTheLineAndWhatIsWrong) {
  const auto complaint = [](const std::string& text) {
    const auto read = ParseMapLines(text, "plan");
    return read ? std::string("read") : read.error().message;
  };
  const std::string header = "cairn-map-lines 1\n";
  EXPECT_EQ(complaint("side 1 1 1 2\n"), "plan:1: the first statement must be `cairn-map-lines 1`");
  EXPECT_EQ(complaint("cairn-map-lines 2\n"), "plan:1: the first statement must be `cairn-map-lines 1`");
  EXPECT_EQ(complaint(header + "door 1 1 1 2\n"), "plan:2: neither `wall` nor `side`: 'door'");
  EXPECT_EQ(complaint(header + "\nside 1 1 x 2\n"), "plan:3: BX is not valid: 'x'");
  EXPECT_EQ(complaint(header + "side 1 1 nan 2\n"), "plan:2: BX is not valid: 'nan'");
  EXPECT_EQ(complaint(header + "side 1 1 2\n"), "plan:2: BY is missing");
  EXPECT_EQ(complaint(header + "side 1 1 1 2 3\n"), "plan:2: more fields than the message has: '3'");
  EXPECT_EQ(complaint(header + "side 1 1 1 1\n"), "plan:2: a line is at least a millimetre long and within 1000 km");
  EXPECT_EQ(complaint(header + "side 1 1 1e9 1\n"), "plan:2: a line is at least a millimetre long and within 1000 km");
  EXPECT_EQ(complaint(header), "plan: no lines");
  EXPECT_EQ(complaint(""), "plan: empty; the first statement must be `cairn-map-lines 1`");
  std::string many = header;
  for (int k = 0; k < 10001; ++k) many += "wall 1 1 1 2\n";
  EXPECT_EQ(complaint(many), "plan:10002: more than 20000 lines (a wall is two)");
  EXPECT_EQ(complaint(std::string("\0\xff\n", 3)), "plan:1: the first statement must be `cairn-map-lines 1`");
}

TEST(MapLines, AByteOrderMarkIsNoPartOfTheHeader) {
  EXPECT_TRUE(
      ParseMapLines("\xEF\xBB\xBF"
                    "cairn-map-lines 1\nside 1 1 1 2\n",
                    "plan"));
}

TEST(MapLines, AHugeFileIsRefused) {
  const TempDirectory directory;
  const auto read = ReadMapLines(directory.Write("huge", std::string(5u << 20, '#')));
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, StatusCode::kResourceExhausted);
}

TEST(MapLines, AMissingFileIsNotFound) {
  EXPECT_EQ(ReadMapLines("/nowhere/lines.txt").error().code, StatusCode::kNotFound);
}

TEST(MapLines, WhatIsNoLineIsNotWritten) {
  const TempDirectory directory;
  EXPECT_FALSE(WriteMapLines({}, directory / "lines.txt"));
  EXPECT_FALSE(WriteMapLines({{{0, 0}, {0, 0}}}, directory / "lines.txt"));
  EXPECT_FALSE(WriteMapLines({{{0, 0}, {0, NAN}}}, directory / "lines.txt"));
}

TEST(MapLines, NearIsHowFarTheNearestPointOfALineIs) {
  const std::vector<MapLine> map{kLong, kShort};
  EXPECT_THAT(LinesNear(map, {3, 1.5}, 2.1), testing::ElementsAre(kLong, kShort));
  EXPECT_THAT(LinesNear(map, {3, 1.5}, 1.95), testing::ElementsAre(kLong));
  EXPECT_THAT(LinesNear(map, {-1, 4}, 3.0), testing::ElementsAre(kShort));
  EXPECT_TRUE(LinesNear(map, {-20, 0}, 10.0).empty());
}

}  // namespace
}  // namespace cairn
