#include "common/bag/mcap_writer.h"

#include <fcntl.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <system_error>

#include "common/bag/bag_file.h"
#include "common/bag/unpack.h"
#include "common/version.h"

namespace cairn::bag {
namespace {

constexpr int kPackingLevel = 1;  // Of zstd: a robot's computer has better to do.

template <typename Number>
void Put(std::string& bytes, Number number) {
  static_assert(std::endian::native == std::endian::little);
  bytes.append(reinterpret_cast<const char*>(&number), sizeof(number));
}
void PutString(std::string& bytes, std::string_view text) {
  Put(bytes, static_cast<std::uint32_t>(text.size()));
  bytes += text;
}
std::string RecordOf(McapOp op, std::string_view content) {
  std::string record;
  record.reserve(kRecordHeaderBytes + content.size());
  Put(record, op);
  Put(record, static_cast<std::uint64_t>(content.size()));
  record += content;
  return record;
}

// A map or an array: its length in bytes, then its elements, pairs of two numbers.
template <typename Pairs>
void PutPairs(std::string& bytes, const Pairs& pairs) {
  std::string elements;
  for (const auto& [first, second] : pairs) {
    Put(elements, first);
    Put(elements, second);
  }
  PutString(bytes, elements);
}

}  // namespace

McapWriter::McapWriter(std::filesystem::path path, int file, const McapWriterOptions& options)
    : path_(std::move(path)), file_(file), options_(options) {}

McapWriter::~McapWriter() {
  ::close(file_);
}

Result<std::unique_ptr<McapWriter>> McapWriter::Create(const std::filesystem::path& path,
                                                       const McapWriterOptions& options) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | (options.overwrite ? O_TRUNC : O_EXCL), 0644);
  if (file < 0) {
    const auto code = errno == EEXIST   ? StatusCode::kAlreadyExists
                      : errno == ENOENT ? StatusCode::kNotFound
                      : errno == EACCES ? StatusCode::kPermissionDenied
                                        : StatusCode::kUnavailable;
    return Fail(code, path.string() + ": cannot create: " + std::generic_category().message(errno));
  }
  std::unique_ptr<McapWriter> writer(new McapWriter(path, file, options));
  std::string header;
  PutString(header, "");  // No profile: the schemas say what the messages are.
  PutString(header, std::string("cairn ") + kVersion);
  if (auto begun = writer->Append(std::string(kMcapMagic) + RecordOf(McapOp::kHeader, header)); !begun)
    return tl::unexpected(begun.error());
  return writer;
}

Result<std::uint16_t> McapWriter::AddSchema(std::string_view name, std::string_view encoding,
                                            std::string_view content) {
  if (schemas_.size() >= kMaxTopics) return Fail(StatusCode::kResourceExhausted, "too many schemas");
  const auto id = static_cast<std::uint16_t>(schemas_.size() + 1);  // 0 means none.
  std::string schema;
  Put(schema, id);
  PutString(schema, name);
  PutString(schema, encoding);
  PutString(schema, content);
  schemas_.push_back(RecordOf(McapOp::kSchema, schema));
  records_ += schemas_.back();
  return id;
}

Result<std::uint16_t> McapWriter::AddChannel(std::uint16_t schema, std::string_view topic, std::string_view encoding) {
  if (channels_.size() >= kMaxTopics) return Fail(StatusCode::kResourceExhausted, "too many topics");
  const auto id = static_cast<std::uint16_t>(channels_.size());
  std::string channel;
  Put(channel, id);
  Put(channel, schema);
  PutString(channel, topic);
  PutString(channel, encoding);
  PutString(channel, "");  // No metadata.
  channels_.push_back(RecordOf(McapOp::kChannel, channel));
  counts_.push_back(0);
  records_ += channels_.back();
  return id;
}

