// Draws a map with trajectories over it as a picture for people: crisp walls, one colour per robot, scale bar, legend.
// Not a map format: nothing reads it back (map export writes those). Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/map/occupancy_image.h"
#include "common/map/raster_image.h"
#include "common/sensor/trajectory.h"
#include "common/status.h"

namespace cairn::client {

struct PicturePath {
  std::string label;
  Trajectory trajectory;
  bool reference = false;  // True for a ground truth: it is drawn thin and grey, below the other paths.
};

// The part of the map frame that a picture shows.
struct PictureFrame {
  double x_min_m = 1e300, y_min_m = 1e300, x_max_m = -1e300, y_max_m = -1e300;

  void Include(double x_m, double y_m);
  // Nothing changes if the other one is empty.
  void Include(const PictureFrame& other);
  [[nodiscard]] bool empty() const { return x_min_m > x_max_m; }
};

struct PictureOptions {
  int width_px = 1800;    // 200..8000. Of the map; the height follows from it.
  double margin_m = 0.6;  // Unknown space kept around what is known.
  std::string title;      // Above the map; empty: none.
  // Between wall and free, and between unknown and free; 0: as many as there are. Few make the files of animations
  // small.
  int shades = 0;
  // What to show; empty: what is known, with the margin. Pictures of one frame and title have one size.
  PictureFrame frame;
};

// What is known of the map, the paths, and a margin around both. Empty where there is nothing.
[[nodiscard]] PictureFrame FrameOf(const OccupancyImage& map, const std::vector<PicturePath>& paths, double margin_m);

// The picture with three channels. Fails where neither the map nor a path has anything to show.
[[nodiscard]] Result<RasterImage> DrawMapPixels(const OccupancyImage& map, const std::vector<PicturePath>& paths,
                                                const PictureOptions& options);
// The same as the bytes of a PNG.
[[nodiscard]] Result<std::vector<std::uint8_t>> DrawMapPicture(const OccupancyImage& map,
                                                               const std::vector<PicturePath>& paths,
                                                               const PictureOptions& options);

// Writes the bytes of a picture. CheckPictureFile says before whether that is allowed: kAlreadyExists where the file is
// the image of an exported map, which a picture must not replace.
[[nodiscard]] Result<void> CheckPictureFile(const std::filesystem::path& file);
[[nodiscard]] Result<void> WritePictureFile(const std::filesystem::path& file, const std::vector<std::uint8_t>& bytes);

// A round length (1, 2 or 5 times a power of ten) near `wanted_m`, not above it.
[[nodiscard]] double RoundLength(double wanted_m);

}  // namespace cairn::client
