#include "server/store/envelope.h"

#include <zstd.h>

#include <array>
#include <utility>

#include "cairn/record.pb.h"
#include "common/file/checksum.h"
#include "server/store/checksum.h"

namespace cairn::server {
namespace {

// Level 1 is fast: the scans of a robot come all day, and the disk is larger than the processor is fast. Negative
// levels are faster: checkpoints are many times as large, and are replaced after seconds.
int LevelOf(RecordKind kind) {
  return kind == RecordKind::kCheckpoint ? -5 : 1;
}
constexpr std::size_t kShortest = 128;  // Shorter contents gain nothing.
enum Packing : std::uint32_t { kPlain = 0, kZstd = 1 };

std::string NameOf(const RecordKey& key) {
  return "record " + std::to_string(static_cast<int>(key.kind)) + "/" + std::to_string(key.owner) + "/" +
         std::to_string(key.number);
}

// Format 1. Summing byte by byte took longer than compressing.
std::uint64_t ByteChecksumOf(const RecordKey& key, const record::Envelope& envelope) {
  Checksum sum;
  sum.Add(static_cast<std::uint64_t>(key.kind));
  sum.Add(key.owner);
  sum.Add(key.number);
  sum.Add(std::uint64_t{envelope.format()});
  sum.Add(std::uint64_t{envelope.packing()});
  sum.Add(envelope.size());
  sum.Add(envelope.payload());
  return sum.value();
}

}  // namespace

std::uint64_t ChecksumOf(const RecordKey& key, const record::Envelope& envelope) {
  if (envelope.format() == 1) return ByteChecksumOf(key, envelope);
  const std::array<std::uint64_t, 6> head = {static_cast<std::uint64_t>(key.kind),
                                             key.owner,
                                             key.number,
                                             envelope.format(),
                                             envelope.packing(),
                                             envelope.size()};
  const std::string_view head_bytes(reinterpret_cast<const char*>(head.data()), sizeof(head));
  return cairn::ChecksumOf(envelope.payload(), cairn::ChecksumOf(head_bytes));
}

struct EnvelopeCodec::Compressor {
  std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> pack{ZSTD_createCCtx(), &ZSTD_freeCCtx};
  std::unique_ptr<ZSTD_DCtx, decltype(&ZSTD_freeDCtx)> unpack{ZSTD_createDCtx(), &ZSTD_freeDCtx};
};

EnvelopeCodec::EnvelopeCodec() : compressor_(std::make_unique<Compressor>()) {}
EnvelopeCodec::~EnvelopeCodec() = default;

std::string EnvelopeCodec::Seal(const RecordKey& key, std::string_view content, std::uint32_t format) {
  record::Envelope envelope;
  envelope.set_format(format);
  envelope.set_size(content.size());
  std::string& payload = *envelope.mutable_payload();
  if (content.size() >= kShortest) {
    payload.resize(ZSTD_compressBound(content.size()));
    const std::size_t packed = ZSTD_compressCCtx(compressor_->pack.get(), payload.data(), payload.size(),
                                                 content.data(), content.size(), LevelOf(key.kind));
    if (ZSTD_isError(packed) == 0 && packed < content.size()) {
      payload.resize(packed);
      envelope.set_packing(kZstd);
    }
  }
  if (envelope.packing() == kPlain) payload.assign(content);
  envelope.set_checksum(ChecksumOf(key, envelope));
  return envelope.SerializeAsString();
}

Result<std::string> EnvelopeCodec::Open(const RecordKey& key, std::string_view sealed) {
  const auto damaged = [&key] { return Fail(StatusCode::kDataLoss, NameOf(key) + " of the store is damaged"); };
  record::Envelope envelope;
  if (!envelope.ParseFromArray(sealed.data(), static_cast<int>(sealed.size()))) return damaged();
  if (envelope.checksum() != ChecksumOf(key, envelope)) return damaged();
  if (envelope.format() > kRecordFormat) {
    return Fail(StatusCode::kFailedPrecondition,
                NameOf(key) + " of the store has format " + std::to_string(envelope.format()) +
                    ", written by a newer server; this one reads formats up to " + std::to_string(kRecordFormat));
  }
  if (envelope.packing() == kPlain) return std::move(*envelope.mutable_payload());
  if (envelope.packing() != kZstd || envelope.size() > kMaxRecordBytes) return damaged();
  // Before memory is taken for it: a block of zstd has at least four bytes (RFC 8878, 3.1.1.2).
  if (envelope.size() / (ZSTD_BLOCKSIZE_MAX / 4) > envelope.payload().size()) return damaged();
  std::string content(envelope.size(), '\0');
  const std::size_t size = ZSTD_decompressDCtx(compressor_->unpack.get(), content.data(), content.size(),
                                               envelope.payload().data(), envelope.payload().size());
  if (ZSTD_isError(size) != 0 || size != content.size()) return damaged();
  return content;
}

}  // namespace cairn::server
