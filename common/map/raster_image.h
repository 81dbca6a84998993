// An image in memory.
#pragma once

#include <cstdint>
#include <vector>

namespace cairn {

inline constexpr std::int64_t kMaxImagePixels = std::int64_t{1} << 27;  // 580 m x 580 m of 5 cm cells.

// Samples row by row from the image's first row, interleaved by pixel: grey; blue green red; or blue green red alpha.
struct RasterImage {
  int width = 0;
  int height = 0;
  int channels = 1;
  std::vector<std::uint8_t> samples;
};

struct ImageSize {
  std::int64_t width = 0;
  std::int64_t height = 0;
};

}  // namespace cairn
