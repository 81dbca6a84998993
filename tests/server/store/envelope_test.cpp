#include "server/store/envelope.h"

#include <gtest/gtest.h>

#include <string>

namespace cairn::server {
namespace {

constexpr RecordKey kKey{RecordKind::kJournal, 7, 9};

std::string Content(std::size_t size) {
  std::string content;
  for (std::size_t i = 0; i < size; ++i) content.push_back(static_cast<char>(i * i % 23));
  return content;
}

TEST(Envelope, GivesBackWhatWasSealedShortOrLong) {
  EnvelopeCodec codec;
  for (const std::size_t size : {0U, 1U, 127U, 128U, 5000U, 300000U}) {
    const std::string sealed = codec.Seal(kKey, Content(size));
    EXPECT_TRUE(size < 1000 || sealed.size() < size / 2);
    const auto opened = codec.Open(kKey, sealed);
    ASSERT_TRUE(opened) << size;
    EXPECT_EQ(*opened, Content(size));
  }
}

TEST(Envelope, EveryChangedByteAndEveryCutIsFound) {
  EnvelopeCodec codec;
  for (const std::size_t size : {20U, 900U}) {
    const std::string sealed = codec.Seal(kKey, Content(size));
    for (std::size_t at = 0; at < sealed.size(); ++at) {
      for (const int bit : {1, 128}) {
        std::string changed = sealed;
        changed[at] = static_cast<char>(changed[at] ^ bit);
        EXPECT_FALSE(codec.Open(kKey, changed)) << at;
      }
      EXPECT_FALSE(codec.Open(kKey, sealed.substr(0, at))) << at;
    }
  }
}

TEST(Envelope, ARecordUnderAnotherKeyIsDamaged) {
  EnvelopeCodec codec;
  const auto opened = codec.Open({RecordKind::kJournal, 7, 10}, codec.Seal(kKey, "content"));
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, StatusCode::kDataLoss);
}

TEST(Envelope, ANewerFormatIsRefusedWithTheReason) {
  EnvelopeCodec codec;
  const auto opened = codec.Open(kKey, codec.Seal(kKey, "content", kRecordFormat + 1));
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, StatusCode::kFailedPrecondition);
  EXPECT_NE(opened.error().message.find("newer"), std::string::npos) << opened.error().message;
}

}  // namespace
}  // namespace cairn::server
