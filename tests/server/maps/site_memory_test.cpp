// What a site gives up to stay below its limit of memory, and in which order.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "server/maps/atlas.h"
#include "server/maps/memory_shares.h"
#include "server/store/site_contents.h"
#include "server/store/sqlite_store.h"
#include "tests/server/maps/uniform_chunk.h"

namespace cairn::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// A session that goes on existing after it has ended.
struct EndedOwner : GridOwner {
  void Adopt(Correction&&) override {}
  void SetMapEpoch(std::uint32_t) override {}
};

constexpr double kChunk_mib = static_cast<double>(sizeof(slam::GridChunk)) / (1024.0 * 1024.0);

// By then no job waits to enable the version that it has made.
constexpr std::chrono::minutes kLater{2};

class SiteMemoryTest : public ::testing::Test {
 protected:
  ~SiteMemoryTest() override { pool_.join(); }

  std::shared_ptr<Site> NewSite(double max_memory_mib, Journal* journal = nullptr) {
    return std::make_shared<Site>("lab", 0.05, MapsOptions{.max_memory_mib = max_memory_mib}, pool_, outbound_,
                                  journal);
  }
  // As it publishes so much later.
  static MapInfo InfoOf(Site& site, std::chrono::seconds later = {}) {
    site.Publish({}, Site::Clock::now() + later);
    std::promise<void> reached;
    site.Probe([&] { reached.set_value(); });
    reached.get_future().wait();
    return site.snapshot()->info;
  }
  static std::vector<std::uint32_t> VersionsOf(const MapInfo& info) {
    std::vector<std::uint32_t> versions;
    for (const MapVersionInfo& version : info.versions) versions.push_back(version.version);
    return versions;
  }
  static std::uint8_t CellOf(const Site& site) {
    const auto tile = site.snapshot()->tiles.Find({0, 0, 0});
    return tile == nullptr ? kUnknownCell : (*DecodeCells(tile->bytes, tile->encoding))[0];
  }
  // A session that has drawn one chunk at each of these places, and is gone.
  static void AddLayer(Site& site, SessionId id, const std::vector<slam::ChunkKey>& places) {
    site.Join({.session = id, .robot = 100 + id, .owner = {}});
    for (const slam::ChunkKey& place : places) site.Change({.session = id, .chunks = {{place, UniformChunk(100)}}});
    site.End(id);
    site.Leave(id);
  }
  // A version in which a session that is still there has drawn something else.
  std::uint32_t AddVersion(Site& site, SessionId session) {
    MapVersion version;
    version.parts[session].chunks[{0, 0}] = UniformChunk(50);
    std::promise<std::uint32_t> added;
    site.AddVersion(std::move(version), [&](const Result<std::uint32_t>& number) { added.set_value(*number); });
    return added.get_future().get();
  }
  // One session of today, three layers and three versions of the same place.
  std::shared_ptr<EndedOwner> Fill(Site& site) {
    for (SessionId id = 1; id <= 3; ++id) AddLayer(site, id, {{0, 0}});
    auto owner = std::make_shared<EndedOwner>();
    site.Join({.session = 9, .robot = 9, .owner = owner});
    site.Change({.session = 9, .chunks = {{{0, 0}, UniformChunk(200)}}});
    static_cast<void>(InfoOf(site));
    for (int i = 0; i < 3; ++i) AddVersion(site, 9);
    return owner;
  }

  asio::thread_pool pool_{1};
  Outbound outbound_{256};
};

TEST_F(SiteMemoryTest, WithoutALimitAndBelowItNothingHappens) {
  for (const double limit_mib : {0.0, 10.0}) {
    const auto site = NewSite(limit_mib);
    const auto owner = Fill(*site);
    const MapInfo info = InfoOf(*site);
    EXPECT_GT(info.memory_bytes, 4 * sizeof(slam::GridChunk));
    EXPECT_EQ(info.memory_note, "");
    EXPECT_THAT(VersionsOf(info), ElementsAre(1, 2, 3, 4));
    EXPECT_FALSE(site->gives_no_more());
  }
}

