// Sessions that have ended, after a start of the server.
#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <vector>

#include "server/store/site_contents.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

// Within its room on the disk, the server removes what came before a checkpoint. Of ended sessions it could not.
TEST(Restore, AnEndedSessionComesBackFromItsCheckpointAsTheLastMapSwitchLeftIt) {
  const TempDirectory directory;
  const auto map_of = [](StoredServer& server) {
    std::map<TileKey, std::vector<std::uint8_t>> tiles;
    for (const auto& [key, tile] : server->CurrentTiles()) tiles[key] = tile.bytes;
    return tiles;
  };
  Trajectory path;
  std::map<TileKey, std::vector<std::uint8_t>> map;
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 60);
    first->End("r1", kDriver);
    ASSERT_TRUE(first->WaitPhase("r1", kDriver, SessionPhase::kEnded));
    const Reply submitted = first->Ask(About(RequestKind::kJobSubmit));
    ASSERT_EQ(submitted.jobs.size(), 1U);
    ASSERT_EQ(first->WaitJob(submitted.jobs[0].id).state, JobState::kSucceeded);
    const auto keep_all = [](auto, JournalEntry&&) { return Result<void>{}; };
    ASSERT_TRUE(first->WaitFor([&] {
      const auto checkpoint = ReadCheckpoint(first.store(), 1);
      return *checkpoint && (*checkpoint)->position == *ReadJournal(first.store(), 1, 0, keep_all);
    }));
    path = PathOf(first.house());
    first->Stop();
    map = map_of(first);
  }
  {
    const auto store = *OpenStore(directory / "0");
    ASSERT_TRUE(store->Commit({.removed = {{.kind = RecordKind::kJournal, .owner = 1}}, .put = {}}));
  }
  StoredServer second(directory / "0");
  const Reply status = second->Ask(About(RequestKind::kStatus, ""));
  EXPECT_EQ(status.status.message, "");
  ASSERT_EQ(status.robots.size(), 1U);
  EXPECT_EQ(status.robots[0].session.phase, SessionPhase::kEnded);
  EXPECT_TRUE(SamePath(PathOf(second.house()), path));
  EXPECT_TRUE(second->WaitFor([&] { return map_of(second) == map; }));
  SayStarted(second.house());
  EXPECT_TRUE(second->WaitFor([&] { return second->LastState("r1", kDriver).phase == SessionPhase::kEnded; }));
}

}  // namespace
}  // namespace cairn::server::testing
