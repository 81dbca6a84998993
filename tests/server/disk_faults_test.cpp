// A server whose disk fails while it runs or while it starts: it says so and goes on in memory, and the next one has
// what was stored, or says why it does not start. cairnd itself on a full disk: tests/system/kill_test.cpp.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/server/store/faulty_vfs.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

using ::testing::HasSubstr;

struct Fault {
  const char* name;
  DiskFault fault;
  const char* reason;  // In the status.
};

class FailingDisk : public ::testing::TestWithParam<Fault> {};

Trajectory FirstOf(Trajectory path, std::size_t count) {
  path.resize(std::min(path.size(), count));
  return path;
}

TEST_P(FailingDisk, IsSaidStreamingGoesOnAndTheNextServerHasWhatWasStored) {
  const TempDirectory directory;
  const auto state = directory / "state";
  Trajectory path;
  {
    FaultyVfs vfs;
    StoredServer server(state, TestOptions(), FaultyVfs::name());
    server->Open("r1", kDriver);
    server->Drive("r1", kDriver, 0, 40);
    ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r1").durable_through == 40; }));
    vfs.Set(GetParam().fault);
    server->Drive("r1", kDriver, 40, 80);
    const auto status = [&] { return server->Ask(About(RequestKind::kStatus)).status; };
    ASSERT_TRUE(server->WaitFor([&] { return !status().message.empty(); }));
    EXPECT_THAT(status().message, HasSubstr(GetParam().reason));
    path = PathOf(*server.operator->());
    EXPECT_EQ(path.size(), 80U) << "poses and questions go on in memory";
    EXPECT_EQ(server->LastLedger("r1").durable_through, 40U) << "nothing is called durable that is not";
  }
  StoredServer next(state);
  EXPECT_EQ(next->Ask(About(RequestKind::kStatus)).status.message, "");
  const Trajectory after = PathOf(*next.operator->());
  // A commit that could not be flushed may be there.
  EXPECT_GE(after.size(), 40U);
  EXPECT_TRUE(SamePath(after, FirstOf(path, after.size())));
  // The robot sends again what was not durable.
  SayStarted(*next.operator->());
  next->Drive("r1", kDriver, 40, 80);
  EXPECT_TRUE(SamePath(PathOf(*next.operator->()), path));
}

TEST(DiskFaults, ThatEndLoseNothing) {
  const TempDirectory directory;
  const auto state = directory / "state";
  Trajectory path;
  {
    FaultyVfs vfs;
    StoredServer server(state, TestOptions(), FaultyVfs::name());
    server->Open("r1", kDriver);
    server->Drive("r1", kDriver, 0, 40);
    vfs.Set(DiskFault::kSyncError);
    server->Drive("r1", kDriver, 40, 60);
    vfs.Set(DiskFault::kNone);
    server->Drive("r1", kDriver, 60, 80);
    ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r1").durable_through == 80; }));
    EXPECT_EQ(server->Ask(About(RequestKind::kStatus)).status.message, "");
    path = PathOf(*server.operator->());
  }
  StoredServer next(state);
  EXPECT_TRUE(SamePath(PathOf(*next.operator->()), path));
}

// The disk fails for so long that the server cannot keep in memory what is to be written. Until it was started again it
// stored nothing more of this robot.
TEST(DiskFaults, AfterALongOneTheRobotIsStoredAgain) {
  const TempDirectory directory;
  const auto state = directory / "state";
  constexpr int kLong = 1000;
  Trajectory path;
  {
    FaultyVfs vfs;
    StoredServer server(state, TestOptions(), FaultyVfs::name(), {.commit_delay_ms = 5, .queue_mib = 1});
    server->Open("r1", kDriver);
    server->Drive("r1", kDriver, 0, 40);
    ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r1").durable_through == 40; }));
    vfs.Set(DiskFault::kFull);
    server->Drive("r1", kDriver, 40, kLong);
    ASSERT_TRUE(server->WaitFor([&] { return !server->LastState("r1", kDriver).durable; }));
    vfs.Set(DiskFault::kNone);
    ASSERT_TRUE(server->WaitFor([&] { return server->LastState("r1", kDriver).durable; }));
    EXPECT_TRUE(server->LastState("r1", kDriver).status.ok()) << server->LastState("r1", kDriver).status.message;
    ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r1").durable_through == kLong; }));
    server->Drive("r1", kDriver, kLong, kLong + 40);
    ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r1").durable_through == kLong + 40; }));
    EXPECT_EQ(server->Ask(About(RequestKind::kStatus)).status.message, "");
    path = PathOf(*server.operator->());
  }
  StoredServer next(state);
  EXPECT_TRUE(SamePath(PathOf(*next.operator->()), path));
  SayStarted(*next.operator->());
  ASSERT_TRUE(next->WaitPhase("r1", kDriver, SessionPhase::kActive));
}

// A degraded server that was killed did not start again until somebody had made room: no map, no poses.
TEST(DiskFaults, OnAFullDiskTheNextServerStartsAsWell) {
  const TempDirectory directory;
  const auto state = directory / "state";
  Trajectory path;
  {
    StoredServer server(state);
    server->Open("r1", kDriver);
    server->Drive("r1", kDriver, 0, 40);
    ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r1").durable_through == 40; }));
    path = PathOf(*server.operator->());
  }
  {
    FaultyVfs vfs;
    vfs.Set(DiskFault::kFull);
    StoredServer next(state, TestOptions(), FaultyVfs::name());
    EXPECT_TRUE(SamePath(PathOf(*next.operator->()), path));
    SayStarted(*next.operator->());
    next->Drive("r1", kDriver, 40, 80);
    EXPECT_EQ(PathOf(*next.operator->()).size(), 80U);
    ASSERT_TRUE(next->WaitFor(
        [&] { return next->Ask(About(RequestKind::kStatus)).status.message.find("full") != std::string::npos; }));
  }
  StoredServer last(state);
  EXPECT_TRUE(SamePath(PathOf(*last.operator->()), path));
}

