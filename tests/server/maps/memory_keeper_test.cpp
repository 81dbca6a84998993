// In which order a map gives up what it can do without, how long it says so, and when it is counted.
#include "server/maps/memory_keeper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "common/service/map_info.h"

namespace cairn::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

using Clock = MemoryKeeper::Clock;
constexpr Clock::time_point kBegin{std::chrono::hours(1)};
constexpr std::chrono::seconds kSecond{1};
constexpr std::chrono::minutes kLater{2};

// A map in which everything that can go takes 10 bytes, and the rest 100.
class MapOfTens final : public MemoryHolder {
 public:
  explicit MapOfTens(MemoryKeeper& keeper) : keeper_(keeper) {}

  [[nodiscard]] bool HasDisagreement() const override { return disagreement; }
  void DropDisagreement() override {
    disagreement = false;
    gone.emplace_back("disagreement");
  }
  [[nodiscard]] std::optional<std::uint32_t> LeastNeededVersion(bool last) const override {
    if (!old_versions.empty()) return old_versions.front();
    return last && new_version ? std::optional<std::uint32_t>(9) : std::nullopt;
  }
  void RemoveVersion(std::uint32_t version) override {
    if (version == 9) new_version = false;
    std::erase(old_versions, version);
    gone.push_back("version " + std::to_string(version) + ", of " + std::to_string(keeper_.given_up().versions));
  }
  [[nodiscard]] std::size_t Layers() const override { return layers; }
  void MergeOldestLayers() override {
    --layers;
    gone.push_back("layer, of " + std::to_string(keeper_.given_up().layers));
  }
  [[nodiscard]] std::vector<SessionId> EndedSessions() const override { return {1, 2, 3}; }
  [[nodiscard]] bool IsSpare(SessionId session) const override { return spare.contains(session); }
  void ShowWhatIsLeft() override { Show(kBegin); }

  // As the site does whenever it publishes.
  void Show(Clock::time_point now) {
    ++shown;
    keeper_.NoteChange();
    keeper_.Count(now, [this](MemoryCount& memory) {
      const std::size_t tens = (disagreement ? 1U : 0U) + old_versions.size() + (new_version ? 1U : 0U) + layers;
      memory.Add(std::make_shared<int>(), 100 + extra + 10 * tens);
    });
  }

  bool disagreement = false;
  std::vector<std::uint32_t> old_versions;
  bool new_version = false;
  std::size_t layers = 0;
  std::set<SessionId> spare;
  std::size_t extra = 0;
  std::vector<std::string> gone;
  int shown = 0;

 private:
  MemoryKeeper& keeper_;
};

struct Kept {
  explicit Kept(std::uint64_t limit, bool is_limited = true) : keeper(limit, is_limited), map(keeper) {}
  // The map has changed and is published.
  bool Publish(Clock::time_point now) {
    keeper.CountSoon();
    map.Show(now);
    return keeper.Keep(now, map);
  }

  MemoryKeeper keeper;
  MapOfTens map;
};

TEST(MemoryKeeper, WhatIsLeastNeededGoesFirstAndNoMoreThanIsNeeded) {
  struct Case {
    std::uint64_t limit;
    std::vector<std::string> gone;
  };
  const std::vector<std::string> all{"disagreement", "version 2, of 1", "version 3, of 2", "layer, of 1",
                                     "version 9, of 3"};
  for (std::size_t count = 0; count <= all.size(); ++count) {
    Kept kept(160 - 10 * count);
    kept.map.disagreement = true;
    kept.map.old_versions = {2, 3};
    kept.map.new_version = true;
    kept.map.layers = 2;
    EXPECT_EQ(kept.Publish(kBegin), count > 0);
    EXPECT_EQ(kept.map.gone, std::vector<std::string>(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(count)));
    EXPECT_EQ(kept.keeper.bytes(), 160 - 10 * count);
    EXPECT_FALSE(kept.keeper.gives_no_more());
    if (count > 0) {
      EXPECT_THAT(kept.keeper.note(), StartsWith("to stay below the limit"));
    }
  }
}

TEST(MemoryKeeper, WithoutALimitNothingGoes) {
  for (const bool is_limited : {false, true}) {  // Only by all sites together, which take little.
    Kept kept(0, is_limited);
    kept.map.old_versions = {2};
    EXPECT_FALSE(kept.Publish(kBegin));
    EXPECT_THAT(kept.map.gone, IsEmpty());
    EXPECT_EQ(kept.keeper.note(), "");
  }
}

TEST(MemoryKeeper, TheSmallerOfTheTwoLimitsCounts) {
  Kept kept(1000);
  kept.map.old_versions = {2, 3};
  kept.keeper.SetShare(110, true);
  kept.Publish(kBegin);
  EXPECT_THAT(kept.map.gone, ElementsAre("version 2, of 1"));
  kept.keeper.SetShare(0, true);  // All sites together take less again.
  kept.map.extra = 500;
  kept.Publish(kBegin + kSecond);
  EXPECT_EQ(kept.map.gone.size(), 1U);
}

TEST(MemoryKeeper, ANewVersionStaysForAMinute) {
  Kept kept(100);
  kept.map.new_version = true;
  kept.keeper.NoteNewVersion(kBegin);
  kept.Publish(kBegin + std::chrono::seconds(59));
  EXPECT_THAT(kept.map.gone, IsEmpty());
  EXPECT_FALSE(kept.keeper.gives_no_more()) << "it may go later";
  kept.Publish(kBegin + std::chrono::seconds(60));
  EXPECT_THAT(kept.map.gone, ElementsAre("version 9, of 1"));
}

