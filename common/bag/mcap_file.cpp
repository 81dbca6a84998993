#include "common/bag/mcap_file.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "common/bag/mcap_merge.h"
#include "common/bag/mcap_records.h"
#include "common/bag/readable_file.h"

namespace cairn::bag {
namespace {

// Records outside of chunks are read together, up to so many bytes.
constexpr std::uint64_t kRunBytes = std::uint64_t{1} << 20;
constexpr std::size_t kMaxBlocks = std::size_t{1} << 20;

bool IsContent(McapOp op) {
  return op == McapOp::kSchema || op == McapOp::kChannel || op == McapOp::kMessage;
}

class McapFile : public File {
 public:
  McapFile(std::filesystem::path path, const McapLimits& limits) : path_(std::move(path)), limits_(limits) {}

  // Reads the whole file.
  Result<void> Survey();

  [[nodiscard]] const std::vector<Topic>& topics() const override { return topics_; }
  [[nodiscard]] const std::vector<std::string>& notes() const override { return notes_; }
  [[nodiscard]] Result<void> Read(const std::vector<std::size_t>& wanted, const Sink& sink) const override;

 private:
  [[nodiscard]] tl::unexpected<Status> Damaged(std::uint64_t offset, const std::string& why) const {
    return Fail(StatusCode::kDataLoss, path_.string() + ": byte " + std::to_string(offset) + ": " + why);
  }
  [[nodiscard]] tl::unexpected<Status> At(std::uint64_t offset, const Status& why) const {
    return Fail(why.code, path_.string() + ": byte " + std::to_string(offset) + ": " + why.message);
  }
  // Whether the data goes on behind the record.
  Result<bool> SurveyRecord(const ReadableFile& file, std::uint64_t offset, McapOp op, std::uint64_t length);
  Result<void> AddChunk(const ReadableFile& file, std::uint64_t offset, std::uint64_t length);
  Result<void> FinishRun(const ReadableFile& file);
  // Notes what a block holds, and keeps it if it holds messages.
  Result<void> AddBlock(const ReadableFile& file, McapBlock block);
  Result<void> AddSchema(std::uint64_t offset, std::string_view content);
  Result<void> AddChannel(std::uint64_t offset, std::string_view content);

