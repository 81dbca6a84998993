#include "server/store/site_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <iterator>

#include "server/store/site_edit.h"
#include "tests/server/store/stored_sites.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

std::string BytesAt(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void WriteBytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

template <typename Number>
std::string BytesOfNumber(Number number) {
  std::string bytes(sizeof(number), '\0');
  std::memcpy(bytes.data(), &number, sizeof(number));
  return bytes;
}

// The records between header and end as the file has them, each with its length.
std::vector<std::string> BlocksOf(const std::string& bytes) {
  std::vector<std::string> blocks;
  for (std::size_t at = 12;;) {
    std::uint32_t length = 0;
    std::memcpy(&length, bytes.data() + at, sizeof(length));
    if (length == 0) return blocks;
    blocks.push_back(bytes.substr(at, 4 + length));
    at += 4 + length;
  }
}

// A file with a right number of records and a right checksum.
std::string FileOf(const std::vector<std::string>& blocks, std::uint32_t format = kSiteFileFormat) {
  std::string bytes = "cairnste" + BytesOfNumber(format);
  for (const std::string& block : blocks) bytes += block;
  bytes += BytesOfNumber(std::uint32_t{0}) + BytesOfNumber(static_cast<std::uint64_t>(blocks.size()));
  Checksum sum;
  sum.Add(bytes);
  return bytes + BytesOfNumber(sum.value());
}

class SiteFile : public ::testing::Test {
 protected:
  SiteFile() : path_(directory_ / "lab.site") {
    Put(*store_, {});
    const auto written = WriteSiteFile(*store_, "lab", path_);
    EXPECT_TRUE(written) << written.error().message;
  }

  // The reason why a file of these bytes is refused, by whoever reads it; empty where it is not. Nothing may be
  // changed.
  Status Refused(const std::string& bytes) {
    const auto path = directory_ / "other.site";
    WriteBytes(path, bytes);
    const auto into = MemoryStore();
    const auto imported = ImportSite(*into, path);
    EXPECT_TRUE(imported || Everything(*into).empty());
    return imported ? Status{} : imported.error();
  }

  TempDirectory directory_;
  const std::unique_ptr<Store> store_ = MemoryStore();
  const std::filesystem::path path_;
};

TEST_F(SiteFile, EveryRecordComesBackWithTheSameBytes) {
  const auto into = MemoryStore();
  const auto summary = ImportSite(*into, path_);
  ASSERT_TRUE(summary) << summary.error().message;
  EXPECT_EQ(Everything(*into), Everything(*store_));
  EXPECT_EQ(summary->site.name, "lab");
  EXPECT_EQ(summary->sessions, (std::map<std::uint64_t, std::string>{{1, "r1"}, {2, "r2"}}));
  EXPECT_EQ(summary->entries, 8U);
  EXPECT_EQ(summary->session_numbers, (std::set<std::uint64_t>{1, 2, 3}));
  EXPECT_EQ(summary->jobs, std::set<std::uint64_t>{1});
  const auto checkpoint = ReadCheckpoint(*into, 2);
  ASSERT_TRUE(checkpoint && *checkpoint);
  EXPECT_EQ((*checkpoint)->bytes, "the state of session 2");
}

// What smoothing jobs have measured goes with its session; the session in which it was looked for may be gone.
TEST_F(SiteFile, WhatWasMeasuredBetweenSessionsComesWithThem) {
  ASSERT_TRUE(store_->Commit({.removed = {},
                              .put = {{{RecordKind::kRelations, 2, 1}, "measured"},
                                      {{RecordKind::kRelations, 2, 9}, "of one that is gone"}}}));
  ASSERT_TRUE(WriteSiteFile(*store_, "lab", path_));
  const auto into = MemoryStore();
  ImportOptions options;
  options.first_session = 21;
  ASSERT_TRUE(ImportSite(*into, path_, options));
  std::map<std::uint64_t, std::string> read;
  ASSERT_TRUE(
      into->Read({.kind = RecordKind::kRelations, .owner = 22}, [&](std::uint64_t number, std::string_view bytes) {
        read[number] = bytes;
        return Result<void>{};
      }));
  EXPECT_EQ(read, (std::map<std::uint64_t, std::string>{{21, "measured"}, {24, "of one that is gone"}}));
  ASSERT_TRUE(DeleteSession(*into, "lab", 22));
  EXPECT_TRUE(into->Owners(RecordKind::kRelations)->empty());
}

TEST_F(SiteFile, HoldsNothingOfAnotherSite) {
  Put(*store_, {.name = "hall", .first_session = 11, .job = 7});
  const std::string before = BytesAt(path_);
  ASSERT_TRUE(WriteSiteFile(*store_, "lab", path_));
  EXPECT_EQ(BytesAt(path_), before);
  EXPECT_EQ(WriteSiteFile(*store_, "nowhere", path_).error().code, StatusCode::kNotFound);
  EXPECT_EQ(BytesAt(path_), before);
}

TEST_F(SiteFile, EveryChangedByteIsRefusedWithAReason) {
  const std::string good = BytesAt(path_);
  ASSERT_TRUE(Refused(good).ok());
  for (std::size_t at = 0; at < good.size(); at += at < 64 || at + 64 > good.size() ? 1 : 7) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ (1 << (at % 8)));
    const Status status = Refused(bad);
    EXPECT_FALSE(status.ok()) << at;
    EXPECT_FALSE(status.message.empty()) << at;
  }
}

