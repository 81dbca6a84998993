#include "client/cli/animation.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "common/map/image_codec.h"

namespace cairn::client {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kSignatureBytes = 8, kChunkFrameBytes = 12;  // Of a chunk: its length, type and checksum.
constexpr std::uint8_t kKeepWhatIsShown = 0, kReplace = 0, kDrawOver = 1;

void AppendNumber(std::uint32_t number, Bytes& bytes) {
  for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<std::uint8_t>(number >> shift));
}

// CRC-32 as PNG has it (specification, annex D).
std::uint32_t PngChecksum(std::span<const std::uint8_t> bytes) {
  static const auto kOfByte = [] {
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t byte = 0; byte < table.size(); ++byte) {
      std::uint32_t sum = byte;
      for (int bit = 0; bit < 8; ++bit) sum = (sum & 1U) != 0 ? 0xedb88320U ^ (sum >> 1) : sum >> 1;
      table[byte] = sum;
    }
    return table;
  }();
  std::uint32_t sum = 0xffffffffU;
  for (const std::uint8_t byte : bytes) sum = kOfByte[(sum ^ byte) & 0xffU] ^ (sum >> 8);
  return ~sum;
}

void AppendChunk(std::string_view type, std::span<const std::uint8_t> content, Bytes& file) {
  AppendNumber(static_cast<std::uint32_t>(content.size()), file);
  const std::size_t summed = file.size();
  file.insert(file.end(), type.begin(), type.end());
  file.insert(file.end(), content.begin(), content.end());
  AppendNumber(PngChecksum(std::span(file).subspan(summed)), file);
}

// The contents of all chunks of the type in a PNG, one after the other.
Bytes ContentOf(std::string_view type, std::span<const std::uint8_t> png) {
  Bytes content;
  for (png = png.subspan(std::min(kSignatureBytes, png.size())); png.size() >= kChunkFrameBytes;) {
    std::size_t length = 0;
    for (std::size_t i = 0; i < 4; ++i) length = length << 8 | png[i];
    if (length > png.size() - kChunkFrameBytes) break;
    if (std::ranges::equal(png.subspan(4, 4), type))
      content.insert(content.end(), png.begin() + 8, png.begin() + 8 + static_cast<std::ptrdiff_t>(length));
    png = png.subspan(kChunkFrameBytes + length);
  }
  return content;
}

// As a PNG with transparency: opaque where it differs from the picture before, or everywhere if there is none.
Result<Bytes> EncodeChanges(const RasterImage& image, const RasterImage* before) {
  RasterImage changes{image.width, image.height, 4, {}};
  changes.samples.resize(image.samples.size() / 3 * 4);
  for (std::size_t from = 0, to = 0; from < image.samples.size(); from += 3, to += 4) {
    const auto* const pixel = image.samples.data() + from;
    if (before != nullptr && std::equal(pixel, pixel + 3, before->samples.data() + from)) continue;
    std::copy_n(pixel, 3, changes.samples.data() + to);
    changes.samples[to + 3] = 255;
  }
  return EncodeImage(changes, ".png", 9);
}

}  // namespace

Result<void> Animation::Add(RasterImage image, int shown_ms) {
  const bool first = frames_ == 0;
  const auto pixels = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (image.channels != 3 || pixels == 0 || image.samples.size() != 3 * pixels ||
      (!first && (image.width != last_.width || image.height != last_.height))) {
    return Fail(StatusCode::kInvalidArgument, "all pictures of an animation have one size and three channels");
  }
  const auto png = EncodeChanges(image, first ? nullptr : &last_);
  if (!png) return tl::unexpected(png.error());
  Bytes control;
  AppendNumber(chunks_numbered_++, control);
  for (const int number : {image.width, image.height, 0, 0}) AppendNumber(static_cast<std::uint32_t>(number), control);
  const int time_ms = std::clamp(shown_ms, 1, 0xffff);
  for (const int part : {time_ms >> 8, time_ms & 0xff, 1000 >> 8, 1000 & 0xff})
    control.push_back(static_cast<std::uint8_t>(part));
  control.push_back(kKeepWhatIsShown);
  control.push_back(first ? kReplace : kDrawOver);
  AppendChunk("fcTL", control, chunks_);
  Bytes content;
  AppendNumber(chunks_numbered_++, content);
  const Bytes compressed = ContentOf("IDAT", *png);
  content.insert(content.end(), compressed.begin(), compressed.end());
  AppendChunk("fdAT", content, chunks_);
  last_ = std::move(image);
  ++frames_;
  return {};
}

Result<Bytes> Animation::File() const {
  if (frames_ == 0) return Fail(StatusCode::kFailedPrecondition, "an animation without a picture");
  const auto still = EncodeChanges(last_, nullptr);
  if (!still) return tl::unexpected(still.error());
  Bytes file(still->begin(), still->begin() + kSignatureBytes);
  AppendChunk("IHDR", ContentOf("IHDR", *still), file);
  Bytes control;
  AppendNumber(static_cast<std::uint32_t>(frames_), control);
  AppendNumber(0, control);  // Plays without end.
  AppendChunk("acTL", control, file);
  // No fcTL stands before it, so it is no frame: only programs that cannot play show it.
  AppendChunk("IDAT", ContentOf("IDAT", *still), file);
  file.insert(file.end(), chunks_.begin(), chunks_.end());
  AppendChunk("IEND", {}, file);
  return file;
}

}  // namespace cairn::client