INSTANTIATE_TEST_SUITE_P(Server, FailingDisk,
                         ::testing::Values(Fault{"full", DiskFault::kFull, "database or disk is full"},
                                           Fault{"write", DiskFault::kWriteError, "disk I/O error"},
                                           Fault{"sync", DiskFault::kSyncError, "disk I/O error"},
                                           Fault{"read_only", DiskFault::kReadOnly, "readonly database"}),
                         [](const auto& fault) { return std::string(fault.param.name); });

// What cannot be read must not be taken for absent: a server that started without it would give its robots new
// sessions, and write over what is there.
TEST(DiskFaults, AServerThatCannotReadItsStateDoesNotStartWithoutIt) {
  const TempDirectory directory;
  const auto state = directory / "state";
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  DriveTwoRobots(state, options);
  {
    FaultyVfs vfs;
    vfs.Set(DiskFault::kReadError);
    const auto store = OpenStore(state, FaultyVfs::name());
    ASSERT_FALSE(store);
    EXPECT_EQ(store.error().code, StatusCode::kUnavailable);
    EXPECT_THAT(store.error().message, HasSubstr("disk I/O error"));
    // It can be opened, and what is in it can not be read any more.
    vfs.Set(DiskFault::kNone);
    const auto opened = OpenStore(state, FaultyVfs::name());
    ASSERT_TRUE(opened);
    vfs.Set(DiskFault::kReadError);
    Journal journal(**opened, {.commit_delay_ms = 5});
    Inbound inbound(16);
    Outbound outbound(16);
    Server server(options, inbound, outbound, 1, &journal);
    const auto started = server.Start();
    ASSERT_FALSE(started);
    EXPECT_THAT(started.error().message, HasSubstr("disk I/O error"));
    server.Stop();
  }
  StoredServer next(state, options);
  for (const char* robot : {"r1", "r2"}) EXPECT_EQ(PathOf(*next.operator->(), robot).size(), 60U);
}

TEST(DiskFaults, ASiteThatCannotBeReadIsNotSavedAndTheReasonIsTheAnswer) {
  const TempDirectory directory;
  FaultyVfs vfs;
  StoredServer server(directory / "state", TestOptions(), FaultyVfs::name());
  server->Open("r1", kDriver);
  server->Drive("r1", kDriver, 0, 40);
  ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r1").durable_through == 40; }));
  // More than SQLite keeps in memory, so that a part must be read from the disk.
  std::mt19937_64 random(1);
  std::string large(1 << 20, '\0');
  for (char& byte : large) byte = static_cast<char>(random());
  for (std::uint64_t i = 0; i < 4; ++i)
    ASSERT_TRUE(server.store().Commit({.removed = {}, .put = {{{RecordKind::kCheckpoint, 1, 1000 + i}, large}}}));
  vfs.Set(DiskFault::kReadError);
  Request save = About(RequestKind::kSiteSave);
  save.saved = "lab";
  const Reply failed = server->Ask(save);
  EXPECT_EQ(failed.status.code, StatusCode::kUnavailable);
  EXPECT_THAT(failed.status.message, HasSubstr("disk I/O error"));
  EXPECT_FALSE(std::filesystem::exists(directory / "state" / "saved" / "lab.site"));
  vfs.Set(DiskFault::kNone);
  const Reply saved = server->Ask(save);
  EXPECT_TRUE(saved.status.ok()) << saved.status.message;
}

// A site is saved after what came before it is on the disk. The answer must not wait for a disk that fails for hours.
TEST(DiskFaults, ASiteIsNotSavedWhileTheDiskDoesNotTakeWhatCameBefore) {
  const TempDirectory directory;
  FaultyVfs vfs;
  StoredServer server(directory / "state", TestOptions(), FaultyVfs::name());
  server->Open("r1", kDriver);
  server->Drive("r1", kDriver, 0, 40);
  ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r1").durable_through == 40; }));
  vfs.Set(DiskFault::kWriteError);
  server->Drive("r1", kDriver, 40, 41);
  Request save = About(RequestKind::kSiteSave);
  save.saved = "lab";
  const Reply failed = server->Ask(save);
  EXPECT_EQ(failed.status.code, StatusCode::kUnavailable);
  EXPECT_THAT(failed.status.message, HasSubstr("disk I/O error"));
  const Reply not_deleted = server->Ask(About(RequestKind::kSiteDelete));
  EXPECT_EQ(not_deleted.status.code, StatusCode::kUnavailable);
  EXPECT_THAT(not_deleted.status.message, HasSubstr("disk I/O error"));
  vfs.Set(DiskFault::kNone);
  ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r1").durable_through == 41; }));
  EXPECT_FALSE(std::filesystem::exists(directory / "state" / "saved" / "lab.site"));
  const Reply saved = server->Ask(save);
  EXPECT_TRUE(saved.status.ok()) << saved.status.message;
}

}  // namespace
}  // namespace cairn::server::testing
