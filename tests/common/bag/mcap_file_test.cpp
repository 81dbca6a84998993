#include "common/bag/mcap_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/common/bag/bag_writer.h"
#include "tests/temp_directory.h"

namespace cairn::bag {
namespace {

using recorded::BagMessage;
using recorded::kMcapEnd;
using recorded::kMcapStart;
using recorded::McapChannelOf;
using recorded::McapChunkOf;
using recorded::McapMessageOf;
using recorded::McapOf;
using recorded::McapRecordOf;
using recorded::McapSchemaOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class McapFile : public ::testing::Test {
 protected:
  // The messages of the topics as text, or what the reader says instead.
  std::vector<std::string> Read(const std::string& bytes, std::vector<std::size_t> wanted = {0},
                                const McapLimits& limits = {}) {
    const auto file = OpenMcap(directory_.Write("bag.mcap", bytes), limits);
    if (!file) return {file.error().message};
    notes_ = (*file)->notes();
    topics_ = (*file)->topics();
    std::vector<std::string> messages;
    const auto read = (*file)->Read(wanted, [&](std::size_t, std::string_view message) {
      messages.emplace_back(message);
      return true;
    });
    if (!read) return {read.error().message};
    return messages;
  }

  const TempDirectory directory_;
  std::vector<std::string> notes_;
  std::vector<Topic> topics_;
};

const std::string kAnnounced = McapSchemaOf(1, "a/msg/A") + McapChannelOf(1, 1, "/a");

std::vector<BagMessage> Numbered(int count) {
  std::vector<BagMessage> messages;
  for (int i = 0; i < count; ++i)
    messages.push_back({i % 2 == 0 ? "/a" : "/b", "a/msg/A", static_cast<std::uint64_t>(i), std::to_string(i)});
  return messages;
}

TEST_F(McapFile, ReadsEveryCompression) {
  for (const char* compression : {"", "lz4", "zstd"})
    for (const std::size_t per_chunk : {0, 1, 2, 100})
      EXPECT_THAT(Read(McapOf(Numbered(5), compression, per_chunk)), ElementsAre("0", "2", "4"))
          << compression << " " << per_chunk;
  EXPECT_THAT(topics_, ElementsAre(Topic{"/a", "a/msg/A", "cdr"}, Topic{"/b", "a/msg/A", "cdr"}));
  EXPECT_THAT(notes_, IsEmpty());
  EXPECT_THAT(Read(McapOf(Numbered(5), "lz4", 2), {1}), ElementsAre("1", "3"));
  EXPECT_THAT(Read(McapOf(Numbered(5), "lz4", 2), {0, 1}), ElementsAre("0", "1", "2", "3", "4"));
}

// Chunks overlap in time where several threads record, and within one the order may be any.
TEST_F(McapFile, GivesMessagesInTheOrderOfTheirTimes) {
  const auto message = [](std::uint64_t time) { return McapMessageOf(1, time, std::to_string(time)); };
  const std::string file = kMcapStart + McapChunkOf(kAnnounced + message(9) + message(2) + message(5), "zstd") +
                           McapChunkOf(message(4) + message(1) + message(12), "lz4") +
                           McapMessageOf(1, 5, "5, later in the file") + message(3) + McapChunkOf(message(7), "") +
                           kMcapEnd;
  EXPECT_THAT(Read(file), ElementsAre("1", "2", "3", "4", "5", "5, later in the file", "7", "9", "12"));
}

TEST_F(McapFile, SeveralPublishersOfATopicAreOneTopic) {
  const std::string file = kMcapStart + kAnnounced + McapChannelOf(2, 1, "/a") + McapMessageOf(2, 1, "one") +
                           McapMessageOf(1, 2, "two") + kMcapEnd;
  EXPECT_THAT(Read(file), ElementsAre("one", "two"));
  EXPECT_EQ(topics_.size(), 1U);
}

TEST_F(McapFile, SkipsWhatItDoesNotNeed) {
  const std::string file = kMcapStart + McapRecordOf(9, std::string(5000, 'x')) + kAnnounced +
                           McapRecordOf(static_cast<char>(0x80), "ours") + McapMessageOf(1, 1, "one") +
                           McapRecordOf(12, "metadata") + kMcapEnd + "whatever follows the footer";
  EXPECT_THAT(Read(file), ElementsAre("one"));
}

// The recorder was killed: all that is whole is read, wherever the file ends.
TEST_F(McapFile, ReadsAFileWhoseEndIsMissing) {
  for (const char* compression : {"", "zstd"}) {
    const std::string whole = McapOf(Numbered(6), compression, 2);
    std::size_t most = 0;
    for (std::size_t bytes = kMcapStart.size(); bytes < whole.size() - kMcapEnd.size(); ++bytes) {
      const std::vector<std::string> messages = Read(whole.substr(0, bytes), {0, 1});
      ASSERT_THAT(notes_, ElementsAre(HasSubstr("its end is missing from byte")));
      ASSERT_GE(messages.size(), most);
      ASSERT_EQ(messages.size() % 2, 0U);
      most = messages.size();
    }
    EXPECT_EQ(most, 4U);
  }
}

TEST_F(McapFile, SaysWhereAFileIsDamaged) {
  const std::string good = McapOf(Numbered(40), "", 20);
  std::string flipped = good;
  flipped[good.size() - kMcapEnd.size() - 3] ^= 1;  // Within the last message: only the checksum shows it.
  EXPECT_THAT(Read(flipped), ElementsAre(HasSubstr("checksum of a chunk is wrong")));
  EXPECT_THAT(Read(flipped), ElementsAre(::testing::ContainsRegex("byte [0-9]+: ")));
  std::string zero = kMcapStart + kAnnounced + std::string(20, '\0');
  EXPECT_THAT(Read(zero), ElementsAre(HasSubstr("byte " + std::to_string(kMcapStart.size() + kAnnounced.size()) +
                                                ": no record begins here")));
  EXPECT_THAT(Read(kMcapStart + McapMessageOf(3, 1, "x") + kMcapEnd), ElementsAre(HasSubstr("not announced")));
  EXPECT_THAT(Read(kMcapStart + McapChannelOf(1, 1, "/a") + kMcapEnd), ElementsAre(HasSubstr("schema was not")));
  EXPECT_THAT(Read(kMcapStart + kAnnounced + McapChannelOf(1, 1, "/b") + kMcapEnd),
              ElementsAre(HasSubstr("two channels have the same number")));
  EXPECT_THAT(Read(kMcapStart + McapRecordOf(5, "short") + kMcapEnd), ElementsAre(HasSubstr("a message is cut off")));
  EXPECT_THAT(Read(kMcapStart + McapChunkOf(kAnnounced + "\5junk", "zstd") + kMcapEnd),
              ElementsAre(HasSubstr("a record is cut off")));
  EXPECT_THAT(Read(kMcapStart + McapChunkOf(kAnnounced, "brotli") + kMcapEnd), ElementsAre(HasSubstr("compression")));
  EXPECT_THAT(Read("\x89MCAP1\r\nwhatever"), ElementsAre(HasSubstr("version")));
}

// What a length says is never believed before the bytes are there.
TEST_F(McapFile, LengthsThatLieAreRefused) {
  using recorded::McapText;
  using recorded::Raw;
  const auto chunk = [&](std::uint64_t size, const std::string& compression, std::uint64_t stored,
                         const std::string& bytes) {
    return kMcapStart +
           McapRecordOf(6, Raw(std::uint64_t{0}) + Raw(std::uint64_t{0}) + Raw(size) + Raw(std::uint32_t{0}) +
                               McapText(compression) + Raw(stored) + bytes) +
           kMcapEnd;
  };
  const std::string records = kAnnounced + McapMessageOf(1, 1, "one");
  const std::string zstd = recorded::PackZstd(records), lz4 = recorded::PackLz4(records);
  EXPECT_THAT(Read(chunk(records.size(), "zstd", zstd.size(), zstd)), ElementsAre("one"));
  EXPECT_THAT(Read(chunk(records.size(), "lz4", lz4.size(), lz4)), ElementsAre("one"));
  for (const std::uint64_t size : {records.size() - 1, records.size() + 1, std::size_t{0}}) {
    EXPECT_THAT(Read(chunk(size, "zstd", zstd.size(), zstd)), ElementsAre(HasSubstr("zstd"))) << size;
    EXPECT_THAT(Read(chunk(size, "lz4", lz4.size(), lz4)), ElementsAre(HasSubstr("lz4"))) << size;
    EXPECT_THAT(Read(chunk(size, "", records.size(), records)), ElementsAre(HasSubstr("lengths differ"))) << size;
  }
  EXPECT_THAT(Read(chunk(std::uint64_t{1} << 62, "zstd", zstd.size(), zstd)), ElementsAre(HasSubstr("too long")));
  EXPECT_THAT(Read(chunk(10, "", ~std::uint64_t{0}, "")), ElementsAre(HasSubstr("longer than its record")));
  EXPECT_THAT(Read(chunk(10, std::string(100, 'x'), 0, "")), ElementsAre(HasSubstr("do not fit")));
  EXPECT_THAT(Read(chunk(records.size(), "lz4", lz4.size() - 1, lz4)), ElementsAre(HasSubstr("lz4")));
}

TEST_F(McapFile, MemoryAndTimeAreBounded) {
  const auto message = [](std::uint64_t time) { return McapMessageOf(1, time, std::string(1000, 'x')); };
  std::string file = kMcapStart + kAnnounced;
  for (std::uint64_t i = 0; i < 10; ++i) file += McapChunkOf(message(i) + message(100), "lz4");
  EXPECT_EQ(Read(file + kMcapEnd).size(), 20U);
  EXPECT_THAT(Read(file + kMcapEnd, {0}, {.chunk_bytes = 10'000, .open_bytes = 8'000, .unpacked_bytes = 1 << 20}),
              ElementsAre(HasSubstr("too many chunks overlap")));
  EXPECT_THAT(Read(file + kMcapEnd, {0}, {.chunk_bytes = 1'000, .open_bytes = 80'000, .unpacked_bytes = 1 << 20}),
              ElementsAre(HasSubstr("too long")));
  // Much from little: zeros pack to nearly nothing.
  const std::string zeros = kMcapStart + McapChunkOf(McapRecordOf(9, std::string(4 << 20, '\0')), "zstd") + kMcapEnd;
  EXPECT_THAT(Read(zeros), IsEmpty());
  EXPECT_THAT(Read(zeros, {0}, {.unpacked_bytes = 1'000}), ElementsAre(HasSubstr("1000 times its length")));
}

}  // namespace
}  // namespace cairn::bag