Result<void> McapWriter::Write(std::uint16_t channel, std::uint64_t log_time, std::uint64_t publish_time,
                               std::string_view message) {
  if (!error_.ok()) return tl::unexpected(error_);
  first_time_ = places_.empty() ? log_time : std::min(first_time_, log_time);
  last_time_ = places_.empty() ? log_time : std::max(last_time_, log_time);
  places_[channel].emplace_back(log_time, records_.size());
  Put(records_, McapOp::kMessage);
  Put(records_, static_cast<std::uint64_t>(sizeof(std::uint16_t) + sizeof(std::uint32_t) + 2 * sizeof(std::uint64_t) +
                                           message.size()));
  Put(records_, channel);
  Put(records_, static_cast<std::uint32_t>(counts_[channel]++));
  Put(records_, log_time);
  Put(records_, publish_time);
  records_ += message;
  return records_.size() >= options_.chunk_bytes ? EndChunk() : Result<void>{};
}

Result<void> McapWriter::EndChunk() {
  if (!error_.ok()) return tl::unexpected(error_);
  if (places_.empty()) return {};
  std::string packed(ZSTD_compressBound(records_.size()), '\0');
  const std::size_t size = ZSTD_compress(packed.data(), packed.size(), records_.data(), records_.size(), kPackingLevel);
  if (ZSTD_isError(size) != 0) return Fail(StatusCode::kResourceExhausted, "zstd: no memory");
  packed.resize(size);

  ChunkPlace place{.start = end_,
                   .first_time = first_time_,
                   .last_time = last_time_,
                   .stored_bytes = packed.size(),
                   .bytes = records_.size()};
  std::string chunk;
  Put(chunk, place.first_time);
  Put(chunk, place.last_time);
  Put(chunk, place.bytes);
  Put(chunk, Crc32(records_));
  PutString(chunk, "zstd");
  Put(chunk, place.stored_bytes);
  chunk += packed;
  std::string written = RecordOf(McapOp::kChunk, chunk);
  place.length = written.size();
  std::uint64_t messages = 0;
  for (const auto& [channel, messages_of_it] : places_) {
    place.indexes.emplace_back(channel, end_ + written.size());
    messages += messages_of_it.size();
    std::string index;
    Put(index, channel);
    PutPairs(index, messages_of_it);
    written += RecordOf(McapOp::kMessageIndex, index);
  }
  place.index_bytes = written.size() - place.length;
  // A chunk that cannot be written is no part of the file.
  if (auto appended = Append(written); !appended) return appended;
  chunks_.push_back(std::move(place));
  messages_ += messages;
  records_.clear();
  places_.clear();
  return {};
}

