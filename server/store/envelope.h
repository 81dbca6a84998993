// The bytes around every record: format version, packing and checksum. Stateless except for the compressor's memory,
// which is reused. Not thread-safe.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "common/status.h"
#include "server/store/store.h"

namespace cairn::record {
class Envelope;
}

namespace cairn::server {

// The newest version of the records (idl/cairn/record.proto) that this server can read; it writes this version. Since
// version 2 the checksum goes over words and not over bytes.
inline constexpr std::uint32_t kRecordFormat = 2;
// Longer records are refused when they are read: the size is a number in a file.
inline constexpr std::uint64_t kMaxRecordBytes = std::uint64_t{1} << 30;

// The checksum that belongs into the envelope, by its format.
[[nodiscard]] std::uint64_t ChecksumOf(const RecordKey& key, const record::Envelope& envelope);

class EnvelopeCodec {
 public:
  EnvelopeCodec();
  ~EnvelopeCodec();
  EnvelopeCodec(const EnvelopeCodec&) = delete;
  EnvelopeCodec& operator=(const EnvelopeCodec&) = delete;

  // `format` is a parameter for tests only.
  [[nodiscard]] std::string Seal(const RecordKey& key, std::string_view content, std::uint32_t format = kRecordFormat);
  // DATA_LOSS: the bytes are not what was sealed under this key. FAILED_PRECONDITION: a newer format.
  [[nodiscard]] Result<std::string> Open(const RecordKey& key, std::string_view sealed);

 private:
  struct Compressor;
  const std::unique_ptr<Compressor> compressor_;
};

}  // namespace cairn::server
