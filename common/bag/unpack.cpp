#include "common/bag/unpack.h"

#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include <memory>
#include <utility>

namespace cairn::bag {
namespace {

tl::unexpected<Status> Damaged(const std::string& why) {
  return Fail(StatusCode::kDataLoss, why);
}

struct FreeLz4 {
  void operator()(LZ4F_dctx* context) const { LZ4F_freeDecompressionContext(context); }
};

Result<std::string> UnpackLz4(std::string_view stored, std::size_t size) {
  LZ4F_dctx* created = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&created, LZ4F_VERSION)) != 0)
    return Fail(StatusCode::kResourceExhausted, "no memory for lz4");
  const std::unique_ptr<LZ4F_dctx, FreeLz4> context(created);
  std::string unpacked(size, '\0');
  std::size_t written = 0, open = 1;
  while (!stored.empty()) {
    std::size_t taken = stored.size(), given = size - written;
    open = LZ4F_decompress(context.get(), unpacked.data() + written, &given, stored.data(), &taken, nullptr);
    if (LZ4F_isError(open) != 0) return Damaged(std::string("lz4: ") + LZ4F_getErrorName(open));
    if (taken == 0 && given == 0) return Damaged("lz4: longer than it should be");
    stored.remove_prefix(taken);
    written += given;
  }
  if (open != 0 || written != size) return Damaged("lz4: shorter than it should be");
  return unpacked;
}

}  // namespace

bool IsZstd(std::string_view bytes) {
  return bytes.starts_with("\x28\xb5\x2f\xfd");
}

Result<std::string> UnpackZstd(std::string_view stored, std::size_t max_bytes) {
  const unsigned long long size = ZSTD_getFrameContentSize(stored.data(), stored.size());
  if (size == ZSTD_CONTENTSIZE_UNKNOWN || size == ZSTD_CONTENTSIZE_ERROR)
    return Damaged("zstd: the part does not say how long it is");
  if (size > max_bytes) return Damaged("zstd: the part is too long");
  return Unpack(stored, "zstd", size);
}

Result<std::string> Unpack(std::string_view stored, std::string_view compression, std::size_t size) {
  if (compression.empty()) {
    if (stored.size() != size) return Damaged("its two lengths differ");
    return std::string(stored);
  }
  if (compression == "lz4") return UnpackLz4(stored, size);
  if (compression != "zstd")
    return Fail(StatusCode::kUnimplemented, "its compression is none of zstd, lz4 and no compression");
  std::string unpacked(size, '\0');
  const std::size_t written = ZSTD_decompress(unpacked.data(), size, stored.data(), stored.size());
  if (ZSTD_isError(written) != 0) return Damaged(std::string("zstd: ") + ZSTD_getErrorName(written));
  if (written != size) return Damaged("zstd: shorter than it should be");
  return unpacked;
}

std::uint32_t Crc32(std::string_view bytes, std::uint32_t before) {
  return static_cast<std::uint32_t>(crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace cairn::bag
