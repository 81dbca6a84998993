// Nav2's map.yaml and its image: SaveMapYaml and LoadMapYaml of occupancy_image.h.
// Source: nav2_map_server/src/map_io.cpp (loadMapFromFile, tryWriteMapToFile).
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <optional>
#include <string>

#include "common/file/atomic_file.h"
#include "common/map/image_codec.h"
#include "common/map/occupancy_image.h"
#include "common/options/number_text.h"

namespace cairn {
namespace {

constexpr std::array<const char*, 3> kModeNames = {"trinary", "scale", "raw"};
constexpr std::uint8_t kFreePixel = 254, kUnknownPixel = 205, kOccupiedPixel = 0;
constexpr std::size_t kMaxYamlBytes = 1u << 20;
constexpr std::size_t kMaxImageBytes = 1u << 30;

bool IsShare(double value) {
  return std::isfinite(value) && value >= 0.0 && value <= 1.0;
}

std::string ThresholdProblem(double free_thresh, double occupied_thresh) {
  if (!IsShare(free_thresh)) return "free_thresh must be within 0..1";
  if (!IsShare(occupied_thresh)) return "occupied_thresh must be within 0..1";
  return free_thresh > occupied_thresh ? "free_thresh is above occupied_thresh" : "";
}

std::uint8_t TrinaryPixel(std::uint8_t cell, const MapSaveOptions& options) {
  if (cell > 100) return kUnknownPixel;
  if (cell <= std::rint(options.free_thresh * 100.0)) return kFreePixel;
  return cell >= std::rint(options.occupied_thresh * 100.0) ? kOccupiedPixel : kUnknownPixel;
}

// Image row 0 is the highest y.
RasterImage DrawImage(const OccupancyImage& map, const MapSaveOptions& options) {
  RasterImage image{map.width, map.height, options.mode == MapImageMode::kScale ? 4 : 1, {}};
  image.samples.reserve(map.cells.size() * static_cast<std::size_t>(image.channels));
  for (int y = map.height - 1; y >= 0; --y) {
    for (int x = 0; x < map.width; ++x) {
      const std::uint8_t cell =
          map.cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) + static_cast<std::size_t>(x)];
      if (options.mode == MapImageMode::kTrinary) {
        image.samples.push_back(TrinaryPixel(cell, options));
      } else if (options.mode == MapImageMode::kRaw) {
        image.samples.push_back(cell > 100 ? 255 : cell);
      } else {  // Unknown is transparent grey.
        const auto grey = cell > 100 ? std::uint8_t{128} : static_cast<std::uint8_t>(std::lround((100 - cell) * 2.55));
        image.samples.insert(image.samples.end(), {grey, grey, grey, cell > 100 ? std::uint8_t{0} : std::uint8_t{255}});
      }
    }
  }
  return image;
}

struct MapYaml {
  std::string image;
  MapImageMode mode = MapImageMode::kTrinary;
  double resolution = 0.0;
  Pose2 origin;
  bool negate = false;
  double occupied_thresh = 0.65;
  double free_thresh = 0.25;
};

double Required(const YAML::Node& document, const char* key) {
  if (!document[key]) throw YAML::Exception(YAML::Mark::null_mark(), std::string("'") + key + "' is missing");
  return document[key].as<double>();
}

