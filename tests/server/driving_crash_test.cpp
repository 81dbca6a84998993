// A scan that crashes the estimator while the robot drives is not on the disk, and its robot sends it again: every
// server after that would end as well.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>

#include "server/maps/atlas.h"
#include "server/robots/roster.h"
#include "server/store/restore_marks.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

// Restores the sessions in a process of its own, and has the thread of session 1 crash as a scan would. Whether that
// process died.
bool CrashesElsewhere(const std::filesystem::path& directory, const ServerOptions& options) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit no_core{0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    const auto store = *OpenStore(directory);
    Journal journal(*store, {.commit_delay_ms = 5});
    Outbound outbound(256);
    asio::thread_pool pool(2);
    Atlas atlas(options.maps, options.slam.grid.resolution_m, true, pool, outbound);
    Roster roster(options.robots, options.slam, pool, outbound, atlas, &journal);
    StartControl control;
    if (!roster.Restore(control)) _exit(0);
    journal.Start();
    for (const auto& session : roster.InSite("lab"))
      if (session->id() == 1) static_cast<void>(session->Post(SnapshotWanted{[](SessionMaterial&&) { std::abort(); }}));
    sleep(60);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return !WIFEXITED(status) || WEXITSTATUS(status) != 0;
}

TEST(DrivingCrash, ASessionThatCrashesEveryServerIsSetAsideAndTheOthersDriveOn) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  DriveTwoRobots(directory / "0", options);
  for (std::uint32_t crash = 1; crash <= RestoreMarks::kDrivingCrashes; ++crash) {
    {
      StoredServer server(directory / "0", options);
      for (const char* robot : {"r1", "r2"}) EXPECT_EQ(PathOf(*server.operator->(), robot).size(), 60U) << crash;
      EXPECT_EQ(server->Ask(About(RequestKind::kStatus, "")).status.message, "");
    }
    ASSERT_TRUE(CrashesElsewhere(directory / "0", options));
  }
  for (int start = 0; start < 2; ++start) {
    StoredServer server(directory / "0", options);
    const Reply status = server->Ask(About(RequestKind::kStatus, ""));
    ASSERT_EQ(status.robots.size(), 1U);
    EXPECT_EQ(status.robots[0].session.robot, "r2");
    EXPECT_THAT(status.status.message, ::testing::HasSubstr("crashed 3 times in what the robot of this session sent"));
    EXPECT_TRUE(server->WaitFor([&] { return server->CurrentTiles().size() >= 4; })) << "its part of the map is shown";
    SayStarted(*server.operator->());
    ASSERT_TRUE(server->WaitPhase("r1", kDriver, SessionPhase::kRefused));
    // Its client would send the same again in another session if it were told to open one.
    EXPECT_EQ(server->LastState("r1", kDriver).status.code, StatusCode::kInvalidArgument);
    EXPECT_THAT(server->LastState("r1", kDriver).status.message, ::testing::HasSubstr("crashed 3 times"));
  }
}

TEST(DrivingCrash, OnlyCrashesWithinAnHourAreCountedTogether) {
  const auto store = *OpenStore(std::string(kInMemory));
  const auto crashes_at = [&](std::int64_t now_s) {
    auto marks = *RestoreMarks::Read(*store, {.driving = 1, .now_s = now_s});
    EXPECT_TRUE(marks.Settle());
    // It is restored well each time.
    EXPECT_TRUE(marks.Begin({1}));
    EXPECT_TRUE(marks.Reached(1, RestoreMarks::kPlaceEntries));
    EXPECT_TRUE(marks.Succeeded({1}));
    return RestoreMarks::Read(*store, {})->failed(1);
  };
  constexpr std::int64_t kHour = RestoreMarks::kDrivingTogetherS, kBegin = 1'700'000'000;
  EXPECT_EQ(crashes_at(kBegin), 0U);
  EXPECT_EQ(crashes_at(kBegin + kHour), 0U);
  EXPECT_EQ(crashes_at(kBegin + 2 * kHour + 1), 0U) << "long after the last";
  EXPECT_EQ(crashes_at(kBegin + 2 * kHour + 2), 0U);
  EXPECT_EQ(crashes_at(kBegin), 0U) << "the clock was set back";
  EXPECT_EQ(crashes_at(kBegin + 1), 0U);
  EXPECT_EQ(crashes_at(kBegin + 2), RestoreMarks::kWithoutJournal);
}

}  // namespace
}  // namespace cairn::server::testing
