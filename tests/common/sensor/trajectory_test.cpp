#include "common/sensor/trajectory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/temp_directory.h"

namespace cairn {
namespace {

using testing::HasSubstr;

TEST(Tum, WritesStampsWithNineDecimalsAndTheHeadingAsAQuaternion) {
  const TempDirectory directory;
  ASSERT_TRUE(WriteTum({{1'134'864'630'032'484'123, {1.5, -2.25, kPi}}}, directory / "t.tum"));
  EXPECT_EQ(directory.Read("t.tum"),
            "1134864630.032484123 1.500000000 -2.250000000 0 0 0 1.000000000000 0.000000000000\n");
}

TEST(Tum, RoundTrips) {
  const TempDirectory directory;
  Trajectory trajectory;
  for (int i = 0; i < 100; ++i) {
    trajectory.push_back({1'700'000'000'000'000'000 + i * 123'456'789LL, {i * 0.7, -i * 1e-3, WrapAngle(i * 0.37)}});
  }
  ASSERT_TRUE(WriteTum(trajectory, directory / "t.tum"));
  const auto read = ReadTum(directory / "t.tum");
  ASSERT_TRUE(read);
  ASSERT_EQ(read->size(), trajectory.size());
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    EXPECT_EQ((*read)[i].stamp, trajectory[i].stamp);
    EXPECT_NEAR((*read)[i].T_map_robot.x, trajectory[i].T_map_robot.x, 1e-9);
    EXPECT_NEAR((*read)[i].T_map_robot.y, trajectory[i].T_map_robot.y, 1e-9);
    EXPECT_NEAR(std::abs(AngleDiff((*read)[i].T_map_robot.theta, trajectory[i].T_map_robot.theta)), 0.0, 1e-11);
  }
}

TEST(Tum, EmptyTrajectoriesAreFiles) {
  const TempDirectory directory;
  ASSERT_TRUE(WriteTum({}, directory / "t.tum"));
  const auto read = ReadTum(directory / "t.tum");
  ASSERT_TRUE(read);
  EXPECT_TRUE(read->empty());
}

TEST(Tum, ReplacesTheOldFileAndLeavesNothingElse) {
  const TempDirectory directory;
  ASSERT_TRUE(WriteTum({{1, {}}, {2, {}}}, directory / "t.tum"));
  ASSERT_TRUE(WriteTum({{3, {}}}, directory / "t.tum"));
  EXPECT_EQ(ReadTum(directory / "t.tum")->size(), 1u);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory.path()), {}), 1);
}

TEST(Tum, RefusesPosesThatAreNone) {
  const TempDirectory directory;
  EXPECT_FALSE(WriteTum({{1, {std::numeric_limits<double>::quiet_NaN(), 0, 0}}}, directory / "t.tum"));
  EXPECT_FALSE(WriteTum({{2, {}}, {2, {}}}, directory / "t.tum"));
  EXPECT_FALSE(std::filesystem::exists(directory / "t.tum"));
}

TEST(Tum, SaysWhereItCannotWrite) {
  const auto result = WriteTum({}, "/nonexistent/t.tum");
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("/nonexistent/t.tum"));
}

TEST(Tum, CommentsAndBlankLinesAreSkipped) {
  const TempDirectory directory;
  const auto read = ReadTum(directory.Write("t.tum", "# stamp tx ty tz qx qy qz qw\n\n1.5 1 2 0 0 0 0 1\r\n"));
  ASSERT_TRUE(read);
  ASSERT_EQ(read->size(), 1u);
  EXPECT_EQ((*read)[0].stamp, 1'500'000'000);
}

struct BadTum {
  const char* name;
  const char* line;
  const char* reason;
};
class BadTumLine : public testing::TestWithParam<BadTum> {};

TEST_P(BadTumLine, IsRefusedWithItsNumber) {
  const TempDirectory directory;
  const auto read = ReadTum(directory.Write("t.tum", std::string("1 0 0 0 0 0 0 1\n") + GetParam().line + "\n"));
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().message, HasSubstr(":2: "));
  EXPECT_THAT(read.error().message, HasSubstr(GetParam().reason));
}

INSTANTIATE_TEST_SUITE_P(Lines, BadTumLine,
                         testing::Values(BadTum{"Short", "2 0 0 0 0 0 0", "qw is missing"},
                                         BadTum{"Long", "2 0 0 0 0 0 0 1 5", "more fields"},
                                         BadTum{"Nan", "2 nan 0 0 0 0 0 1", "tx is not valid"},
                                         BadTum{"ZeroQuaternion", "2 0 0 0 0 0 0 0", "unit length"},
                                         BadTum{"StampBack", "0.5 0 0 0 0 0 0 1", "not after"},
                                         BadTum{"StampTwice", "1 0 0 0 0 0 0 1", "not after"},
                                         BadTum{"Words", "two poses", "stamp is not valid"}),
                         [](const auto& fault) { return std::string(fault.param.name); });

TEST(Tum, AMissingFileIsAnError) {
  EXPECT_EQ(ReadTum("/nonexistent.tum").error().code, StatusCode::kNotFound);
}

}  // namespace
}  // namespace cairn
