#include "common/bag/mcap_merge.h"

#include <algorithm>
#include <utility>

#include "common/bag/mcap_records.h"
#include "common/bag/unpack.h"

namespace cairn::bag {

Result<std::string> UnpackBlock(const ReadableFile& file, const McapBlock& block, bool check) {
  const auto stored = file.Read(block.offset, block.stored_bytes);
  if (!stored) return tl::unexpected(stored.error());
  auto content = Unpack(*stored, block.compression, block.bytes);
  if (content && check && block.crc != 0 && Crc32(*content) != block.crc)
    return Fail(StatusCode::kDataLoss, "the checksum of a chunk is wrong");
  return content;
}

McapMerge::McapMerge(const ReadableFile& file, const std::vector<McapBlock>& blocks, const ChannelTopics& channels,
                     const std::vector<std::size_t>& wanted, std::uint64_t open_bytes_limit)
    : file_(file), blocks_(blocks), channels_(channels), open_bytes_limit_(open_bytes_limit) {
  std::uint64_t topics = 0;
  for (const std::size_t topic : wanted) {
    topics |= TopicBit(topic);
    if (topic >= wanted_.size()) wanted_.resize(topic + 1, false);
    wanted_[topic] = true;
  }
  for (std::size_t i = 0; i < blocks.size(); ++i)
    if ((blocks[i].topics & topics) != 0) waiting_.push_back(i);
  std::stable_sort(waiting_.begin(), waiting_.end(),
                   [&](std::size_t a, std::size_t b) { return blocks[a].first_time < blocks[b].first_time; });
  std::reverse(waiting_.begin(), waiting_.end());
}

Result<std::optional<McapMerge::Message>> McapMerge::Next() {
  if (given_) {
    const auto block = open_.find(*given_);
    if (++block->second.next < block->second.entries.size()) {
      heads_.push({block->second.entries[block->second.next].time, *given_});
    } else {
      open_bytes_ -= block->second.content.size();
      open_.erase(block);
    }
    given_.reset();
  }
  while (!waiting_.empty() && (heads_.empty() || blocks_[waiting_.back()].first_time <= heads_.top().time)) {
    if (auto opened = Open(waiting_.back()); !opened) return tl::unexpected(opened.error());
    waiting_.pop_back();
  }
  if (heads_.empty()) return std::nullopt;
  given_ = heads_.top().block;
  heads_.pop();
  const OpenBlock& block = open_.at(*given_);
  return Message{block.entries[block.next].topic, block.entries[block.next].bytes};
}

Result<void> McapMerge::Open(std::size_t number) {
  const McapBlock& block = blocks_[number];
  const std::string place = "byte " + std::to_string(block.offset) + ": ";
  if (open_bytes_ + block.bytes > open_bytes_limit_)
    return Fail(StatusCode::kResourceExhausted, place + "too many chunks overlap in time");
  auto content = UnpackBlock(file_, block, false);
  if (!content) return Fail(content.error().code, place + content.error().message);
  OpenBlock& opened = open_[number];
  opened.content = *std::move(content);
  FieldReader records(opened.content);
  while (!records.rest().empty()) {
    const auto record = TakeRecord(records);
    if (!record) break;
    if (record->op != McapOp::kMessage) continue;
    const auto message = ParseMessage(record->content);
    const auto channel = message ? channels_.find(message->channel) : channels_.end();
    if (channel == channels_.end() || channel->second >= wanted_.size() || !wanted_[channel->second]) continue;
    opened.entries.push_back({message->log_time, channel->second, message->content});
  }
  if (opened.entries.empty()) {
    open_.erase(number);
    return {};
  }
  std::stable_sort(opened.entries.begin(), opened.entries.end(),
                   [](const Entry& a, const Entry& b) { return a.time < b.time; });
  open_bytes_ += opened.content.size();
  heads_.push({opened.entries.front().time, number});
  return {};
}

}  // namespace cairn::bag
