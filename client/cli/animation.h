// Makes an animated PNG (APNG) of pictures of one size. Browsers play it; programs that know only still pictures show
// the last one. Only what has changed since the picture before is stored again. Source: W3C, Portable Network Graphics
// (PNG) Specification, third edition, 2025: acTL, fcTL, fdAT.
#pragma once

#include <cstdint>
#include <vector>

#include "common/map/raster_image.h"
#include "common/status.h"

namespace cairn::client {

// Thread rule: one thread at a time.
class Animation {
 public:
  // Adds a picture of three channels that is shown for `shown_ms`, 1 to 65535. kInvalidArgument: it has another size
  // than the first one, or other channels.
  [[nodiscard]] Result<void> Add(RasterImage image, int shown_ms);
  [[nodiscard]] int frames() const { return frames_; }

  // The bytes of the file, which plays again and again. kFailedPrecondition: there is no picture.
  [[nodiscard]] Result<std::vector<std::uint8_t>> File() const;

 private:
  RasterImage last_;
  int frames_ = 0;
  std::uint32_t chunks_numbered_ = 0;
  std::vector<std::uint8_t> chunks_;  // Of the frames, as the file has them.
};

}  // namespace cairn::client