// Behind the data: the end of the data, the summary, where its parts are, the footer.
std::string McapWriter::EndOfFile() const {
  std::string bytes, content;
  Put(content, checksum_);
  bytes += RecordOf(McapOp::kDataEnd, content);
  const std::size_t data_end_bytes = bytes.size();
  const std::uint64_t summary_start = end_ + bytes.size();

  std::string offsets;
  const auto end_group = [&](McapOp op, std::size_t began) {
    if (bytes.size() == began) return;
    std::string offset;
    Put(offset, op);
    Put(offset, end_ + began);
    Put(offset, static_cast<std::uint64_t>(bytes.size() - began));
    offsets += RecordOf(McapOp::kSummaryOffset, offset);
  };
  std::size_t began = bytes.size();
  for (const std::string& schema : schemas_) bytes += schema;
  end_group(McapOp::kSchema, began);
  began = bytes.size();
  for (const std::string& channel : channels_) bytes += channel;
  end_group(McapOp::kChannel, began);

  began = bytes.size();
  std::map<std::uint16_t, std::uint64_t> counts;
  for (std::size_t i = 0; i < counts_.size(); ++i) counts[static_cast<std::uint16_t>(i)] = counts_[i];
  // What has not reached a chunk is not in the file.
  for (const auto& [channel, places] : places_) counts[channel] -= places.size();
  std::uint64_t first_time = 0, last_time = 0;
  for (const ChunkPlace& chunk : chunks_) {
    first_time = &chunk == &chunks_.front() ? chunk.first_time : std::min(first_time, chunk.first_time);
    last_time = std::max(last_time, chunk.last_time);
  }
  content.clear();
  Put(content, messages_);
  Put(content, static_cast<std::uint16_t>(schemas_.size()));
  Put(content, static_cast<std::uint32_t>(channels_.size()));
  Put(content, std::uint32_t{0});  // Attachments,
  Put(content, std::uint32_t{0});  // metadata.
  Put(content, static_cast<std::uint32_t>(chunks_.size()));
  Put(content, first_time);
  Put(content, last_time);
  PutPairs(content, counts);
  bytes += RecordOf(McapOp::kStatistics, content);
  end_group(McapOp::kStatistics, began);

  began = bytes.size();
  for (const ChunkPlace& chunk : chunks_) {
    content.clear();
    Put(content, chunk.first_time);
    Put(content, chunk.last_time);
    Put(content, chunk.start);
    Put(content, chunk.length);
    PutPairs(content, chunk.indexes);
    Put(content, chunk.index_bytes);
    PutString(content, "zstd");
    Put(content, chunk.stored_bytes);
    Put(content, chunk.bytes);
    bytes += RecordOf(McapOp::kChunkIndex, content);
  }
  end_group(McapOp::kChunkIndex, began);

  const std::uint64_t offsets_start = end_ + bytes.size();
  bytes += offsets;
  // The footer's checksum counts from the summary to the field before it.
  std::string footer;
  Put(footer, McapOp::kFooter);
  Put(footer, static_cast<std::uint64_t>(2 * sizeof(std::uint64_t) + sizeof(std::uint32_t)));
  Put(footer, summary_start);
  Put(footer, offsets_start);
  bytes += footer;
  Put(bytes, Crc32(std::string_view(bytes).substr(data_end_bytes)));
  bytes += kMcapMagic;
  return bytes;
}

Result<void> McapWriter::Finish() {
  if (auto ended = EndChunk(); !ended) return ended;
  if (auto appended = Append(EndOfFile()); !appended) return appended;
  if (::fsync(file_) != 0 && errno != EINVAL && errno != EROFS)
    error_ = {StatusCode::kUnavailable, path_.string() + ": cannot flush: " + std::generic_category().message(errno)};
  if (!error_.ok()) return tl::unexpected(error_);
  error_ = {StatusCode::kFailedPrecondition, path_.string() + ": the file was finished"};
  return {};
}

Result<void> McapWriter::Append(std::string_view bytes) {
  const int error = TryAppend(bytes);
  if (error == 0) return {};
  const bool full = error == ENOSPC || error == EDQUOT || error == EFBIG;
  error_ = {full ? StatusCode::kResourceExhausted : StatusCode::kUnavailable,
            path_.string() + ": cannot write: " + std::generic_category().message(error)};
  // Cutting off what was written in part has made some room.
  static_cast<void>(TryAppend(EndOfFile()));
  return tl::unexpected(error_);
}

int McapWriter::TryAppend(std::string_view bytes) {
  std::string_view rest = bytes;
  std::uint64_t at = end_;
  while (!rest.empty()) {
    const ssize_t count = ::pwrite(file_, rest.data(), rest.size(), static_cast<off_t>(at));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      const int error = count < 0 ? errno : EIO;
      // Where this fails, the part stays: a reader takes it for an end that is missing.
      static_cast<void>(::ftruncate(file_, static_cast<off_t>(end_)) == 0);
      return error;
    }
    rest.remove_prefix(static_cast<std::size_t>(count));
    at += static_cast<std::uint64_t>(count);
  }
  checksum_ = Crc32(bytes, checksum_);
  end_ = at;
  return 0;
}

}  // namespace cairn::bag
