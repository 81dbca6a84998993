#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "common/map/occupancy_image.h"
#include "tests/temp_directory.h"

namespace cairn {
namespace {

using testing::HasSubstr;

struct BadYaml {
  const char* name;
  const char* text;
  const char* reason;
};

class BadMapYaml : public testing::TestWithParam<BadYaml> {};

TEST_P(BadMapYaml, IsRefusedWithItsReason) {
  const TempDirectory directory;
  static_cast<void>(directory.Write("m.pgm", "P5\n1 1\n255\nx"));
  const auto map = LoadMapYaml(directory.Write("m.yaml", GetParam().text));
  ASSERT_FALSE(map);
  EXPECT_THAT(map.error().message, HasSubstr(GetParam().reason));
}

#define HEAD "image: m.pgm\nresolution: 0.1\n"
#define TAIL "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"

INSTANTIATE_TEST_SUITE_P(
    Files, BadMapYaml,
    testing::Values(
        BadYaml{"Empty", "", "not a map description"}, BadYaml{"Garbage", "[}{:::", "m.yaml"},
        BadYaml{"List", "- 1\n- 2\n", "not a map description"},
        BadYaml{"NoImage", "resolution: 0.1\norigin: [0, 0, 0]\n" TAIL, "'image' is missing"},
        BadYaml{"ImageIsAMap", "image: {a: b}\nresolution: 0.1\norigin: [0, 0, 0]\n" TAIL, "bad conversion"},
        BadYaml{"MissingImageFile", "image: none.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n" TAIL, "none.pgm"},
        BadYaml{"ResolutionZero", "image: m.pgm\nresolution: 0\norigin: [0, 0, 0]\n" TAIL, "'resolution'"},
        BadYaml{"ResolutionNan", "image: m.pgm\nresolution: .nan\norigin: [0, 0, 0]\n" TAIL, "'resolution'"},
        BadYaml{"ResolutionWord", "image: m.pgm\nresolution: fine\norigin: [0, 0, 0]\n" TAIL, "bad conversion"},
        BadYaml{"OriginMissing", HEAD TAIL, "'origin' is missing"},
        BadYaml{"OriginShort", HEAD "origin: [0, 0]\n" TAIL, "three elements"},
        BadYaml{"OriginLong", HEAD "origin: [0, 0, 0, 0]\n" TAIL, "three elements"},
        BadYaml{"YawNan", HEAD "origin: [0, 0, .nan]\n" TAIL, "'origin' is not finite"},
        BadYaml{"OriginInfinite", HEAD "origin: [.inf, 0, 0]\n" TAIL, "'origin' is not finite"},
        BadYaml{"ModeUnknown", HEAD "origin: [0, 0, 0]\nmode: colour\n" TAIL, "'mode'"},
        BadYaml{"NegateWord", HEAD "origin: [0, 0, 0]\nnegate: maybe\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
                "bad conversion"},
        BadYaml{"NegateMissing", HEAD "origin: [0, 0, 0]\noccupied_thresh: 0.65\nfree_thresh: 0.25\n",
                "'negate' is missing"},
        BadYaml{"ThresholdMissing", HEAD "origin: [0, 0, 0]\nnegate: 0\nfree_thresh: 0.25\n",
                "'occupied_thresh' is missing"},
        BadYaml{"ThresholdsSwapped", HEAD "origin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.2\nfree_thresh: 0.7\n",
                "above"},
        BadYaml{"ThresholdNan", HEAD "origin: [0, 0, 0]\nnegate: 0\noccupied_thresh: .nan\nfree_thresh: 0.7\n",
                "occupied_thresh"},
        BadYaml{"ImageIsTheYaml", "image: m.yaml\nresolution: 0.1\norigin: [0, 0, 0]\n" TAIL, "not a PNG, PGM or BMP"}),
    [](const auto& fault) { return std::string(fault.param.name); });

TEST(SaveMapYaml, RefusesMapsThatAreNone) {
  const TempDirectory directory;
  const OccupancyImage good{0.05, {}, 1, 1, {0}};
  const auto save = [&](const OccupancyImage& image, const char* extension, const MapSaveOptions& options) {
    return SaveMapYaml(image, directory / "m.yaml", extension, options).has_value();
  };
  EXPECT_TRUE(save(good, ".png", {}));
  EXPECT_FALSE(save({0.05, {}, 0, 0, {}}, ".png", {}));
  EXPECT_FALSE(save({0.05, {}, 2, 2, {0}}, ".png", {}));
  EXPECT_FALSE(save({0.0, {}, 1, 1, {0}}, ".png", {}));
  EXPECT_FALSE(save({0.05, {std::numeric_limits<double>::quiet_NaN(), 0, 0}, 1, 1, {0}}, ".png", {}));
  EXPECT_FALSE(save(good, ".gif", {}));
  EXPECT_FALSE(save(good, ".pgm", {MapImageMode::kScale, 0.65, 0.25}));
  EXPECT_FALSE(save(good, ".png", {MapImageMode::kTrinary, 0.2, 0.5}));
}

TEST(SaveMapYaml, WillNotWriteTheImageOverTheYaml) {
  const TempDirectory directory;
  EXPECT_FALSE(SaveMapYaml({0.05, {}, 1, 1, {0}}, directory / "m.png", ".png", {}));
}

}  // namespace
}  // namespace cairn
