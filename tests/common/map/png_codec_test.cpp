#include "common/map/png_codec.h"

#include <gtest/gtest.h>

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
