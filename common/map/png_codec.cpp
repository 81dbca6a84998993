#include "common/map/png_codec.h"

#include <png.h>

#include <string>

namespace cairn {
namespace {

// Its memory is given back when the reading or writing ends in any way.
class PngImage {
 public:
  PngImage() { image_.version = PNG_IMAGE_VERSION; }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
  ~PngImage() { png_image_free(&image_); }
  png_image* operator->() { return &image_; }
  png_image* get() { return &image_; }

 private:
  png_image image_{};
};

}  // namespace

Result<std::vector<std::uint8_t>> EncodePng(const RasterImage& image) {
  PngImage png;
  png->width = static_cast<png_uint_32>(image.width);
  png->height = static_cast<png_uint_32>(image.height);
  png->format = image.channels == 1 ? PNG_FORMAT_GRAY : PNG_FORMAT_BGRA;
  png->flags = PNG_IMAGE_FLAG_FAST;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(*png.get());
  std::vector<std::uint8_t> bytes(size);
  if (png_image_write_to_memory(png.get(), bytes.data(), &size, 0, image.samples.data(), 0, nullptr) == 0)
    return Fail(StatusCode::kInternal, std::string("image cannot be written as PNG: ") + png->message);
  return std::vector<std::uint8_t>(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
}

Result<std::vector<std::uint8_t>> DecodeGreyPng(const std::vector<std::uint8_t>& bytes, ImageSize size) {
  PngImage png;
  if (png_image_begin_read_from_memory(png.get(), bytes.data(), bytes.size()) == 0)
    return Fail(StatusCode::kInvalidArgument, std::string("image data are damaged: ") + png->message);
  if (png->width != size.width || png->height != size.height || png->format != PNG_FORMAT_GRAY) {
    return Fail(StatusCode::kInvalidArgument, "image is not grey with 8 bits and " + std::to_string(size.width) +
                                                  " x " + std::to_string(size.height) + " pixels");
  }
  std::vector<std::uint8_t> samples(PNG_IMAGE_SIZE(*png.get()));
  if (png_image_finish_read(png.get(), nullptr, samples.data(), 0, nullptr) == 0)
    return Fail(StatusCode::kInvalidArgument, std::string("image data are damaged: ") + png->message);
  return samples;
}

}  // namespace cairn