TEST(MemoryKeeper, SessionsThatOthersCoverAreOfferedOneAfterTheOther) {
  Kept kept(90);
  kept.map.spare = {1, 3};
  kept.Publish(kBegin);
  EXPECT_EQ(kept.keeper.spare_session(), 1U);
  EXPECT_FALSE(kept.keeper.gives_no_more());
  kept.Publish(kBegin + 9 * kSecond);
  EXPECT_EQ(kept.keeper.spare_session(), 1U);
  kept.Publish(kBegin + 10 * kSecond);  // A robot goes on with session 1.
  EXPECT_EQ(kept.keeper.spare_session(), 3U) << "session 2 is not covered";
  kept.keeper.NoteLeft(3);
  kept.map.spare = {1};
  EXPECT_EQ(kept.keeper.spare_session(), 0U);
  EXPECT_EQ(kept.keeper.given_up().sessions, 1U);
  kept.Publish(kBegin + 11 * kSecond);
  EXPECT_EQ(kept.keeper.spare_session(), 0U) << "session 1 was offered in this round";
  EXPECT_TRUE(kept.keeper.gives_no_more());
  kept.Publish(kBegin + 70 * kSecond);
  EXPECT_EQ(kept.keeper.spare_session(), 0U);
  kept.Publish(kBegin + 71 * kSecond);  // A minute after the last round.
  EXPECT_EQ(kept.keeper.spare_session(), 1U);
  kept.keeper.NoteLeft(7);  // Another one, of itself.
  EXPECT_EQ(kept.keeper.given_up().sessions, 1U);
  kept.map.extra = 0;
  kept.keeper.SetShare(0, true);
}

TEST(MemoryKeeper, NobodyHasToLeaveAMapThatIsSmallEnough) {
  Kept kept(100);
  kept.map.spare = {1};
  kept.map.extra = 1;
  kept.Publish(kBegin);
  EXPECT_EQ(kept.keeper.spare_session(), 1U);
  kept.map.extra = 0;
  kept.Publish(kBegin + kSecond);
  EXPECT_EQ(kept.keeper.spare_session(), 0U);
}

TEST(MemoryKeeper, WhoIsAboveIsCalledSoUntilItTakesClearlyLess) {
  Kept kept(1000);
  const auto note_at = [&kept](std::size_t bytes) {
    kept.map.extra = bytes - 100;
    kept.Publish(kBegin);
    return kept.keeper.note();
  };
  EXPECT_EQ(note_at(1000), "");
  EXPECT_THAT(note_at(1001), StartsWith(std::string(kAboveMemoryLimit)));
  EXPECT_THAT(note_at(950), StartsWith(std::string(kAboveMemoryLimit)));
  EXPECT_TRUE(kept.keeper.gives_no_more());
  EXPECT_EQ(note_at(949), "");
  EXPECT_FALSE(kept.keeper.gives_no_more());
  // All together are clearly below only when the atlas says so.
  kept.keeper.SetShare(500, false);
  EXPECT_THAT(note_at(501), StartsWith(std::string(kAboveMemoryLimit)));
  EXPECT_THAT(note_at(100), StartsWith(std::string(kAboveMemoryLimit)));
  kept.keeper.SetShare(0, true);
  EXPECT_EQ(note_at(100), "");
}

TEST(MemoryKeeper, ItIsCountedEveryTenSecondsAndAtOnceAfterMuchHasChanged) {
  MemoryKeeper keeper(1000, true);
  std::size_t counts = 0;
  const auto count_at = [&](Clock::time_point now) {
    keeper.Count(now, [&counts](MemoryCount& memory) {
      ++counts;
      memory.Add(std::make_shared<int>(), 10 * counts);
    });
    return keeper.bytes();
  };
  EXPECT_EQ(count_at(kBegin), 0U) << "nothing has changed";
  keeper.NoteChange();
  EXPECT_EQ(count_at(kBegin), 10U);
  EXPECT_EQ(count_at(kBegin + kLater), 10U);
  keeper.NoteChange();
  EXPECT_EQ(count_at(kBegin + kSecond), 10U);
  EXPECT_FALSE(keeper.IsToBeCounted(kBegin + 9 * kSecond));
  EXPECT_TRUE(keeper.IsToBeCounted(kBegin + 10 * kSecond));
  EXPECT_EQ(count_at(kBegin + 10 * kSecond), 20U);
  keeper.CountSoon();
  EXPECT_EQ(count_at(kBegin + 10 * kSecond), 30U);
  // Without memory for it the last count stays, and it is counted later.
  keeper.CountSoon();
  keeper.Count(kBegin + 11 * kSecond, [](MemoryCount&) { throw std::bad_alloc(); });
  EXPECT_EQ(keeper.bytes(), 30U);
  EXPECT_FALSE(keeper.IsToBeCounted(kBegin + 12 * kSecond));
  EXPECT_TRUE(keeper.IsToBeCounted(kBegin + 21 * kSecond));
}

TEST(MemoryKeeper, WhatAnEarlierServerGaveUpIsSaidAgain) {
  MemoryKeeper keeper(1000, true);
  keeper.Restore({.versions = 2, .layers = 0, .sessions = 1});
  EXPECT_THAT(keeper.note(), HasSubstr("map versions removed: 2; earlier sessions forgotten but for their map: 1"));
  MemoryKeeper unlimited(0, false);
  unlimited.Restore({.versions = 2, .layers = 0, .sessions = 1});
  EXPECT_EQ(unlimited.note(), "");
}

}  // namespace
}  // namespace cairn::server
