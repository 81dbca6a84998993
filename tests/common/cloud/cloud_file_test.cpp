#include "common/cloud/cloud_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/temp_directory.h"

namespace cairn {
namespace {

using ::testing::HasSubstr;

const PointCloud kCloud = {{1.5F, -2.25F, 0.1F}, {1e-7F, 12345.678F, -0.0F}, {3, 4, 5}};
constexpr CloudFormat kFormats[] = {CloudFormat::kPly, CloudFormat::kPlyText, CloudFormat::kPcd, CloudFormat::kPcdText};

TEST(CloudFile, EveryFormatReadsBackBitForBit) {
  for (const CloudFormat format : kFormats) {
    const auto cloud = DecodeCloud(EncodeCloud(kCloud, format));
    ASSERT_TRUE(cloud) << cloud.error().message;
    EXPECT_EQ(*cloud, kCloud);
    const auto empty = DecodeCloud(EncodeCloud({}, format));
    ASSERT_TRUE(empty);
    EXPECT_TRUE(empty->empty());
  }
}

TEST(CloudFile, HeadersSayWhatTheFormatsAskFor) {
  const std::string ply = EncodeCloud(kCloud, CloudFormat::kPlyText);
  EXPECT_EQ(ply.substr(0, 21), "ply\nformat ascii 1.0\n");
  EXPECT_THAT(
      ply,
      HasSubstr("element vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n1.5 -2.25 0.1\n"));
  const std::string pcd = EncodeCloud(kCloud, CloudFormat::kPcd);
  EXPECT_THAT(pcd, HasSubstr("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\n"));
  EXPECT_THAT(pcd, HasSubstr("POINTS 3\nDATA binary\n"));
  EXPECT_EQ(pcd.size() - pcd.find("binary\n") - 7, 36u);
}

TEST(CloudFile, FilesOfOtherProgramsWithMoreFieldsAreRead) {
  const auto ply = DecodeCloud(
      "ply\r\nformat ascii 1.0\nelement vertex 2\nproperty uchar red\nproperty float z\nproperty float x\nproperty "
      "float y\n"
      "element face 0\nproperty list uchar int vertex_indices\nend_header\n255 3 1 2\n0 6 4 5\n");
  ASSERT_TRUE(ply) << ply.error().message;
  EXPECT_EQ(*ply, (PointCloud{{1, 2, 3}, {4, 5, 6}}));
  const auto pcd = DecodeCloud(
      "VERSION .7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n"
      "DATA ascii\n1 2 3 0.5\n");
  ASSERT_TRUE(pcd) << pcd.error().message;
  EXPECT_EQ(*pcd, (PointCloud{{1, 2, 3}}));
}

TEST(CloudFile, BrokenFilesAreRefused) {
  const std::string good = EncodeCloud(kCloud, CloudFormat::kPly), pcd = EncodeCloud(kCloud, CloudFormat::kPcdText);
  const std::vector<std::string> broken = {
      "",
      "hello",
      "ply\n",
      "ply\nformat ascii 1.0\nend_header\n",
      "ply\nformat binary_big_endian 1.0\nelement vertex 0\nend_header\n",
      "ply\nformat ascii 1.0\nelement vertex -1\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
      "ply\nformat ascii 1.0\nelement vertex 99999999999999\nproperty float x\nproperty float y\nproperty float "
      "z\nend_header\n",
      "ply\nformat ascii 1.0\nelement vertex 400000000\nproperty float x\nproperty float y\nproperty float "
      "z\nend_header\n1 2 3\n",
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty float y\nproperty float z\nend_header\n1 2 "
      "3\n",
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 "
      "two 3\n",
      "ply\nformat ascii 1.0\nelement face 1\nelement vertex 1\nend_header\n",
      good.substr(0, good.size() - 1),
      pcd.substr(0, pcd.size() - 6),
      "FIELDS x y z\nSIZE 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n",
      "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA binary_compressed\n",
      "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nDATA ascii\n",
  };
  for (const std::string& bytes : broken) EXPECT_FALSE(DecodeCloud(bytes)) << bytes;
  // Every cut of a good file is refused or, in text, ends a number early; none may crash.
  for (std::size_t i = 0; i < good.size(); ++i) EXPECT_FALSE(DecodeCloud(good.substr(0, i))) << i;
  for (std::size_t i = 0; i < pcd.size(); ++i) static_cast<void>(DecodeCloud(pcd.substr(0, i)));
}

TEST(CloudFile, TheEndingChoosesTheFormat) {
  EXPECT_EQ(*CloudFormatOf("a.ply", false), CloudFormat::kPly);
  EXPECT_EQ(*CloudFormatOf("a.pcd", true), CloudFormat::kPcdText);
  EXPECT_FALSE(CloudFormatOf("a.xyz", false));
  const TempDirectory directory;
  ASSERT_TRUE(WriteCloud(kCloud, CloudFormat::kPcd, directory / "c.pcd"));
  EXPECT_EQ(*ReadCloud(directory / "c.pcd"), kCloud);
  EXPECT_FALSE(ReadCloud(directory / "absent.pcd"));
  EXPECT_FALSE(WriteCloud(kCloud, CloudFormat::kPcd, directory / "no" / "c.pcd"));
}

}  // namespace
}  // namespace cairn