// With each limit as much goes as is needed, and no more.
TEST_F(SiteMemoryTest, VersionsGoBeforeLayersAndTheNewestVersionLast) {
  const auto whole = NewSite(1000.0);
  const auto owner_of_whole = Fill(*whole);
  const double all_mib = static_cast<double>(InfoOf(*whole).memory_bytes) / (1024.0 * 1024.0);
  struct Case {
    double chunks_less;
    std::vector<std::uint32_t> versions;
    std::string note;
  };
  // Version 1 takes nothing, because it is enabled. Each other one takes a chunk, and so does each layer.
  for (const Case& one : {Case{0.5, {1, 3, 4}, "removed: 1"}, Case{1.5, {1, 4}, "removed: 2"},
                          Case{2.5, {1, 4}, "removed: 2; layers of earlier sessions merged: 1"},
                          Case{3.5, {1, 4}, "removed: 2; layers of earlier sessions merged: 2"},
                          Case{4.5, {1}, "removed: 3; layers of earlier sessions merged: 2"}}) {
    const double limit_mib = all_mib - one.chunks_less * kChunk_mib;
    const auto site = NewSite(limit_mib);
    const auto owner = Fill(*site);
    const MapInfo info = InfoOf(*site, kLater);
    EXPECT_EQ(VersionsOf(info), one.versions) << one.chunks_less;
    EXPECT_THAT(info.memory_note, HasSubstr(one.note));
    EXPECT_THAT(info.memory_note, StartsWith("to stay below the limit"));
    EXPECT_LE(static_cast<double>(info.memory_bytes), limit_mib * 1024 * 1024);
    EXPECT_EQ(CellOf(*site), CellOf(*whole)) << one.chunks_less;
  }
}

TEST_F(SiteMemoryTest, TheMapStaysAlsoWhereItAloneTakesTooMuch) {
  const auto whole = NewSite(1000.0);
  const auto owner_of_whole = Fill(*whole);
  static_cast<void>(InfoOf(*whole));
  const auto site = NewSite(kChunk_mib);
  const auto owner = Fill(*site);
  EXPECT_THAT(VersionsOf(InfoOf(*site)), ElementsAre(1, 4)) << "the job that has made it may enable it";
  const MapInfo info = InfoOf(*site, kLater);
  EXPECT_THAT(info.memory_note, StartsWith(std::string(kAboveMemoryLimit)));
  EXPECT_THAT(VersionsOf(info), ElementsAre(1));
  EXPECT_EQ(info.enabled_version, 1U);
  EXPECT_EQ(CellOf(*site), CellOf(*whole));
  EXPECT_TRUE(site->gives_no_more());
  // What is given up meanwhile is said as well, and the site goes on.
  AddLayer(*site, 20, {{3, 0}});
  EXPECT_THAT(InfoOf(*site, kLater).memory_note, HasSubstr("merged: 3"));
  EXPECT_NE(site->snapshot()->tiles.Find({0, 3, 0}), nullptr);
}

// It came and went with each change of the map, and the alert with it.
TEST_F(SiteMemoryTest, WhatIsSaidStaysUntilTheMapTakesClearlyLess) {
  constexpr int kChunks = 40;
  const auto fill = [](Site& site) {
    site.Join({.session = 9, .robot = 9, .owner = {}});
    for (int i = 0; i < kChunks; ++i) site.Change({.session = 9, .chunks = {{{i, 0}, UniformChunk(200)}}});
    return InfoOf(site, kLater);
  };
  const auto whole = NewSite(1000.0);
  const double all_mib = static_cast<double>(fill(*whole).memory_bytes) / (1024.0 * 1024.0);
  const auto site = NewSite(0.99 * all_mib);
  EXPECT_THAT(fill(*site).memory_note, StartsWith(std::string(kAboveMemoryLimit)));
  int removed = 0;
  const auto remove = [&](int chunks) {
    for (const int last = removed + chunks; removed < last; ++removed)
      site->Change({.session = 9, .chunks = {{{removed, 0}, nullptr}}});
    static_cast<void>(InfoOf(*site, kLater));
    site->Leave(1000);  // After anything that leaves, memory is counted at once.
    return InfoOf(*site, kLater);
  };
  const MapInfo little = remove(1);
  EXPECT_LT(static_cast<double>(little.memory_bytes), 0.99 * all_mib * 1024 * 1024);
  EXPECT_THAT(little.memory_note, StartsWith(std::string(kAboveMemoryLimit)));
  EXPECT_TRUE(site->gives_no_more());
  const MapInfo much = remove(10);
  EXPECT_EQ(much.memory_note, "");
  EXPECT_FALSE(site->gives_no_more());
}

