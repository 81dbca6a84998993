#include "client/cli/animation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace cairn::client {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kWidth = 37, kHeight = 23;

struct PngChunk {
  std::string type;
  Bytes content;
};

std::uint32_t BigEndian(const Bytes& bytes, std::size_t at, std::size_t count = 4) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < count; ++i) number = number << 8 | bytes.at(at + i);
  return number;
}

std::uint32_t Checksum(const Bytes& bytes, std::size_t at, std::size_t count) {
  return static_cast<std::uint32_t>(crc32(0, bytes.data() + at, static_cast<uInt>(count)));
}

void AppendBigEndian(std::uint32_t number, Bytes& bytes) {
  for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<std::uint8_t>(number >> shift));
}

// The chunks of a file; an error of the test where the file is damaged.
std::vector<PngChunk> ChunksOf(const Bytes& file) {
  const Bytes signature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  EXPECT_TRUE(file.size() > 8 && std::equal(signature.begin(), signature.end(), file.begin()));
  std::vector<PngChunk> chunks;
  for (std::size_t at = 8; at < file.size();) {
    const std::size_t length = BigEndian(file, at);
    PngChunk chunk;
    chunk.type.assign(file.begin() + static_cast<std::ptrdiff_t>(at) + 4,
                      file.begin() + static_cast<std::ptrdiff_t>(at) + 8);
    chunk.content.assign(file.begin() + static_cast<std::ptrdiff_t>(at) + 8,
                         file.begin() + static_cast<std::ptrdiff_t>(at + 8 + length));
    EXPECT_EQ(BigEndian(file, at + 8 + length), Checksum(file, at + 4, length + 4)) << chunk.type;
    chunks.push_back(chunk);
    at += length + 12;
  }
  return chunks;
}

// A frame's samples as blue, green, red, alpha. libpng inflates them.
cv::Mat Decode(const PngChunk& header, const Bytes& compressed) {
  Bytes png = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  const std::vector<PngChunk> chunks = {header, {"IDAT", compressed}, {"IEND", {}}};
  for (const auto& [type, content] : chunks) {
    AppendBigEndian(static_cast<std::uint32_t>(content.size()), png);
    const std::size_t summed = png.size();
    png.insert(png.end(), type.begin(), type.end());
    png.insert(png.end(), content.begin(), content.end());
    AppendBigEndian(Checksum(png, summed, png.size() - summed), png);
  }
  return cv::imdecode(png, cv::IMREAD_UNCHANGED);
}

// Picture `number` of a series: a block on a gradient, which moves.
RasterImage Picture(int number) {
  RasterImage image{kWidth, kHeight, 3, {}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool block = x >= 5 * number && x < 5 * number + 7 && y >= 4 && y < 12;
      for (const int sample : {block ? 0 : 3 * x, block ? 10 * number : 5 * y, block ? 255 : 77})
        image.samples.push_back(static_cast<std::uint8_t>(sample));
    }
  }
  return image;
}

// Draws a frame over what is shown, and returns how many of its pixels it has.
int DrawOver(const cv::Mat& frame, bool replace, Bytes& shown) {
  int drawn = 0;
  for (int y = 0; y < frame.rows; ++y) {
    for (int x = 0; x < frame.cols; ++x) {
      const auto& pixel = frame.at<cv::Vec4b>(y, x);
      EXPECT_TRUE(pixel[3] == 0 || pixel[3] == 255);
      if (pixel[3] == 0 && !replace) continue;
      ++drawn;
      for (int i = 0; i < 3; ++i) shown[static_cast<std::size_t>(3 * (y * kWidth + x) + i)] = pixel[i];
    }
  }
  return drawn;
}

