// Map tiles to and from PNG bytes, with libpng. OpenCV (image_codec.h) loads a hundred other libraries; without it the
// server starts 0.1 s sooner. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "common/map/raster_image.h"
#include "common/status.h"

namespace cairn {

// Fast rather than small. REQUIRES: one or four channels, and as many samples as its size says. Fails without memory.
[[nodiscard]] Result<std::vector<std::uint8_t>> EncodePng(const RasterImage& image);

// An image of one channel and of exactly this size with 8 bits per sample, as EncodePng and OpenCV write it. Everything
// else is refused before memory is taken for it: other sizes and depths, and chunks that would change the samples (such
// as gAMA) or that expand to megabytes (such as zTXt).
[[nodiscard]] Result<std::vector<std::uint8_t>> DecodeGreyPng(const std::vector<std::uint8_t>& bytes, ImageSize size);

}  // namespace cairn
