// A server that is killed after its sessions have taken their parts of another map version, and before the site has
// written that it switched. The kill is made up of two copies of the store: the sessions' journals of the later one,
// and the site of the earlier one.
#include <gtest/gtest.h>

#include <cmath>

#include "server/store/sqlite_store.h"
#include "tests/eventually.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

constexpr RecordKind kOfSites[] = {RecordKind::kSite, RecordKind::kMapVersion, RecordKind::kLayer};

void TakeSitesFrom(const std::filesystem::path& earlier, const std::filesystem::path& later) {
  const auto from = *OpenStore(earlier), to = *OpenStore(later);
  RecordChanges changes;
  for (const RecordKind kind : kOfSites) {
    const auto late = to->Owners(kind), early = from->Owners(kind);
    for (const std::uint64_t owner : *late) changes.removed.push_back({.kind = kind, .owner = owner});
    for (const std::uint64_t owner : *early) {
      const auto put = [&](std::uint64_t number, std::string_view bytes) -> Result<void> {
        changes.put.push_back({{kind, owner, number}, std::string(bytes)});
        return {};
      };
      ASSERT_TRUE(from->Read({.kind = kind, .owner = owner}, put));
    }
  }
  ASSERT_TRUE(to->Commit(changes));
}

Reply Enable(StoredServer& server, std::uint32_t version) {
  Request enable = About(RequestKind::kMapEnable);
  enable.map_version = version;
  return server->Ask(enable);
}

TEST(SwitchKill, AnUnfinishedSwitchOfTheMapHasNoEffect) {
  const TempDirectory directory;
  Trajectory undisturbed;
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 60);
    Request submit = About(RequestKind::kJobSubmit);
    submit.enable = false;
    const Reply reply = first->Ask(submit);
    ASSERT_EQ(reply.jobs.size(), 1U);
    ASSERT_EQ(first->WaitJob(reply.jobs[0].id).state, JobState::kSucceeded);
    ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 60; }));
    ASSERT_TRUE(test::Eventually([&] {  // Until the version is on the disk.
      std::filesystem::remove_all(directory / "before");
      CopyState(directory / "0", directory / "before");
      return !(*OpenStore(directory / "before"))->Numbers({RecordKind::kMapVersion, HashName("lab")})->empty();
    }));
    CopyState(directory / "0", directory / "undisturbed");
    const Reply enabled = Enable(first, 2);
    ASSERT_TRUE(enabled.status.ok()) << enabled.status.message;
    first->Drive("r1", kDriver, 60, 80);
    ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 80; }));
    CopyState(directory / "0", directory / "killed");
  }
  {
    StoredServer other(directory / "undisturbed");
    SayStarted(*other.operator->());
    ASSERT_TRUE(other->WaitPhase("r1", kDriver, SessionPhase::kActive));
    other->Drive("r1", kDriver, 60, 80);
    undisturbed = PathOf(*other.operator->());
  }
  TakeSitesFrom(directory / "before", directory / "killed");
  StoredServer next(directory / "killed");
  const Reply maps = next->Ask(About(RequestKind::kMapInfo));
  ASSERT_EQ(maps.maps.size(), 1U);
  EXPECT_EQ(maps.maps[0].enabled_version, 1U);
  EXPECT_EQ(next->Ask(About(RequestKind::kStatus)).robots[0].pose.map_epoch, maps.maps[0].epoch);
  EXPECT_TRUE(SamePath(PathOf(*next.operator->()), undisturbed));
  // The robot goes on, and the switch can be made now.
  SayStarted(*next.operator->());
  ASSERT_TRUE(next->WaitPhase("r1", kDriver, SessionPhase::kActive));
  next->Drive("r1", kDriver, 80, 100);
  EXPECT_TRUE(next->Ask(About(RequestKind::kStatus)).robots[0].pose.localized);
  const Reply enabled = Enable(next, 2);
  ASSERT_TRUE(enabled.status.ok()) << enabled.status.message;
  const Reply after = next->Ask(About(RequestKind::kMapInfo));
  EXPECT_EQ(after.maps[0].enabled_version, 2U);
  EXPECT_EQ(next->Ask(About(RequestKind::kStatus)).robots[0].pose.map_epoch, after.maps[0].epoch);
}

}  // namespace
}  // namespace cairn::server::testing