TEST_F(SiteMemoryTest, WhatIsSaidOfAllSitesTogetherStaysAsLong) {
  Atlas atlas(MapsOptions{.max_total_memory_mib = 1000.0}, 0.05, true, pool_, outbound_);
  const auto site = *atlas.Create("lab");
  site->Join({.session = 9, .robot = 9, .owner = {}});
  site->Change({.session = 9, .chunks = {{{0, 0}, UniformChunk(200)}}});
  EXPECT_EQ(InfoOf(*site).memory_note, "");
  site->SetMemoryShare(1, false);
  EXPECT_THAT(InfoOf(*site, kLater).memory_note, StartsWith(std::string(kAboveMemoryLimit)));
  site->SetMemoryShare(0, false);
  EXPECT_THAT(InfoOf(*site, kLater).memory_note, StartsWith(std::string(kAboveMemoryLimit)));
  site->SetMemoryShare(0, true);
  EXPECT_EQ(InfoOf(*site, kLater).memory_note, "");
}

TEST_F(SiteMemoryTest, TheLayerOfDisagreementIsMadeWhenItIsAskedForAndNotKept) {
  const auto site = NewSite(kChunk_mib);
  for (const SessionId id : {SessionId{1}, SessionId{2}}) {
    site->Join({.session = id, .robot = id, .owner = {}});
    site->Change({.session = id, .chunks = {{{0, 0}, UniformChunk(id == 1 ? 300 : -300)}}});
  }
  static_cast<void>(InfoOf(*site));
  std::promise<bool> answer;
  site->AskDisagreement([&](const Result<std::shared_ptr<const MapSnapshot>>& map) {
    answer.set_value(map && (*map)->disagreement.Find({0, 0, 0}) != nullptr);
  });
  EXPECT_TRUE(answer.get_future().get());
  EXPECT_THAT(InfoOf(*site).memory_note, HasSubstr("disagreement"));
  EXPECT_TRUE(site->snapshot()->disagreement.empty());
}

// An earlier session is offered only where the map stays whole without what it saw.
TEST_F(SiteMemoryTest, AnEarlierSessionIsSpareWhereOthersHaveDrawnAsWell) {
  const auto site = NewSite(kChunk_mib);
  const auto owner = std::make_shared<EndedOwner>();
  for (const SessionId id : {SessionId{1}, SessionId{2}, SessionId{3}}) {
    site->Join({.session = id, .robot = id, .owner = owner});
    site->Change({.session = id, .chunks = {{{0, 0}, UniformChunk(100)}}});
  }
  site->Change({.session = 1, .chunks = {{{5, 5}, UniformChunk(100)}}});
  site->End(1);
  site->End(2);
  static_cast<void>(InfoOf(*site));
  EXPECT_EQ(site->spare_session(), 2U);
  site->Leave(2);
  EXPECT_THAT(InfoOf(*site).memory_note, HasSubstr("earlier sessions forgotten but for their map: 1"));
  EXPECT_EQ(site->spare_session(), 0U) << "nobody else has drawn where session 1 was";
}