TEST_F(SiteFile, EveryCutAndEveryAdditionIsRefusedWithAReason) {
  const std::string good = BytesAt(path_);
  for (std::size_t part = 0; part < 50; ++part) {
    const Status status = Refused(good.substr(0, good.size() * part / 50));
    EXPECT_EQ(status.code, StatusCode::kDataLoss) << part;
  }
  EXPECT_NE(Refused(good.substr(0, good.size() - 1)).message.find("ends too early"), std::string::npos);
  EXPECT_NE(Refused(good + "x").message.find("follows its end"), std::string::npos);
  EXPECT_NE(Refused("a text file").message.find("is not a saved site"), std::string::npos);
}

TEST_F(SiteFile, ANewerFormatIsRefusedWithTheReason) {
  const Status status = Refused(FileOf(BlocksOf(BytesAt(path_)), kSiteFileFormat + 1));
  EXPECT_EQ(status.code, StatusCode::kFailedPrecondition);
  EXPECT_NE(status.message.find("newer"), std::string::npos) << status.message;
}

// Checksums are no protection from somebody who can compute them.
TEST_F(SiteFile, RecordsThatDoNotFitTogetherAreRefused) {
  const std::vector<std::string> blocks = BlocksOf(BytesAt(path_));
  ASSERT_TRUE(Refused(FileOf(blocks)).ok());
  EXPECT_FALSE(Refused(FileOf({})).ok());
  for (std::size_t left_out = 0; left_out < blocks.size(); ++left_out) {
    std::vector<std::string> fewer = blocks, exchanged = blocks;
    fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(left_out));
    static_cast<void>(Refused(FileOf(fewer)));  // Refused or not, nothing else happens.
    if (left_out == 0) continue;
    std::swap(exchanged[0], exchanged[left_out]);
    EXPECT_EQ(Refused(FileOf(exchanged)).code, StatusCode::kDataLoss) << left_out;
  }
  // The site, the enabled map version, and a session that has a journal.
  for (const std::size_t needed : {std::size_t{0}, std::size_t{2}, std::size_t{5}}) {
    std::vector<std::string> fewer = blocks;
    fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(needed));
    EXPECT_EQ(Refused(FileOf(fewer)).code, StatusCode::kDataLoss) << needed;
  }
}

TEST_F(SiteFile, AFileThatCannotBeWrittenLeavesTheOneBefore) {
  const auto inside_a_file = path_ / "inside.site";
  EXPECT_FALSE(WriteSiteFile(*store_, "lab", inside_a_file));
  EXPECT_FALSE(WriteSiteFile(*store_, "lab", directory_ / "missing" / "lab.site"));
  EXPECT_TRUE(SurveySiteFile(path_));
  // No temporary file is left.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory_.path()), {}), 1);
}

// It threw, and the name stayed blocked.
TEST(ImportSite, GivesNumbersAlsoToSessionsOfWhichNothingElseIsLeft) {
  const TempDirectory directory;
  const auto saved = MemoryStore();
  const SampleSite sample;
  Put(*saved, sample);
  StoredSite site;
  const auto take = [&site](std::uint64_t, std::string_view bytes) -> Result<void> {
    site = *SiteOf(bytes);
    return {};
  };
  const RecordKey key{RecordKind::kSite, HashName(sample.name), 0};
  ASSERT_TRUE(saved->Read({.kind = key.kind, .owner = key.owner}, take));
  site.merged = {77};
  ASSERT_TRUE(saved->Commit({.removed = {}, .put = {{key, BytesOf(site)}}}));
  const auto path = directory / "lab.site";
  ASSERT_TRUE(WriteSiteFile(*saved, sample.name, path));
  ImportOptions options;
  options.site = "hall";
  options.first_session = 100;
  options.first_job = 1;
  const auto store = MemoryStore();
  const auto imported = ImportSite(*store, path, options);
  ASSERT_TRUE(imported) << imported.error().message;
  site = {};
  ASSERT_TRUE(store->Read({.kind = key.kind, .owner = HashName("hall")}, take));
  ASSERT_EQ(site.merged.size(), 1U);
  EXPECT_GE(*site.merged.begin(), 100U);
}

// A server does not start on a state in which sites have cells of several sizes.
TEST(ImportSite, RefusesCellsOfAnotherSizeThanThoseThere) {
  const TempDirectory directory;
  const auto saved = MemoryStore();
  const SampleSite sample;
  Put(*saved, sample);
  const auto path = directory / "lab.site";
  ASSERT_TRUE(WriteSiteFile(*saved, sample.name, path));
  const auto file = *SurveySiteFile(path);
  ASSERT_GT(file.site.resolution_m, 0.0);
  for (const double factor : {1.0, 2.0}) {
    const auto store = MemoryStore();
    StoredSite other = file.site;
    other.name = "hall";
    other.resolution_m *= factor;
    ASSERT_TRUE(store->Commit({.removed = {}, .put = {{{RecordKind::kSite, HashName("hall"), 0}, BytesOf(other)}}}));
    const auto imported = ImportSite(*store, path);
    EXPECT_EQ(imported.has_value(), factor == 1.0);
    if (imported) continue;
    EXPECT_EQ(imported.error().code, StatusCode::kFailedPrecondition);
    EXPECT_NE(imported.error().message.find("cells"), std::string::npos) << imported.error().message;
  }
}

}  // namespace
}  // namespace cairn::server::testing
