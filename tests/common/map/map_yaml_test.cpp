#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/map/image_codec.h"
#include "common/map/occupancy_image.h"
#include "tests/temp_directory.h"

namespace cairn {
namespace {

constexpr std::uint8_t kU = kUnknownCell;

OccupancyImage SmallMap() {
  return {0.05, {12345.123456, -0.1, 0.25}, 3, 2, {0, 100, kU, /* upper row: */ 100, 0, 0}};
}

// A map.yaml with these lines over a 4 x 1 PGM of 254, 205, 0 and 100.
Result<OccupancyImage> LoadPixels(const std::string& lines) {
  const TempDirectory directory;
  static_cast<void>(directory.Write("m.pgm", std::string("P5\n4 1\n255\n\xfe\xcd\0d", 15)));
  return LoadMapYaml(directory.Write("m.yaml", "image: m.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n" + lines));
}

TEST(MapYaml, TrinaryMapsRoundTripInBothFormats) {
  for (const char* extension : {".png", ".pgm"}) {
    const TempDirectory directory;
    ASSERT_TRUE(SaveMapYaml(SmallMap(), directory / "m.yaml", extension, {}));
    const auto map = LoadMapYaml(directory / "m.yaml");
    ASSERT_TRUE(map) << map.error().message;
    EXPECT_EQ(map->cells, SmallMap().cells);
    EXPECT_EQ(map->width, 3);
    EXPECT_EQ(map->height, 2);
    EXPECT_EQ(map->resolution_m, 0.05);
    EXPECT_EQ(map->T_map_origin, SmallMap().T_map_origin);  // Exactly: no digit of a far origin is lost.
  }
}

TEST(MapYaml, TheFileIsWhatNav2Expects) {
  const TempDirectory directory;
  ASSERT_TRUE(SaveMapYaml(SmallMap(), directory / "m.yaml", ".pgm", {}));
  EXPECT_EQ(directory.Read("m.yaml"),
            "image: \"m.pgm\"\nmode: trinary\nresolution: 0.05\norigin: [12345.123456, -0.1, 0.25]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.196\n");
  const std::string image = directory.Read("m.pgm");
  EXPECT_EQ(image.substr(image.size() - 6), std::string("\x00\xfe\xfe\xfe\x00\xcd", 6));  // Highest y first.
}

TEST(MapYaml, Ros1ThresholdReads205AsUnknown) {
  const auto map = LoadPixels("negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n");
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_THAT(map->cells, testing::ElementsAre(0, kU, 100, kU));
}

TEST(MapYaml, Nav2ThresholdReads205AsFree) {
  // 205 is an occupancy of 0.196: below 0.25. This is what Nav2 does with its own default.
  const auto map = LoadPixels("negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n");
  ASSERT_TRUE(map);
  EXPECT_EQ(map->cells[1], 0);
}

TEST(MapYaml, NegateAsNumberAndAsTruthValue) {
  for (const char* negate : {"1", "true"}) {
    const auto map = LoadPixels(std::string("negate: ") + negate + "\noccupied_thresh: 0.65\nfree_thresh: 0.196\n");
    ASSERT_TRUE(map) << map.error().message;
    EXPECT_THAT(map->cells, testing::ElementsAre(100, 100, 0, kU));
  }
}

TEST(MapYaml, RawValuesAreTakenAsTheyAre) {
  const auto map = LoadPixels("mode: raw\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n");
  ASSERT_TRUE(map);
  EXPECT_THAT(map->cells, testing::ElementsAre(kU, kU, 0, 100));
}

TEST(MapYaml, ScaleInterpolatesBetweenTheThresholds) {
  const auto map = LoadPixels("mode: scale\nnegate: 0\noccupied_thresh: 0.9\nfree_thresh: 0.1\n");
  ASSERT_TRUE(map);
  EXPECT_EQ(map->cells[0], 0);
  EXPECT_EQ(map->cells[2], 100);
  EXPECT_EQ(map->cells[3], 63);  // (155/255 - 0.1) / 0.8 = 0.6348.
}

TEST(MapYaml, RawAndScaleMapsRoundTrip) {
  OccupancyImage image = SmallMap();
  image.cells = {0, 1, 50, 99, 100, kU};
  for (const MapImageMode mode : {MapImageMode::kRaw, MapImageMode::kScale}) {
    const TempDirectory directory;
    ASSERT_TRUE(SaveMapYaml(image, directory / "m.yaml", ".png", {mode, 1.0, 0.0}));
    const auto map = LoadMapYaml(directory / "m.yaml");
    ASSERT_TRUE(map) << map.error().message;
    EXPECT_EQ(map->cells, image.cells) << static_cast<int>(mode);
  }
}

TEST(MapYaml, ScaleShowsUnknownAsTransparent) {
  const TempDirectory directory;
  OccupancyImage image{0.05, {}, 1, 1, {kU}};
  ASSERT_TRUE(SaveMapYaml(image, directory / "m.yaml", ".png", {MapImageMode::kScale, 0.65, 0.25}));
  EXPECT_EQ(LoadMapYaml(directory / "m.yaml")->cells[0], kU);
}

TEST(MapYaml, AverageOfColoursAndOpacityInTrinary) {
  // A transparent black pixel: (0 + 0 + 0 + 0) / 4 is black, occupied; an opaque one is a quarter bright: unknown.
  const TempDirectory directory;
  const auto png = EncodeImage({2, 1, 4, {0, 0, 0, 0, 0, 0, 0, 255}}, ".png", 6);
  ASSERT_TRUE(png);
  static_cast<void>(directory.Write("m.png", {png->begin(), png->end()}));
  const auto map = LoadMapYaml(directory.Write("m.yaml",
                                               "image: m.png\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n"
                                               "occupied_thresh: 0.8\nfree_thresh: 0.2\n"));
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_THAT(map->cells, testing::ElementsAre(100, kU));
}

TEST(MapYaml, NamesThatLookLikeYamlAreQuoted) {
  const TempDirectory directory;
  ASSERT_TRUE(SaveMapYaml(SmallMap(), directory / "a: #b.yaml", ".png", {}));
  EXPECT_TRUE(LoadMapYaml(directory / "a: #b.yaml"));
}

}  // namespace
}  // namespace cairn