// Throws YAML::Exception; its only caller catches. Nothing but conversion happens here.
MapYaml Parse(const std::string& text) {
  const YAML::Node document = YAML::Load(text);
  const auto fail = [](const std::string& why) { throw YAML::Exception(YAML::Mark::null_mark(), why); };
  if (!document.IsMap()) fail("not a map description");
  MapYaml yaml;
  if (!document["image"]) fail("'image' is missing");
  yaml.image = document["image"].as<std::string>();
  if (yaml.image.empty()) fail("'image' is empty");
  yaml.resolution = Required(document, "resolution");
  if (!std::isfinite(yaml.resolution) || yaml.resolution <= 0.0) fail("'resolution' must be positive");
  if (!document["origin"]) fail("'origin' is missing");
  const auto origin = document["origin"].as<std::vector<double>>();
  if (origin.size() != 3) fail("'origin' must have three elements");
  yaml.origin = {origin[0], origin[1], origin[2]};
  if (!yaml.origin.IsFinite()) fail("'origin' is not finite");
  yaml.origin.theta = WrapAngle(yaml.origin.theta);
  yaml.occupied_thresh = Required(document, "occupied_thresh");
  yaml.free_thresh = Required(document, "free_thresh");
  const std::string problem = ThresholdProblem(yaml.free_thresh, yaml.occupied_thresh);
  if (!problem.empty()) fail(problem);
  if (document["mode"]) {
    const auto mode = document["mode"].as<std::string>();
    const auto found = std::find(kModeNames.begin(), kModeNames.end(), mode);
    if (found == kModeNames.end()) fail("'mode' must be trinary, scale or raw");
    yaml.mode = static_cast<MapImageMode>(found - kModeNames.begin());
  }
  if (!document["negate"]) fail("'negate' is missing");
  int number = 0;
  yaml.negate = YAML::convert<int>::decode(document["negate"], number) ? number != 0 : document["negate"].as<bool>();
  return yaml;
}

std::uint8_t CellOf(const std::uint8_t* pixel, int channels, const MapYaml& yaml) {
  const bool has_alpha = channels == 4;
  int sum = 0;
  for (int c = 0; c < std::min(channels, 3); ++c) sum += pixel[c];
  int count = std::min(channels, 3);
  // Trinary averages opacity in with the colours, as map_server always did.
  if (has_alpha && yaml.mode == MapImageMode::kTrinary) {
    sum += pixel[3];
    ++count;
  }
  const double shade = sum / (255.0 * count);
  const double occupancy = yaml.negate ? shade : 1.0 - shade;
  if (yaml.mode == MapImageMode::kRaw) {
    const auto percent = static_cast<int>(std::lround(shade * 255.0));
    return percent <= 100 ? static_cast<std::uint8_t>(percent) : kUnknownCell;
  }
  if (yaml.mode == MapImageMode::kScale && has_alpha && pixel[3] != 255) return kUnknownCell;
  if (occupancy > yaml.occupied_thresh) return 100;
  if (occupancy < yaml.free_thresh) return 0;
  if (yaml.mode == MapImageMode::kTrinary) return kUnknownCell;
  const double width = yaml.occupied_thresh - yaml.free_thresh;
  if (width <= 0.0) return 100;  // Equal thresholds, and the cell exactly on them.
  return static_cast<std::uint8_t>(std::rint((occupancy - yaml.free_thresh) / width * 100.0));
}

}  // namespace

// Numbers are exact. (Nav2 itself prints three digits and so moves far origins: its PR 5398.)
std::string MapYamlText(const OccupancyImage& image, const std::string& image_name, const MapSaveOptions& options) {
  double free_thresh = options.free_thresh, occupied_thresh = options.occupied_thresh;
  if (options.mode == MapImageMode::kTrinary) {
    // The options have decided what each cell is. The file's thresholds must let every reader see the same three
    // values again: pixel 205 is an occupancy of 0.1961, which Nav2's own 0.25 would turn from unknown into free.
    free_thresh = std::clamp(free_thresh, 0.01, 0.196);
    occupied_thresh = std::clamp(occupied_thresh, 0.2, 0.99);
  }
  YAML::Emitter name;
  name << YAML::DoubleQuoted << image_name;
  const Pose2& origin = image.T_map_origin;
  std::string text = std::string("image: ") + name.c_str() + "\n";
  text += std::string("mode: ") + kModeNames[static_cast<std::size_t>(options.mode)] + "\n";
  text += "resolution: " + ExactText(image.resolution_m) + "\n";
  text += "origin: [" + ExactText(origin.x) + ", " + ExactText(origin.y) + ", " + ExactText(origin.theta) + "]\n";
  text +=
      "negate: 0\noccupied_thresh: " + ExactText(occupied_thresh) + "\nfree_thresh: " + ExactText(free_thresh) + "\n";
  return text;
}

