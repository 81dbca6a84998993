// The records of MCAP files, as views of their bytes. A record is a number that says its kind (opcode), its length in
// eight bytes, and its content; numbers are little-endian. Stateless. Source: the MCAP specification, version 0
// (mcap.dev/spec).
#pragma once

#include <bit>
#include <cstdint>
#include <optional>
#include <string_view>

namespace cairn::bag {

inline constexpr std::string_view kMcapMagic = "\x89MCAP0\r\n";
inline constexpr std::size_t kMcapNameBytes = 5;  // Of the magic: the version follows.

enum class McapOp : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0b,
  kSummaryOffset = 0x0e,
  kDataEnd = 0x0f,
};

inline constexpr std::size_t kRecordHeaderBytes = 9;

// Takes fields from bytes; the first one that does not fit makes it bad, and from then on every field is empty.
class FieldReader {
 public:
  explicit FieldReader(std::string_view bytes) : rest_(bytes) {}
  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] std::string_view rest() const { return rest_; }

  template <typename Number>
  Number Take() {
    static_assert(std::endian::native == std::endian::little);
    char raw[sizeof(Number)] = {};
    TakeBytes(sizeof(Number)).copy(raw, sizeof(Number));
    return std::bit_cast<Number>(raw);
  }
  std::string_view TakeString() { return TakeBytes(Take<std::uint32_t>()); }
  std::string_view TakeBytes(std::uint64_t size) {
    ok_ = ok_ && size <= rest_.size();
    if (!ok_) return {};
    const std::string_view bytes = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return bytes;
  }

 private:
  std::string_view rest_;
  bool ok_ = true;
};

struct McapRecord {
  McapOp op{};
  std::string_view content;
};
// The next record of the reader's bytes; nothing where they are cut off.
[[nodiscard]] inline std::optional<McapRecord> TakeRecord(FieldReader& bytes) {
  const auto op = bytes.Take<std::uint8_t>();
  const std::string_view content = bytes.TakeBytes(bytes.Take<std::uint64_t>());
  return bytes.ok() ? std::optional(McapRecord{static_cast<McapOp>(op), content}) : std::nullopt;
}

struct McapSchema {
  std::uint16_t id = 0;
  std::string_view name, encoding, content;
};
struct McapChannel {
  std::uint16_t id = 0, schema = 0;
  std::string_view topic, encoding;
};
struct McapMessage {
  std::uint16_t channel = 0;
  std::uint64_t log_time = 0;
  std::string_view content;
};
struct McapChunk {
  std::uint64_t size = 0;  // Of its records, unpacked.
  std::uint32_t crc = 0;   // Of its records, unpacked; 0: not known.
  std::string_view compression;
  std::uint64_t stored_bytes = 0;  // As many follow.
};

[[nodiscard]] inline std::optional<McapSchema> ParseSchema(std::string_view content) {
  FieldReader fields(content);
  McapSchema schema;
  schema.id = fields.Take<std::uint16_t>();
  schema.name = fields.TakeString();
  schema.encoding = fields.TakeString();
  schema.content = fields.TakeString();
  return fields.ok() ? std::optional(schema) : std::nullopt;
}

[[nodiscard]] inline std::optional<McapChannel> ParseChannel(std::string_view content) {
  FieldReader fields(content);
  McapChannel channel;
  channel.id = fields.Take<std::uint16_t>();
  channel.schema = fields.Take<std::uint16_t>();
  channel.topic = fields.TakeString();
  channel.encoding = fields.TakeString();
  return fields.ok() ? std::optional(channel) : std::nullopt;
}

[[nodiscard]] inline std::optional<McapMessage> ParseMessage(std::string_view content) {
  FieldReader fields(content);
  McapMessage message;
  message.channel = fields.Take<std::uint16_t>();
  fields.Take<std::uint32_t>();  // Its number.
  message.log_time = fields.Take<std::uint64_t>();
  fields.Take<std::uint64_t>();  // When it was published.
  message.content = fields.rest();
  return fields.ok() ? std::optional(message) : std::nullopt;
}

// Of a chunk, the fields before its records. Advances the reader to them.
[[nodiscard]] inline std::optional<McapChunk> TakeChunkFields(FieldReader& fields) {
  McapChunk chunk;
  fields.Take<std::uint64_t>();  // The earliest and the latest time of its messages: seen when they are read.
  fields.Take<std::uint64_t>();
  chunk.size = fields.Take<std::uint64_t>();
  chunk.crc = fields.Take<std::uint32_t>();
  chunk.compression = fields.TakeString();
  chunk.stored_bytes = fields.Take<std::uint64_t>();
  return fields.ok() ? std::optional(chunk) : std::nullopt;
}

}  // namespace cairn::bag
