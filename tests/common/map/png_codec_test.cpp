#include "common/map/png_codec.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <string>
#include <vector>

#include "common/map/image_codec.h"

namespace cairn {
namespace {

RasterImage Ramp(int width, int height, int channels) {
  RasterImage image{width, height, channels, {}};
  for (int i = 0; i < width * height * channels; ++i) image.samples.push_back(static_cast<std::uint8_t>(7 * i));
  return image;
}

TEST(PngCodec, GreyRoundTrips) {
  const RasterImage image = Ramp(5, 3, 1);
  const auto png = EncodePng(image);
  ASSERT_TRUE(png) << png.error().message;
  const auto samples = DecodeGreyPng(*png, {5, 3});
  ASSERT_TRUE(samples) << samples.error().message;
  EXPECT_EQ(*samples, image.samples);
}

TEST(PngCodec, AnotherLibraryReadsWhatIsWrittenAndTheOtherWayRound) {
  for (const int channels : {1, 4}) {
    const RasterImage image = Ramp(6, 4, channels);
    const auto png = EncodePng(image);
    ASSERT_TRUE(png) << png.error().message;
    const auto read = DecodeImage(*png);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->channels, channels);
    EXPECT_EQ(read->samples, image.samples);
  }
  const RasterImage image = Ramp(6, 4, 1);
  const auto samples = DecodeGreyPng(*EncodeImage(image, ".png", 6), {6, 4});
  ASSERT_TRUE(samples) << samples.error().message;
  EXPECT_EQ(*samples, image.samples);
}

std::vector<std::uint8_t> Chunk(const std::string& type, const std::string& content) {
  std::vector<std::uint8_t> bytes;
  const auto append = [&bytes](std::uint32_t number) {
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<std::uint8_t>(number >> shift));
  };
  append(static_cast<std::uint32_t>(content.size()));
  const std::string summed = type + content;
  bytes.insert(bytes.end(), summed.begin(), summed.end());
  append(static_cast<std::uint32_t>(
      crc32(0, reinterpret_cast<const Bytef*>(summed.data()), static_cast<uInt>(summed.size()))));
  return bytes;
}

// libpng would scale the samples of the first, convert those of the second, and expand the last in memory.
TEST(PngCodec, ChunksThatATileDoesNotNeedAreRefused) {
  const auto png = EncodePng(Ramp(6, 4, 1)).value();
  constexpr std::ptrdiff_t kHeaderEnd = 33;
  const auto with = [&](const std::string& type, const std::string& content) {
    std::vector<std::uint8_t> changed = png;
    const auto chunk = Chunk(type, content);
    changed.insert(changed.begin() + kHeaderEnd, chunk.begin(), chunk.end());
    return changed;
  };
  const std::string linear("\x00\x01\x86\xa0", 4), transparent("\x00\x07", 2);
  EXPECT_TRUE(DecodeImage(with("gAMA", linear))) << "the chunk is well made";
  EXPECT_FALSE(DecodeGreyPng(with("gAMA", linear), {6, 4}));
  EXPECT_FALSE(DecodeGreyPng(with("tRNS", transparent), {6, 4}));
  EXPECT_FALSE(DecodeGreyPng(with("zTXt", std::string("a\0\0x", 4)), {6, 4}));
}

TEST(PngCodec, OtherHeadersAreRefused) {
  const auto with_header = [](char bits, char colour, char interlaced, const std::string& rows) {
    std::vector<std::uint8_t> bytes = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    std::string header("\x00\x00\x00\x01\x00\x00\x00\x01\x08\x00\x00\x00\x00", 13);
    header[8] = bits;
    header[9] = colour;
    header[12] = interlaced;
    std::vector<Bytef> packed(100);
    uLongf size = packed.size();
    compress(packed.data(), &size, reinterpret_cast<const Bytef*>(rows.data()), static_cast<uLong>(rows.size()));
    const std::string samples(packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(size));
    for (const auto& chunk : {Chunk("IHDR", header), Chunk("IDAT", samples), Chunk("IEND", "")})
      bytes.insert(bytes.end(), chunk.begin(), chunk.end());
    return bytes;
  };
  const std::string one_row(4, '\0');
  ASSERT_TRUE(DecodeGreyPng(with_header(8, 0, 0, one_row.substr(0, 2)), {1, 1}));
  for (const char bits : {1, 2, 4}) EXPECT_FALSE(DecodeGreyPng(with_header(bits, 0, 0, one_row.substr(0, 2)), {1, 1}));
  EXPECT_FALSE(DecodeGreyPng(with_header(16, 0, 0, one_row.substr(0, 3)), {1, 1}));
  EXPECT_FALSE(DecodeGreyPng(with_header(8, 2, 0, one_row), {1, 1}));
  EXPECT_FALSE(DecodeGreyPng(with_header(8, 0, 1, one_row.substr(0, 2)), {1, 1}));
}

TEST(PngCodec, OtherSizesColoursAndDamageAreRefused) {
  const auto png = EncodePng(Ramp(6, 4, 1)).value();
  EXPECT_FALSE(DecodeGreyPng(png, {4, 6}));
  EXPECT_FALSE(DecodeGreyPng(png, {6, 3}));
  EXPECT_FALSE(DecodeGreyPng(EncodePng(Ramp(6, 4, 4)).value(), {6, 4}));
  EXPECT_FALSE(DecodeGreyPng(*EncodeImage(Ramp(6, 4, 3), ".png", 6), {6, 4}));
  EXPECT_FALSE(DecodeGreyPng({}, {6, 4}));
  for (std::size_t size = 0; size < png.size() - 12; ++size)  // Without its last chunk, which is empty, it is whole.
    EXPECT_FALSE(DecodeGreyPng({png.begin(), png.begin() + static_cast<std::ptrdiff_t>(size)}, {6, 4})) << size;
}

}  // namespace
}  // namespace cairn
