#include <gtest/gtest.h>

#include "common/map/occupancy_image.h"
#include "tests/fuzz/mutation.h"
#include "tests/temp_directory.h"

namespace cairn {
namespace {

void ExpectMap(const Result<OccupancyImage>& map) {
  if (!map) {
    EXPECT_FALSE(map.error().message.empty());
    return;
  }
  EXPECT_EQ(map->cells.size(), static_cast<std::size_t>(map->width) * static_cast<std::size_t>(map->height));
  EXPECT_TRUE(map->T_map_origin.IsFinite());
  EXPECT_GT(map->resolution_m, 0.0);
  for (const std::uint8_t cell : map->cells) ASSERT_TRUE(cell <= 100 || cell == kUnknownCell);
}

TEST(MapFuzz, DamagedYaml) {
  const TempDirectory directory;
  OccupancyImage image{0.05, {1.5, -2.5, 0.1}, 8, 4, std::vector<std::uint8_t>(32, 100)};
  ASSERT_TRUE(SaveMapYaml(image, directory / "m.yaml", ".pgm", {}));
  const std::string good = directory.Read("m.yaml");
  std::mt19937_64 random(5);
  for (int i = 0; i < 3000; ++i) {
    const std::string bad = Mutate(
        good, random, {".nan", ".inf", "[", "]", "{", "}", "&a ", "*a", "- ", ": ", "\n", "!!binary ", "raw", "scale"});
    ExpectMap(LoadMapYaml(directory.Write("bad.yaml", bad)));
  }
}

TEST(MapFuzz, DamagedImages) {
  const TempDirectory directory;
  OccupancyImage image{0.05, {}, 40, 30, std::vector<std::uint8_t>(1200, 0)};
  for (std::size_t i = 0; i < image.cells.size(); i += 3) image.cells[i] = 100;
  std::mt19937_64 random(6);
  for (const std::string extension : {".pgm", ".png"}) {
    ASSERT_TRUE(SaveMapYaml(image, directory / "m.yaml", extension, {}));
    const std::string good = directory.Read("m" + extension);
    for (int i = 0; i < 1500; ++i) {
      static_cast<void>(
          directory.Write("m" + extension, Mutate(good, random, {"999999", " ", "#", "P5", "P6", "IHDR"})));
      ExpectMap(LoadMapYaml(directory / "m.yaml"));
    }
  }
}

}  // namespace
}  // namespace cairn
