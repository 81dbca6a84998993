// Map tiles to and from PNG bytes, by libpng alone: the image library of image_codec.h loads a hundred others, which
// takes a tenth of a second of every start of the server. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "common/map/raster_image.h"
#include "common/status.h"

namespace cairn {

// Fast rather than small. REQUIRES: one or four channels, and as many samples as its size says. Fails without memory.
[[nodiscard]] Result<std::vector<std::uint8_t>> EncodePng(const RasterImage& image);

// An image of one channel and of exactly this size with 8 bits per sample. Everything else is refused, also a larger
// one, before memory is taken for it.
[[nodiscard]] Result<std::vector<std::uint8_t>> DecodeGreyPng(const std::vector<std::uint8_t>& bytes, ImageSize size);

}  // namespace cairn