  const std::filesystem::path path_;
  const McapLimits limits_;
  std::vector<Topic> topics_;
  std::vector<std::string> notes_;
  std::map<std::uint16_t, std::string> schemas_;  // Names of types.
  ChannelTopics channels_;
  std::vector<McapBlock> blocks_;
  McapBlock run_;
  std::uint64_t unpacked_ = 0;
};

Result<void> McapFile::Survey() {
  auto file = ReadableFile::Open(path_);
  if (!file) return tl::unexpected(file.error());
  std::uint64_t at = kMcapMagic.size();
  if (file->size() < at) return Damaged(0, "the file is shorter than its first eight bytes");
  const auto magic = file->Read(0, kMcapMagic.size());
  if (!magic) return At(0, magic.error());
  if (*magic != kMcapMagic) return Fail(StatusCode::kUnimplemented, path_.string() + ": another version of MCAP");
  bool goes_on = true;
  while (goes_on) {
    const std::uint64_t left = file->size() - at;
    std::uint64_t length = 0;
    auto op = McapOp{};
    if (left >= kRecordHeaderBytes) {
      const auto header = file->Read(at, kRecordHeaderBytes);
      if (!header) return At(at, header.error());
      FieldReader fields(*header);
      op = static_cast<McapOp>(fields.Take<std::uint8_t>());
      length = fields.Take<std::uint64_t>();
    }
    if (left < kRecordHeaderBytes || length > left - kRecordHeaderBytes) {
      notes_.push_back(path_.string() + ": its end is missing from byte " + std::to_string(at) + " on");
      break;
    }
    const auto surveyed = SurveyRecord(*file, at, op, length);
    if (!surveyed) return tl::unexpected(surveyed.error());
    goes_on = *surveyed;
    at += kRecordHeaderBytes + length;
  }
  return FinishRun(*file);
}

Result<bool> McapFile::SurveyRecord(const ReadableFile& file, std::uint64_t offset, McapOp op, std::uint64_t length) {
  if (op == McapOp{}) return Damaged(offset, "no record begins here");
  if (op == McapOp::kDataEnd || op == McapOp::kFooter) return false;
  if (!IsContent(op) && op != McapOp::kChunk) return true;  // The header, indexes, attachments, and what is to come.
  const std::uint64_t bytes = kRecordHeaderBytes + length;
  if (bytes > limits_.chunk_bytes)
    return Damaged(offset, "a record of " + std::to_string(length) + " bytes is too long");
  if (op == McapOp::kChunk) {
    if (auto finished = FinishRun(file); !finished) return tl::unexpected(finished.error());
    if (auto added = AddChunk(file, offset + kRecordHeaderBytes, length); !added) return tl::unexpected(added.error());
    return true;
  }
  if (run_.stored_bytes > 0 && (run_.offset + run_.stored_bytes != offset || run_.stored_bytes + bytes > kRunBytes)) {
    if (auto finished = FinishRun(file); !finished) return tl::unexpected(finished.error());
  }
  if (run_.stored_bytes == 0) run_.offset = offset;
  run_.stored_bytes += bytes;
  return true;
}

Result<void> McapFile::FinishRun(const ReadableFile& file) {
  McapBlock run = std::exchange(run_, {});
  if (run.stored_bytes == 0) return {};
  run.bytes = run.stored_bytes;
  return AddBlock(file, std::move(run));
}

Result<void> McapFile::AddChunk(const ReadableFile& file, std::uint64_t offset, std::uint64_t length) {
  constexpr std::uint64_t kMostFieldBytes = 64;  // The name of a compression is short.
  const auto start = file.Read(offset, std::min(length, kMostFieldBytes));
  if (!start) return At(offset, start.error());
  FieldReader fields(*start);
  const auto chunk = TakeChunkFields(fields);
  if (!chunk) return Damaged(offset, "the fields of a chunk do not fit into it");
  const std::uint64_t field_bytes = start->size() - fields.rest().size();
  if (chunk->stored_bytes > length - field_bytes) return Damaged(offset, "a chunk is longer than its record");
  if (chunk->size > limits_.chunk_bytes)
    return Damaged(offset, "a chunk of " + std::to_string(chunk->size) + " bytes is too long");
  return AddBlock(file, {.offset = offset + field_bytes,
                         .stored_bytes = chunk->stored_bytes,
                         .bytes = chunk->size,
                         .compression = std::string(chunk->compression),
                         .crc = chunk->crc});
}

Result<void> McapFile::AddBlock(const ReadableFile& file, McapBlock block) {
  unpacked_ += block.bytes;
  if (unpacked_ > limits_.unpacked_bytes + limits_.times_length * file.size())
    return Damaged(block.offset,
                   "the file unpacks to more than " + std::to_string(limits_.times_length) + " times its length");
  const auto content = UnpackBlock(file, block, true);
  if (!content) return At(block.offset, content.error());
  block.first_time = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t last_time = 0;
  FieldReader records(*content);
  while (!records.rest().empty()) {
    const std::uint64_t offset = content->size() - records.rest().size();
    const auto damaged = [&](const std::string& why) {
      return Damaged(block.offset, why + " (byte " + std::to_string(offset) + " of the part that begins here)");
    };
    const auto record = TakeRecord(records);
    if (!record) return damaged("a record is cut off");
    if (record->op == McapOp::kSchema) {
      if (auto added = AddSchema(block.offset, record->content); !added) return added;
    } else if (record->op == McapOp::kChannel) {
      if (auto added = AddChannel(block.offset, record->content); !added) return added;
    } else if (record->op == McapOp::kMessage) {
      const auto message = ParseMessage(record->content);
      if (!message) return damaged("a message is cut off");
      const auto channel = channels_.find(message->channel);
      if (channel == channels_.end()) return damaged("a message is on a channel that was not announced");
      block.first_time = std::min(block.first_time, message->log_time);
      last_time = std::max(last_time, message->log_time);
      block.topics |= TopicBit(channel->second);
    }
  }
  if (block.topics == 0) return {};
  if (blocks_.size() >= kMaxBlocks) return Damaged(block.offset, "more than a million chunks");
  blocks_.push_back(std::move(block));
  return {};
}

Result<void> McapFile::AddSchema(std::uint64_t offset, std::string_view content) {
  const auto schema = ParseSchema(content);
  if (!schema) return Damaged(offset, "a schema is cut off");
  const auto [known, is_new] = schemas_.try_emplace(schema->id, schema->name);
  if (!is_new && known->second != schema->name) return Damaged(offset, "two schemas have the same number");
  return {};
}

Result<void> McapFile::AddChannel(std::uint64_t offset, std::string_view content) {
  const auto channel = ParseChannel(content);
  if (!channel) return Damaged(offset, "a channel is cut off");
  const auto schema = schemas_.find(channel->schema);
  // Number 0 means that there is no schema.
  if (schema == schemas_.end() && channel->schema != 0) return Damaged(offset, "a channel's schema was not announced");
  Topic topic{std::string(channel->topic), schema == schemas_.end() ? std::string() : schema->second,
              std::string(channel->encoding)};
  if (const auto known = channels_.find(channel->id); known != channels_.end()) {
    if (topics_[known->second] != topic) return Damaged(offset, "two channels have the same number");
    return {};
  }
  // Each publisher of a topic has a channel of its own.
  auto same = std::find(topics_.begin(), topics_.end(), topic);
  if (same == topics_.end()) {
    if (topics_.size() >= kMaxTopics) return Damaged(offset, "too many topics");
    same = topics_.insert(same, std::move(topic));
  }
  channels_.emplace(channel->id, static_cast<std::size_t>(same - topics_.begin()));
  return {};
}

Result<void> McapFile::Read(const std::vector<std::size_t>& wanted, const Sink& sink) const {
  auto file = ReadableFile::Open(path_);
  if (!file) return tl::unexpected(file.error());
  McapMerge merge(*file, blocks_, channels_, wanted, limits_.open_bytes);
  for (;;) {
    const auto message = merge.Next();
    if (!message) return Fail(message.error().code, path_.string() + ": " + message.error().message);
    if (!*message || !sink((*message)->topic, (*message)->bytes)) return {};
  }
}

}  // namespace

Result<std::unique_ptr<File>> OpenMcap(const std::filesystem::path& path, const McapLimits& limits) {
  auto file = std::make_unique<McapFile>(path, limits);
  if (auto surveyed = file->Survey(); !surveyed) return tl::unexpected(surveyed.error());
  return file;
}

}  // namespace cairn::bag
