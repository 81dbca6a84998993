// Small images in memory to and from PNG, PGM and BMP bytes: the one place that calls the image library, so that its
// exceptions and its trust in headers stop here. Not for photographs. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/map/raster_image.h"
#include "common/status.h"

namespace cairn {

// The size that the header of a PNG, PNM or BMP file states; nothing for other bytes.
[[nodiscard]] std::optional<ImageSize> DeclaredSize(const std::vector<std::uint8_t>& bytes);

// `extension` is ".png", ".pgm" (grey only) or ".bmp". `png_level` 0 (fast) to 9 (small).
[[nodiscard]] Result<std::vector<std::uint8_t>> EncodeImage(const RasterImage& image, const std::string& extension,
                                                            int png_level);
// 16-bit samples are reduced to their upper byte. Refuses more than kMaxImagePixels before it allocates for them.
[[nodiscard]] Result<RasterImage> DecodeImage(const std::vector<std::uint8_t>& bytes);

}  // namespace cairn
