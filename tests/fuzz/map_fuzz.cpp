// Map files: a number, then a picture (PNG, PNM or BMP) under a map.yaml of one kind, a map.yaml over a good picture,
// or a map of lines. What was read can be written and reads back as the same map, and a site can be made of it.
#include <cmath>

#include "common/map/image_codec.h"
#include "common/map/map_lines.h"
#include "common/map/map_tiles.h"
#include "common/map/occupancy_image.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/temp_directory.h"

namespace cairn::fuzz {
namespace {

constexpr std::size_t kMostPixels = std::size_t{1} << 16;  // Larger maps are read, but not written again, for speed.

void MustBeMap(const OccupancyImage& map) {
  Must(map.cells.size() == static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height),
       "the map is whole");
  Must(map.T_map_origin.IsFinite() && std::isfinite(map.resolution_m) && map.resolution_m > 0.0, "the map has a place");
  for (const std::uint8_t cell : map.cells) Must(cell <= 100 || cell == kUnknownCell, "a cell is a share or unknown");
}

bool RunMapFile(const TempDirectory& directory, const std::filesystem::path& yaml) {
  const auto map = LoadMapYaml(yaml);
  if (!map) {
    Must(!map.error().message.empty(), "a refusal has a reason");
    return false;
  }
  MustBeMap(*map);
  if (map->cells.size() > kMostPixels) return true;
  if (const auto tiles = ResampleToTiles(*map, map->resolution_m)) {
    Must(!tiles->empty(), "a map has tiles");
    for (const auto& [key, cells] : *tiles) {
      for (const std::uint8_t cell : cells) Must(cell <= 100 || cell == kUnknownCell, "a cell is a share or unknown");
    }
  } else {
    Must(!tiles.error().message.empty(), "a refusal has a reason");
  }
  MapSaveOptions raw;
  raw.mode = MapImageMode::kRaw;
  Must(SaveMapYaml(*map, directory / "again.yaml", ".pgm", raw).has_value(), "a map that was read can be written");
  const auto again = LoadMapYaml(directory / "again.yaml");
  Must(again && again->cells == map->cells && again->resolution_m == map->resolution_m,
       "it reads back as the same map");
  return true;
}

bool RunLines(const TempDirectory& directory, std::string_view text) {
  const auto lines = ParseMapLines(text, "fuzz");
  if (!lines) {
    Must(lines.error().message.rfind("fuzz", 0) == 0, "a refusal names its source");
    return false;
  }
  Must(!lines->empty() && lines->size() <= 20'000, "a map has lines, and not too many");
  for (const MapLine& line : *lines) Must(line.a.allFinite() && line.b.allFinite(), "a line is finite");
  Must(LinesNear(*lines, lines->front().a, 1.0).size() <= lines->size(), "lines near a point are lines of the map");
  Must(WriteMapLines(*lines, directory / "lines").has_value(), "lines that were read can be written");
  const auto again = ReadMapLines(directory / "lines");
  Must(again && *again == *lines, "they read back as the same lines");
  return true;
}

OccupancyImage SmallMap() {
  OccupancyImage map{0.05, {1.5, -2.5, 0.1}, 9, 5, std::vector<std::uint8_t>(45, 0)};
  for (std::size_t i = 0; i < map.cells.size(); i += 3) map.cells[i] = i % 2 == 0 ? 100 : kUnknownCell;
  return map;
}

// The directory with a map.yaml for every mode and the picture that the input replaces.
struct MapFolder {
  MapFolder() {
    Must(SaveMapYaml(SmallMap(), directory / "good.yaml", ".pgm", {}).has_value(), "the good map");
    const std::string rest =
        "\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n";
    for (const char* mode : {"trinary", "scale", "raw"})
      static_cast<void>(directory.Write(mode, std::string("image: picture\nmode: ") + mode + rest));
  }
  TempDirectory directory;
};

bool RunMap(std::string_view input) {
  static const MapFolder folder;
  const TempDirectory& directory = folder.directory;
  Pieces pieces(input);
  const std::uint8_t kind = pieces.Take() % 5;
  const std::string rest(pieces.rest());
  if (kind == 3) {
    // Names of other files would make what happens depend on the machine.
    if (rest.find("good.pgm") == std::string::npos) return false;
    return RunMapFile(directory, directory.Write("map.yaml", rest));
  }
  if (kind == 4) return RunLines(directory, rest);
  static_cast<void>(directory.Write("picture", rest));
  constexpr const char* kModes[] = {"trinary", "scale", "raw"};
  return RunMapFile(directory, directory / kModes[kind]);
}

std::vector<std::string> SeedsOfMaps() {
  const auto seed = [](char kind, std::string_view text) { return std::string(1, kind).append(text); };
  const TempDirectory directory;
  const auto picture = [](int channels, const char* extension) {
    RasterImage image{7, 4, channels, {}};
    for (int i = 0; i < 28 * channels; ++i) image.samples.push_back(static_cast<std::uint8_t>(i * 37));
    const auto bytes = EncodeImage(image, extension, 6).value();
    return std::string(bytes.begin(), bytes.end());
  };
  std::vector<std::string> seeds = {
      seed(0, picture(1, ".png")),
      seed(1, picture(4, ".png")),
      seed(2, picture(3, ".png")),
      seed(0, picture(1, ".pgm")),
      seed(1, picture(3, ".bmp")),
      seed(2, "P2\n# a comment\n3 2\n255\n0 254 205\n1 2 3\n"),
      seed(0, "P3 1 2 65535 0 9 65535 7 7 7\n"),
      seed(4, "cairn-map-lines 1\n# walls\nwall 0 0 4.5 0\nside 4.5 0 4.5 3\nwall -1e-3 2 7 2.25\n")};
  for (const MapImageMode mode : {MapImageMode::kTrinary, MapImageMode::kRaw}) {
    Must(SaveMapYaml(SmallMap(), directory / "good.yaml", ".pgm", {mode, 0.65, 0.25}).has_value(), "a map for a seed");
    seeds.push_back(seed(3, directory.Read("good.yaml")));
  }
  return seeds;
}

const bool kMapTarget = Register({"map", &RunMap, &SeedsOfMaps});

}  // namespace
}  // namespace cairn::fuzz
