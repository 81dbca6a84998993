// The messages of some topics of an MCAP file in the order of the time when they were recorded, from blocks (chunks,
// and runs of records outside of chunks) that may overlap in time. A block is unpacked when the time of its first
// message is reached, and let go after its last one. Not thread-safe. What it refers to must outlive it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <queue>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "common/bag/readable_file.h"
#include "common/status.h"

namespace cairn::bag {

struct McapBlock {
  std::uint64_t offset = 0;  // Of its bytes in the file.
  std::uint64_t stored_bytes = 0;
  std::uint64_t bytes = 0;  // Unpacked.
  std::string compression;
  std::uint32_t crc = 0;         // 0: not known.
  std::uint64_t first_time = 0;  // The earliest of its messages.
  std::uint64_t topics = 0;      // The TopicBits of its messages.
};

// Many topics share a bit: a block that has the bit of a topic may still hold none of its messages.
[[nodiscard]] constexpr std::uint64_t TopicBit(std::size_t topic) {
  return std::uint64_t{1} << (topic % 64);
}

// Its records. `check`: also compares the checksum.
[[nodiscard]] Result<std::string> UnpackBlock(const ReadableFile& file, const McapBlock& block, bool check);

using ChannelTopics = std::unordered_map<std::uint16_t, std::size_t>;

class McapMerge {
 public:
  struct Message {
    std::size_t topic = 0;
    std::string_view bytes;  // Valid until the next call.
  };

  McapMerge(const ReadableFile& file, const std::vector<McapBlock>& blocks, const ChannelTopics& channels,
            const std::vector<std::size_t>& wanted, std::uint64_t open_bytes_limit);

  // Nothing after the last one. An error names the place in the file.
  [[nodiscard]] Result<std::optional<Message>> Next();

 private:
  struct Entry {
    std::uint64_t time = 0;
    std::size_t topic = 0;
    std::string_view bytes;
  };
  struct OpenBlock {
    std::string content;
    std::vector<Entry> entries;  // In the order of time.
    std::size_t next = 0;
  };
  // The next message of an open block; the earliest comes first.
  struct Head {
    std::uint64_t time = 0;
    std::size_t block = 0;
    bool operator<(const Head& other) const { return time != other.time ? time > other.time : block > other.block; }
  };

  Result<void> Open(std::size_t block);

  const ReadableFile& file_;
  const std::vector<McapBlock>& blocks_;
  const ChannelTopics& channels_;
  const std::uint64_t open_bytes_limit_;
  std::vector<bool> wanted_;          // By topic.
  std::vector<std::size_t> waiting_;  // Blocks that were not opened yet; the next one is the last.
  std::map<std::size_t, OpenBlock> open_;
  std::uint64_t open_bytes_ = 0;
  std::priority_queue<Head> heads_;
  std::optional<std::size_t> given_;  // The block of the message that was given last.
};

}  // namespace cairn::bag
