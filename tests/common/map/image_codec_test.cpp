#include "common/map/image_codec.h"

#include <gtest/gtest.h>

#include <string>

namespace cairn {
namespace {

std::vector<std::uint8_t> Bytes(const std::string& text) {
  return {text.begin(), text.end()};
}

TEST(ImageCodec, RoundTripsGreyAndAlpha) {
  const RasterImage grey{3, 2, 1, {0, 100, 205, 254, 255, 7}};
  for (const char* extension : {".png", ".pgm", ".bmp"}) {
    const auto bytes = EncodeImage(grey, extension, 6);
    ASSERT_TRUE(bytes) << extension;
    const auto image = DecodeImage(*bytes);
    ASSERT_TRUE(image) << extension << image.error().message;
    EXPECT_EQ(image->width, 3);
    EXPECT_EQ(image->height, 2);
    const auto channels = static_cast<std::size_t>(image->channels);
    for (std::size_t i = 0; i < grey.samples.size(); ++i) EXPECT_EQ(image->samples[i * channels], grey.samples[i]);
  }
  const RasterImage coloured{1, 2, 4, {1, 2, 3, 255, 4, 5, 6, 0}};
  const auto image = DecodeImage(*EncodeImage(coloured, ".png", 6));
  ASSERT_TRUE(image);
  EXPECT_EQ(image->channels, 4);
  EXPECT_EQ(image->samples, coloured.samples);
}

TEST(ImageCodec, ReadsAHandMadePgm) {
  const auto image = DecodeImage(Bytes("P5\n# made by hand\n2 1\n255\n\x01\xfe"));
  ASSERT_TRUE(image);
  EXPECT_EQ(image->samples, (std::vector<std::uint8_t>{1, 254}));
}

TEST(ImageCodec, AClaimOfABillionPixelsIsRefusedUnread) {
  for (const char* text :
       {"P5\n100000 100000\n255\nabc", "P5 1048577 1 255\nabc", "P5 0 5 255\nabc", "P5 -3 5 255\nabc"}) {
    EXPECT_FALSE(DecodeImage(Bytes(text))) << text;
  }
}

TEST(ImageCodec, OtherBytesAreNoImages) {
  EXPECT_FALSE(DecodeImage({}));
  EXPECT_FALSE(DecodeImage(Bytes("GIF89a.............................")));
  EXPECT_FALSE(DecodeImage(Bytes("P5")));
  EXPECT_FALSE(DecodeImage(Bytes("P5\n2 2\n255\n")));  // No samples.
}

TEST(ImageCodec, AnUnknownExtensionIsAnErrorNotAnException) {
  EXPECT_FALSE(EncodeImage({1, 1, 1, {0}}, ".xyz", 6));
}

}  // namespace
}  // namespace cairn
