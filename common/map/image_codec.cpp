#include "common/map/image_codec.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

namespace cairn {
namespace {

constexpr std::array<std::uint8_t, 8> kPngSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

std::int64_t BigEndian32(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  return (std::int64_t{bytes[at]} << 24) | (bytes[at + 1] << 16) | (bytes[at + 2] << 8) | bytes[at + 3];
}

// BMP heights are signed: negative means top row first.
std::int64_t LittleEndian32(const std::vector<std::uint8_t>& bytes, std::size_t at) {
  const std::uint32_t value = bytes[at] | (std::uint32_t{bytes[at + 1]} << 8) | (std::uint32_t{bytes[at + 2]} << 16) |
                              (std::uint32_t{bytes[at + 3]} << 24);
  return static_cast<std::int32_t>(value);
}

// Two decimal numbers after "P2" .. "P6", between blanks and comments.
std::optional<ImageSize> PnmSize(const std::vector<std::uint8_t>& bytes) {
  std::array<std::int64_t, 2> numbers{};
  std::size_t i = 2;
  for (std::int64_t& number : numbers) {
    while (i < bytes.size() && (bytes[i] == '#' || bytes[i] <= ' ')) {
      if (bytes[i] == '#') {
        while (i < bytes.size() && bytes[i] != '\n') ++i;
      } else {
        ++i;
      }
    }
    const std::size_t begin = i;
    for (; i < bytes.size() && bytes[i] >= '0' && bytes[i] <= '9' && i - begin < 10; ++i) {
      number = number * 10 + (bytes[i] - '0');
    }
    if (i == begin) return std::nullopt;
  }
  return ImageSize{numbers[0], numbers[1]};
}

Result<RasterImage> FromMat(const cv::Mat& decoded) {
  cv::Mat image = decoded;
  if (image.depth() == CV_16U) image.convertTo(image, CV_8U, 1.0 / 257.0);
  if (image.depth() != CV_8U) return Fail(StatusCode::kInvalidArgument, "image samples are neither 8 nor 16 bits");
  RasterImage raster{image.cols, image.rows, image.channels(), {}};
  if (raster.channels != 1 && raster.channels != 3 && raster.channels != 4) {
    return Fail(StatusCode::kInvalidArgument, "image has " + std::to_string(raster.channels) + " channels");
  }
  const std::size_t row_bytes = static_cast<std::size_t>(raster.width) * static_cast<std::size_t>(raster.channels);
  raster.samples.resize(row_bytes * static_cast<std::size_t>(raster.height));
  for (int y = 0; y < raster.height; ++y) {
    std::copy_n(image.ptr<std::uint8_t>(y), row_bytes,
                raster.samples.begin() + static_cast<std::ptrdiff_t>(row_bytes * static_cast<std::size_t>(y)));
  }
  return raster;
}

// The size that the header of a PNG, PNM or BMP file states; nothing for other bytes.
std::optional<ImageSize> DeclaredSize(const std::vector<std::uint8_t>& bytes) {
  if (bytes.size() >= 26 && std::equal(kPngSignature.begin(), kPngSignature.end(), bytes.begin())) {
    return ImageSize{BigEndian32(bytes, 16), BigEndian32(bytes, 20)};
  }
  if (bytes.size() >= 26 && bytes[0] == 'B' && bytes[1] == 'M') {
    return ImageSize{LittleEndian32(bytes, 18), std::abs(LittleEndian32(bytes, 22))};
  }
  if (bytes.size() >= 4 && bytes[0] == 'P' && bytes[1] >= '2' && bytes[1] <= '6') return PnmSize(bytes);
  return std::nullopt;
}

}  // namespace

Result<std::vector<std::uint8_t>> EncodeImage(const RasterImage& image, const std::string& extension, int png_level) {
  try {
    const cv::Mat view(image.height, image.width, CV_8UC(image.channels),
                       const_cast<std::uint8_t*>(image.samples.data()));  // imencode only reads it.
    std::vector<int> parameters;
    if (extension == ".png") parameters = {cv::IMWRITE_PNG_COMPRESSION, png_level};
    std::vector<std::uint8_t> bytes;
    if (!cv::imencode(extension, view, bytes, parameters)) {
      return Fail(StatusCode::kInternal, "image cannot be written as " + extension);
    }
    return bytes;
  } catch (const std::exception& error) {
    return Fail(StatusCode::kInternal, "image cannot be written as " + extension + ": " + error.what());
  }
}

Result<RasterImage> DecodeImage(const std::vector<std::uint8_t>& bytes) {
  const auto size = DeclaredSize(bytes);
  if (!size) return Fail(StatusCode::kInvalidArgument, "not a PNG, PGM or BMP image");
  constexpr std::int64_t kLongestSide = 1 << 20;
  if (size->width <= 0 || size->height <= 0 || size->width > kLongestSide || size->height > kLongestSide ||
      size->width * size->height > kMaxImagePixels) {
    return Fail(StatusCode::kInvalidArgument, "image of " + std::to_string(size->width) + " x " +
                                                  std::to_string(size->height) + " pixels is refused");
  }
  try {
    const cv::Mat decoded = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
    if (decoded.empty()) return Fail(StatusCode::kInvalidArgument, "image data are damaged");
    return FromMat(decoded);
  } catch (const std::exception& error) {
    return Fail(StatusCode::kInvalidArgument, std::string("image data are damaged: ") + error.what());
  }
}

}  // namespace cairn