Result<std::vector<std::uint8_t>> EncodeMapImage(const OccupancyImage& image, const std::string& image_extension,
                                                 const MapSaveOptions& options) {
  const auto refuse = [](const std::string& why) { return Fail(StatusCode::kInvalidArgument, why); };
  if (image_extension != ".png" && image_extension != ".pgm") return refuse("map images are .png or .pgm");
  if (options.mode == MapImageMode::kScale && image_extension != ".png") return refuse("mode scale needs .png (alpha)");
  if (image.width <= 0 || image.height <= 0) return refuse("the map is empty");
  if (image.cells.size() != static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height)) {
    return refuse("the map's cells do not fill its width and height");
  }
  if (!std::isfinite(image.resolution_m) || image.resolution_m <= 0.0) return refuse("resolution must be positive");
  if (!image.T_map_origin.IsFinite()) return refuse("origin is not finite");
  const std::string problem = ThresholdProblem(options.free_thresh, options.occupied_thresh);
  if (!problem.empty()) return refuse(problem);
  constexpr int kPngLevel = 6;
  return EncodeImage(DrawImage(image, options), image_extension, kPngLevel);
}

Result<void> SaveMapYaml(const OccupancyImage& image, const std::filesystem::path& yaml_path,
                         const std::string& image_extension, const MapSaveOptions& options) {
  const auto bytes = EncodeMapImage(image, image_extension, options);
  if (!bytes) return tl::unexpected(bytes.error());
  std::filesystem::path image_path = yaml_path;
  image_path.replace_extension(image_extension);
  if (image_path == yaml_path) {
    return Fail(StatusCode::kInvalidArgument, yaml_path.string() + ": name the yaml file, such as " +
                                                  std::filesystem::path(yaml_path).replace_extension(".yaml").string() +
                                                  "; the image is written beside it");
  }
  const std::string_view content(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  if (auto written = WriteFileAtomically(image_path, content); !written) return written;
  return WriteFileAtomically(yaml_path, MapYamlText(image, image_path.filename().string(), options));
}

Result<OccupancyImage> LoadMapYaml(const std::filesystem::path& yaml_path) {
  const auto text = ReadWholeFile(yaml_path, kMaxYamlBytes);
  if (!text) return tl::unexpected(text.error());
  MapYaml yaml;
  try {
    yaml = Parse(std::string(text->begin(), text->end()));
  } catch (const std::exception& error) {
    return Fail(StatusCode::kInvalidArgument, yaml_path.string() + ": " + error.what());
  }
  const std::filesystem::path image_path = yaml_path.parent_path() / yaml.image;  // An absolute name stands alone.
  const auto bytes = ReadWholeFile(image_path, kMaxImageBytes);
  if (!bytes) return tl::unexpected(bytes.error());
  const auto raster = DecodeImage(*bytes);
  if (!raster) return Fail(raster.error().code, image_path.string() + ": " + raster.error().message);

  OccupancyImage map;
  map.resolution_m = yaml.resolution;
  map.T_map_origin = yaml.origin;
  map.width = raster->width;
  map.height = raster->height;
  map.cells.resize(static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height));
  const std::uint8_t* pixel = raster->samples.data();
  for (int row = 0; row < map.height; ++row) {
    auto cell = map.cells.begin() + static_cast<std::ptrdiff_t>(map.height - 1 - row) * map.width;
    for (int x = 0; x < map.width; ++x, ++cell, pixel += raster->channels) {
      *cell = CellOf(pixel, raster->channels, yaml);
    }
  }
  return map;
}

}  // namespace cairn