TEST(Animation, EveryPictureComesBackFromTheFile) {
  Animation animation;
  const std::vector<int> times_ms = {150, 40, 1, 2500};
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(animation.Add(Picture(i), times_ms[static_cast<std::size_t>(i)]));
  EXPECT_EQ(animation.frames(), 4);
  const auto file = animation.File();
  ASSERT_TRUE(file) << file.error().message;
  const std::vector<PngChunk> chunks = ChunksOf(*file);
  std::vector<std::string> types;
  for (const PngChunk& chunk : chunks) types.push_back(chunk.type);
  ASSERT_THAT(types, ::testing::ElementsAre("IHDR", "acTL", "IDAT", "fcTL", "fdAT", "fcTL", "fdAT", "fcTL", "fdAT",
                                            "fcTL", "fdAT", "IEND"));
  EXPECT_EQ(BigEndian(chunks[0].content, 0), static_cast<std::uint32_t>(kWidth));
  EXPECT_EQ(BigEndian(chunks[0].content, 4), static_cast<std::uint32_t>(kHeight));
  ASSERT_EQ(chunks[1].content.size(), 8U);
  EXPECT_EQ(BigEndian(chunks[1].content, 0), 4U);
  EXPECT_EQ(BigEndian(chunks[1].content, 4), 0U) << "plays without end";

  Bytes shown(std::size_t{3} * kWidth * kHeight);
  for (std::size_t i = 0; i < 4; ++i) {
    const Bytes& control = chunks[3 + 2 * i].content;
    Bytes content = chunks[4 + 2 * i].content;
    ASSERT_EQ(control.size(), 26U);
    EXPECT_EQ(BigEndian(control, 0), 2 * i);
    EXPECT_EQ(BigEndian(content, 0), 2 * i + 1);
    EXPECT_EQ(BigEndian(control, 4), static_cast<std::uint32_t>(kWidth));
    EXPECT_EQ(BigEndian(control, 8), static_cast<std::uint32_t>(kHeight));
    EXPECT_EQ(BigEndian(control, 12), 0U);
    EXPECT_EQ(BigEndian(control, 16), 0U);
    EXPECT_EQ(BigEndian(control, 20, 2) * 1000 / BigEndian(control, 22, 2), static_cast<std::uint32_t>(times_ms[i]));
    EXPECT_EQ(control[24], 0) << "what is shown stays";
    const bool replace = control[25] == 0;
    EXPECT_EQ(replace, i == 0) << "the first one covers the last one when it plays again";
    content.erase(content.begin(), content.begin() + 4);
    const cv::Mat frame = Decode(chunks[0], content);
    ASSERT_EQ(frame.type(), CV_8UC4);
    ASSERT_EQ(frame.size(), cv::Size(kWidth, kHeight));
    const int drawn = DrawOver(frame, replace, shown);
    EXPECT_EQ(shown, Picture(static_cast<int>(i)).samples) << "picture " << i;
    if (i > 0) {
      EXPECT_LE(drawn, 2 * 7 * 8) << "only the two places of the block have changed";
    }
  }
}

TEST(Animation, ProgramsThatCannotPlayShowTheLastPicture) {
  Animation animation;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(animation.Add(Picture(i), 100));
  const auto file = animation.File();
  ASSERT_TRUE(file);
  const cv::Mat still = cv::imdecode(*file, cv::IMREAD_COLOR);
  ASSERT_EQ(still.type(), CV_8UC3);
  EXPECT_EQ(Bytes(still.datastart, still.dataend), Picture(2).samples);
}

TEST(Animation, PicturesHaveOneSizeAndThereIsAtLeastOne) {
  Animation animation;
  EXPECT_FALSE(animation.File());
  EXPECT_FALSE(animation.Add({}, 100));
  RasterImage grey{2, 2, 1, {1, 2, 3, 4}};
  EXPECT_FALSE(animation.Add(grey, 100));
  ASSERT_TRUE(animation.Add(Picture(0), 100));
  EXPECT_FALSE(animation.Add({1, 1, 3, {1, 2, 3}}, 100));
  EXPECT_EQ(animation.frames(), 1);
  EXPECT_TRUE(animation.File());
}

}  // namespace
}  // namespace cairn::client
