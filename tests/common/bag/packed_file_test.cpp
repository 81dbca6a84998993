#include "common/bag/packed_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/common/bag/bag_writer.h"
#include "tests/temp_directory.h"

namespace cairn::bag {
namespace {

using recorded::McapOf;
using recorded::PackZstd;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> MessagesOf(const File& file) {
  std::vector<std::string> messages;
  const auto read = file.Read({0}, [&](std::size_t, std::string_view message) {
    messages.emplace_back(message);
    return true;
  });
  if (!read) return {read.error().message};
  return messages;
}

class PackedBag : public ::testing::Test {
 protected:
  std::string ErrorOf(const std::string& bytes, const PackedLimits& limits = {}) const {
    const auto file = OpenPacked(directory_.Write("bag.zstd", bytes), limits);
    return file ? "" : file.error().message;
  }

  const TempDirectory directory_;
  const std::vector<recorded::BagMessage> messages_ = {
      {"/a", "A", 1, "one"}, {"/b", "B", 2, "two"}, {"/a", "A", 3, "three"}};
};

TEST_F(PackedBag, IsUnpackedAgainAfterItWasLetGo) {
  recorded::WriteSqlite(directory_ / "bag.db3", messages_);
  for (const std::string& content : {McapOf(messages_, "zstd", 2), directory_.Read("bag.db3")}) {
    const auto path = directory_.Write("bag.zstd", PackZstd(content));
    const auto file = OpenPacked(path);
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_THAT((*file)->topics(), ElementsAre(Topic{"/a", "A", "cdr"}, Topic{"/b", "B", "cdr"}));
    for (int reading = 0; reading < 2; ++reading) EXPECT_THAT(MessagesOf(**file), ElementsAre("one", "three"));
    (*file)->LetGo();
    EXPECT_THAT(MessagesOf(**file), ElementsAre("one", "three"));
    (*file)->LetGo();
    static_cast<void>(directory_.Write("bag.zstd", PackZstd(McapOf({{"/c", "C", 1, "other"}}, "", 0))));
    EXPECT_THAT(MessagesOf(**file), ElementsAre(HasSubstr("bag.zstd: it has changed while it was read")));
  }
}

// The end of a frame, or of the packed bytes, may meet the end of a buffer.
TEST_F(PackedBag, MayHaveAnyLength) {
  for (const std::size_t bytes : {131'072UL - 60, 131'072UL, 131'072UL * 2, 400'000UL}) {
    std::string message(bytes, 'x');
    for (std::size_t i = 0; i < bytes; ++i) message[i] = static_cast<char>(i * i % 251 * (i / 1000));
    const std::string packed = PackZstd(McapOf({{"/a", "A", 1, message}}, "", 0));
    const auto file = OpenPacked(directory_.Write("bag.zstd", packed));
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_THAT(MessagesOf(**file), ElementsAre(message));
    EXPECT_THAT(ErrorOf(packed.substr(0, packed.size() / 2)), HasSubstr("the end is missing"));
  }
  const std::string exact = PackZstd(std::string(131'072, 'x'));
  EXPECT_THAT(ErrorOf(exact), HasSubstr("neither MCAP")) << "a buffer that is full at the end is not cut off";
}

TEST_F(PackedBag, SaysWhatIsWrongWithIt) {
  std::string damaged = PackZstd(McapOf(messages_, "", 0));
  damaged[5] = static_cast<char>(damaged[5] ^ 0x55);
  damaged[20] = static_cast<char>(damaged[20] ^ 0x55);
  EXPECT_THAT(ErrorOf(damaged), HasSubstr("bag.zstd"));
  EXPECT_THAT(ErrorOf(PackZstd(PackZstd(McapOf(messages_, "", 0)))), HasSubstr("unpacked: neither MCAP"));
  const std::string cut = McapOf({{"/a", "A", 1, "one"}}, "", 0);
  const auto file = OpenPacked(directory_.Write("bag.zstd", PackZstd(cut.substr(0, cut.size() - 60))));
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_THAT((*file)->notes(), ElementsAre(HasSubstr("bag.zstd, unpacked: its end is missing")));
  const PackedLimits small = {.bytes = 10'000, .times_length = 2};
  EXPECT_THAT(ErrorOf(PackZstd(std::string(1'000'000, '\0')), small), HasSubstr("it unpacks to more than"));
}

// Whatever comes of it, nothing is left behind.
TEST_F(PackedBag, LeavesNoFile) {
  const char* const before = std::getenv("TMPDIR");
  const std::string kept = before == nullptr ? "" : before;
  const std::filesystem::path temporary = directory_ / "temporary";
  setenv("TMPDIR", temporary.c_str(), 1);
  EXPECT_THAT(ErrorOf(PackZstd(McapOf(messages_, "", 0))), HasSubstr("no directory for temporary files"));
  std::filesystem::create_directory(temporary);
  const auto file = OpenPacked(directory_.Write("open.zstd", PackZstd(McapOf(messages_, "", 0))));
  EXPECT_TRUE(file.has_value());
  EXPECT_THAT(ErrorOf(PackZstd("no bag")), HasSubstr("neither MCAP"));
  EXPECT_THAT(ErrorOf("\x28\xb5\x2f\xfd, and no more"), HasSubstr("zstd"));
  EXPECT_TRUE(std::filesystem::is_empty(temporary));
  unsetenv("TMPDIR");
  if (before != nullptr) setenv("TMPDIR", kept.c_str(), 1);
}

}  // namespace
}  // namespace cairn::bag
