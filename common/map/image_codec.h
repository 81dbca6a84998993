// Small images in memory to and from PNG, PGM and BMP bytes, with OpenCV, whose exceptions and trust in headers stop
// here. Not for photographs. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/map/raster_image.h"
#include "common/status.h"

namespace cairn {

// `extension` is ".png", ".pgm" (grey only) or ".bmp". `png_level` 0 (fast) to 9 (small).
[[nodiscard]] Result<std::vector<std::uint8_t>> EncodeImage(const RasterImage& image, const std::string& extension,
                                                            int png_level);
// 16-bit samples are reduced to their upper byte. Refuses more than kMaxImagePixels before it allocates for them.
[[nodiscard]] Result<RasterImage> DecodeImage(const std::vector<std::uint8_t>& bytes);

}  // namespace cairn