TEST_F(SiteMemoryTest, WhatWasGivenUpIsGoneAndSaidAlsoAfterARestart) {
  const std::unique_ptr<Store> store = *OpenStore(kInMemory);
  MapInfo before;
  std::uint8_t cell = 0;
  {
    Journal journal(*store, StoreOptions{});
    journal.Start();
    const auto site = NewSite(kChunk_mib, &journal);
    const auto owner = Fill(*site);
    std::promise<bool> enabled;
    site->Enable(AddVersion(*site, 1), [&](const Result<std::uint32_t>& done) { enabled.set_value(done.has_value()); });
    ASSERT_TRUE(enabled.get_future().get());
    site->Leave(9);
    before = InfoOf(*site, kLater);
    cell = CellOf(*site);
    EXPECT_THAT(VersionsOf(before), ElementsAre(before.enabled_version));
    journal.Stop();
  }
  const auto stored = ReadSite(*store, "lab");
  ASSERT_TRUE(stored);
  EXPECT_EQ(stored->layers.size(), 1U);
  const auto versions = ReadVersions(*store, HashName("lab"));
  ASSERT_TRUE(versions);
  EXPECT_EQ(versions->size(), 1U);
  Journal journal(*store, StoreOptions{});
  const auto site = NewSite(kChunk_mib, &journal);
  StartControl control;
  ASSERT_TRUE(site->Restore(stored->site, control));
  const MapInfo after = InfoOf(*site);
  EXPECT_EQ(after.memory_note, before.memory_note);
  EXPECT_EQ(VersionsOf(after), VersionsOf(before));
  EXPECT_EQ(CellOf(*site), cell);
}

// The smaller site keeps what it has.
TEST_F(SiteMemoryTest, AllSitesTogetherStayBelowTheirLimit) {
  double limit_mib = 1000.0;
  for (const bool is_limited : {false, true}) {
    Atlas atlas(MapsOptions{.max_total_memory_mib = limit_mib}, 0.05, true, pool_, outbound_);
    const auto lab = *atlas.Create("lab"), yard = *atlas.Create("yard");
    const auto owner = Fill(*lab);
    for (SessionId id = 11; id <= 12; ++id) AddLayer(*yard, id, {{0, 0}});
    const std::uint64_t all = InfoOf(*lab).memory_bytes + InfoOf(*yard).memory_bytes;
    if (!is_limited) limit_mib = static_cast<double>(all) / (1024.0 * 1024.0) - 0.5 * kChunk_mib;
    atlas.Publish();
    EXPECT_EQ(InfoOf(*yard).memory_note, "");
    const MapInfo info = InfoOf(*lab);
    EXPECT_EQ(info.memory_note.empty(), !is_limited) << info.memory_note;
    EXPECT_EQ(VersionsOf(info).size(), is_limited ? 3U : 4U);
  }
}

TEST(MemoryShare, SitesAreClearlyBelowTheirLimitWithSomeRoom) {
  EXPECT_FALSE(AreClearlyBelow({{40, false}, {60, true}}, 100));
  EXPECT_FALSE(AreClearlyBelow({{40, false}, {56, true}}, 100));
  EXPECT_TRUE(AreClearlyBelow({{40, false}, {54, true}}, 100));
}

TEST(MemoryShare, TheLargestSitesGiveUpFirst) {
  EXPECT_EQ(MemoryShare({}, 100), 0U);
  EXPECT_EQ(MemoryShare({{40, false}, {60, false}}, 100), 0U);
  EXPECT_EQ(MemoryShare({{10, false}, {80, false}, {70, false}}, 100), 45U);
  EXPECT_EQ(MemoryShare({{50, false}, {50, false}}, 60), 30U);
  // One that can give no more leaves less for the others.
  EXPECT_EQ(MemoryShare({{60, true}, {50, false}, {10, false}}, 100), 30U);
  EXPECT_EQ(MemoryShare({{200, true}, {10, false}}, 100), 1U);
  EXPECT_EQ(MemoryShare({{200, true}}, 100), 1U);
}

}  // namespace
}  // namespace cairn::server
