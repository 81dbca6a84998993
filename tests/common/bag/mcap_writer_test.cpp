// What the writer writes, read by the reader and, for the parts that it does not use, field by field.
#include "common/bag/mcap_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <map>
#include <string>
#include <vector>

#include "common/bag/mcap_file.h"
#include "common/bag/unpack.h"
#include "tests/must.h"
#include "tests/temp_directory.h"

namespace cairn::bag {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class McapWriting : public ::testing::Test {
 protected:
  std::unique_ptr<McapWriter> Create(const McapWriterOptions& options = {}) {
    auto writer = test::Must(McapWriter::Create(path_, options));
    const auto schema = test::Must(writer->AddSchema("a.A", "protobuf", "the fields"));
    a_ = test::Must(writer->AddChannel(schema, "/a", "protobuf"));
    b_ = test::Must(writer->AddChannel(schema, "/b", "protobuf"));
    return writer;
  }
  // Message i is on /a or /b in turn, at time 1000 + i.
  void Write(McapWriter& writer, int from, int count, const std::string& text = "message ") const {
    for (int i = from; i < from + count; ++i) {
      const auto time = static_cast<std::uint64_t>(1000 + i);
      test::Must(writer.Write(i % 2 == 0 ? a_ : b_, time, time, text + std::to_string(i)));
    }
  }
  // All messages as text; the reader's notes are in notes_.
  std::vector<std::string> Read(const std::filesystem::path& path) {
    const auto file = test::Must(OpenMcap(path));
    notes_ = file->notes();
    topics_ = file->topics();
    std::vector<std::size_t> all(topics_.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    std::vector<std::string> messages;
    test::Must(file->Read(all, [&](std::size_t, std::string_view message) {
      messages.emplace_back(message);
      return true;
    }));
    return messages;
  }

  const TempDirectory directory_;
  const std::filesystem::path path_ = directory_ / "out.mcap";
  std::uint16_t a_ = 0, b_ = 0;
  std::vector<std::string> notes_;
  std::vector<Topic> topics_;
};

TEST_F(McapWriting, IsReadBack) {
  const auto writer = Create({.chunk_bytes = 200});
  Write(*writer, 0, 50);
  test::Must(writer->Finish());
  const std::vector<std::string> messages = Read(path_);
  ASSERT_EQ(messages.size(), 50U);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(messages[static_cast<std::size_t>(i)], "message " + std::to_string(i));
  EXPECT_THAT(topics_, ElementsAre(Topic{"/a", "a.A", "protobuf"}, Topic{"/b", "a.A", "protobuf"}));
  EXPECT_THAT(notes_, IsEmpty());
  EXPECT_EQ(writer->messages(), 50U);
  EXPECT_EQ(writer->bytes(), std::filesystem::file_size(path_));
  EXPECT_FALSE(writer->Write(a_, 1, 1, "late")) << "the file was finished";
}

// The place of every record of this kind, and its content.
struct Placed {
  std::uint64_t offset = 0;
  std::string_view content;
};
std::multimap<McapOp, Placed> RecordsOf(std::string_view file) {
  std::multimap<McapOp, Placed> records;
  FieldReader bytes(file.substr(kMcapMagic.size(), file.size() - 2 * kMcapMagic.size()));
  while (!bytes.rest().empty()) {
    const std::uint64_t offset = file.size() - kMcapMagic.size() - bytes.rest().size();
    const auto record = TakeRecord(bytes);
    if (!record) throw std::runtime_error("a record is cut off");
    records.emplace(record->op, Placed{offset, record->content});
  }
  return records;
}
std::uint64_t CountOf(const std::multimap<McapOp, Placed>& records, McapOp op) {
  return records.count(op);
}

// Readers that seek go from the footer to the summary, to the index of a chunk, to the index of a channel, to a
// message.
TEST_F(McapWriting, IndexesLeadToEveryMessage) {
  const auto writer = Create({.chunk_bytes = 300});
  Write(*writer, 0, 40);
  test::Must(writer->Finish());
  const std::string file = directory_.Read("out.mcap");
  EXPECT_TRUE(file.ends_with(kMcapMagic));
  const auto records = RecordsOf(file);
  const Placed footer = records.find(McapOp::kFooter)->second;
  FieldReader foot(footer.content);
  const auto summary_start = foot.Take<std::uint64_t>();
  const auto offsets_start = foot.Take<std::uint64_t>();
  const std::uint64_t crc_at = footer.offset + kRecordHeaderBytes + 16;
  EXPECT_EQ(foot.Take<std::uint32_t>(), Crc32(std::string_view(file).substr(summary_start, crc_at - summary_start)));
  const Placed data_end = records.find(McapOp::kDataEnd)->second;
  EXPECT_EQ(FieldReader(data_end.content).Take<std::uint32_t>(),
            Crc32(std::string_view(file).substr(0, data_end.offset)));
  EXPECT_EQ(summary_start, data_end.offset + kRecordHeaderBytes + data_end.content.size());

  std::vector<std::string> found(40);
  ASSERT_GT(CountOf(records, McapOp::kChunkIndex), 3U);
  EXPECT_EQ(CountOf(records, McapOp::kChunkIndex), CountOf(records, McapOp::kChunk));
  const auto [first, last] = records.equal_range(McapOp::kChunkIndex);
  for (auto index = first; index != last; ++index) {
    FieldReader fields(index->second.content);
    const auto first_time = fields.Take<std::uint64_t>(), last_time = fields.Take<std::uint64_t>();
    const auto start = fields.Take<std::uint64_t>(), length = fields.Take<std::uint64_t>();
    FieldReader places(fields.TakeString());
    const auto index_bytes = fields.Take<std::uint64_t>();
    EXPECT_EQ(fields.TakeString(), "zstd");
    const auto stored = fields.Take<std::uint64_t>(), size = fields.Take<std::uint64_t>();
    ASSERT_TRUE(fields.ok());
    FieldReader chunk_bytes(std::string_view(file).substr(start, length));
    const auto chunk = TakeRecord(chunk_bytes);
    ASSERT_TRUE(chunk && chunk->op == McapOp::kChunk && chunk_bytes.rest().empty());
    const std::string content = test::Must(Unpack(chunk->content.substr(chunk->content.size() - stored), "zstd", size));
    std::uint64_t seen_bytes = 0;
    while (!places.rest().empty()) {
      const auto channel = places.Take<std::uint16_t>();
      FieldReader at(std::string_view(file).substr(places.Take<std::uint64_t>()));
      const auto message_index = TakeRecord(at);
      ASSERT_TRUE(message_index && message_index->op == McapOp::kMessageIndex);
      seen_bytes += kRecordHeaderBytes + message_index->content.size();
      FieldReader entries(message_index->content);
      EXPECT_EQ(entries.Take<std::uint16_t>(), channel);
      FieldReader pairs(entries.TakeString());
      while (!pairs.rest().empty()) {
        const auto time = pairs.Take<std::uint64_t>(), offset = pairs.Take<std::uint64_t>();
        FieldReader message_bytes(std::string_view(content).substr(offset));
        const auto record = TakeRecord(message_bytes);
        ASSERT_TRUE(record && record->op == McapOp::kMessage);
        const auto message = ParseMessage(record->content);
        ASSERT_TRUE(message && message->channel == channel && message->log_time == time);
        EXPECT_TRUE(time >= first_time && time <= last_time);
        found.at(time - 1000) = message->content;
      }
    }
    EXPECT_EQ(seen_bytes, index_bytes);
  }
  for (int i = 0; i < 40; ++i) EXPECT_EQ(found[static_cast<std::size_t>(i)], "message " + std::to_string(i));

  // The summary's parts are where the offsets say.
  std::uint64_t groups = 0;
  const auto [first_offset, last_offset] = records.equal_range(McapOp::kSummaryOffset);
  for (auto offset = first_offset; offset != last_offset; ++offset, ++groups) {
    FieldReader fields(offset->second.content);
    const auto op = fields.Take<McapOp>();
    FieldReader group(
        std::string_view(file).substr(fields.Take<std::uint64_t>()).substr(0, fields.Take<std::uint64_t>()));
    EXPECT_GE(offset->second.offset, offsets_start);
    ASSERT_FALSE(group.rest().empty());
    while (!group.rest().empty()) EXPECT_EQ(TakeRecord(group).value().op, op);
  }
  EXPECT_EQ(groups, 4U) << "schemas, channels, statistics, indexes of chunks";
  FieldReader statistics(records.find(McapOp::kStatistics)->second.content);
  EXPECT_EQ(statistics.Take<std::uint64_t>(), 40U);
  EXPECT_EQ(statistics.Take<std::uint16_t>(), 1U);
  EXPECT_EQ(statistics.Take<std::uint32_t>(), 2U);
}

// A recorder that is killed: whatever the last byte is, whole chunks are read.
TEST_F(McapWriting, WithoutItsEndIsReadToTheLastChunk) {
  const auto writer = Create();
  std::vector<std::uint64_t> ends;
  for (int chunk = 0; chunk < 3; ++chunk) {
    Write(*writer, chunk * 4, 4);
    test::Must(writer->EndChunk());
    ends.push_back(writer->bytes());
  }
  test::Must(writer->EndChunk());
  EXPECT_EQ(writer->bytes(), ends.back()) << "an empty chunk is none";
  const std::string whole = directory_.Read("out.mcap");
  ASSERT_EQ(whole.size(), ends.back());
  for (std::size_t bytes = ends[0]; bytes <= whole.size(); ++bytes) {
    const auto messages = Read(directory_.Write("cut.mcap", whole.substr(0, bytes)));
    ASSERT_THAT(notes_, ElementsAre(HasSubstr("its end is missing")));
    // The indexes behind a chunk may be cut off: the chunk is whole.
    ASSERT_GE(messages.size(), bytes >= ends[2] ? 12U : bytes >= ends[1] ? 8U : 4U) << bytes;
  }
}

TEST_F(McapWriting, OverwritesNothingUnasked) {
  static_cast<void>(directory_.Write("out.mcap", "precious"));
  const auto refused = McapWriter::Create(path_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, StatusCode::kAlreadyExists);
  EXPECT_EQ(directory_.Read("out.mcap"), "precious");
  const auto writer = Create({.overwrite = true});
  test::Must(writer->Finish());
  EXPECT_THAT(Read(path_), IsEmpty());
  EXPECT_EQ(McapWriter::Create(directory_ / "no/such/folder.mcap").error().code, StatusCode::kNotFound);
}

TEST_F(McapWriting, AFullDiskIsAnError) {
  const auto full = McapWriter::Create("/dev/full", {.overwrite = true});
  ASSERT_FALSE(full);
  EXPECT_EQ(full.error().code, StatusCode::kResourceExhausted);
  EXPECT_THAT(full.error().message, HasSubstr("/dev/full: cannot write: No space left on device"));
}

// A limit of the file's size for this process, with the error that a disk without room gives.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(std::uint64_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  void (*handler_)(int);
  rlimit before_{};
};

TEST_F(McapWriting, OnADiskThatFillsUpTheFileKeepsItsChunksAndGetsItsEnd) {
  const auto writer = Create();
  Write(*writer, 0, 4);
  test::Must(writer->EndChunk());
  const std::uint64_t good = writer->bytes();
  Result<void> written;
  {
    const FileSizeLimit limit(good + 1000);
    // Numbers that do not pack well, so that the chunk needs more than 1000 bytes.
    std::string noise;
    for (std::uint32_t i = 0; i < 1000; ++i) noise += std::to_string(i * 2654435761U) + ",";
    test::Must(writer->Write(a_, 2000, 2000, noise));
    written = writer->EndChunk();
  }
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, StatusCode::kResourceExhausted);
  EXPECT_EQ(writer->Write(a_, 3000, 3000, "more").error().message, written.error().message);
  EXPECT_THAT(Read(path_), ElementsAre("message 0", "message 1", "message 2", "message 3"));
  EXPECT_THAT(notes_, IsEmpty()) << "there was room for the end";
  const std::string file = directory_.Read("out.mcap");
  FieldReader statistics(RecordsOf(file).find(McapOp::kStatistics)->second.content);
  EXPECT_EQ(statistics.Take<std::uint64_t>(), 4U);
  // After eight numbers that do not matter here: the messages of each channel, without those that found no room.
  static_cast<void>(statistics.TakeBytes(2 + 4 * 4 + 2 * 8));
  FieldReader counts(statistics.TakeString());
  for (const std::uint16_t channel : {a_, b_}) {
    EXPECT_EQ(counts.Take<std::uint16_t>(), channel);
    EXPECT_EQ(counts.Take<std::uint64_t>(), 2U);
  }
}

TEST_F(McapWriting, WithNoRoomForTheEndTheFileStaysReadable) {
  const auto writer = Create();
  Write(*writer, 0, 4);
  test::Must(writer->EndChunk());
  Write(*writer, 4, 4);
  {
    const FileSizeLimit limit(writer->bytes() + 10);
    EXPECT_FALSE(writer->EndChunk());
  }
  EXPECT_THAT(Read(path_), ElementsAre("message 0", "message 1", "message 2", "message 3"));
  EXPECT_THAT(notes_, ElementsAre(HasSubstr("its end is missing")));
}

}  // namespace
}  // namespace cairn::bag
