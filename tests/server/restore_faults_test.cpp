// Sessions that cannot be restored: damaged records, and data that ends every server that reads it. The others come
// back, and the robot of such a session is told to open a new one.
#include <gmock/gmock.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <new>

#include "server/store/restore_marks.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

// A server with two robots, which then stops.
void DriveTwoRobots(const std::filesystem::path& state, const ServerOptions& options) {
  StoredServer server(state, options);
  for (const char* robot : {"r1", "r2"}) {
    server->Open(robot, kDriver);
    server->Drive(robot, kDriver, 0, 60);
  }
  ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r2").durable_through == 60; }));
}

// Turns over one byte in every part of the session's newest checkpoint, as a bad disk does.
void DamageCheckpoint(const std::filesystem::path& directory, std::uint64_t session) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open((directory / "cairn.db").c_str(), &database), SQLITE_OK);
  const std::string sql =
      "UPDATE records SET content = CAST(substr(content, 1, 200) || x'00ff00' ||"
      " substr(content, 204) AS BLOB) WHERE kind = 3 AND length(content) > 300 AND owner = " +
      std::to_string(static_cast<std::int64_t>(session ^ (std::uint64_t{1} << 63)));
  ASSERT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
  EXPECT_GE(sqlite3_changes(database), 1);
  sqlite3_close(database);
}

TEST(Restore, ASessionWithDamagedRecordsIsRefusedAndTheOthersComeBack) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  DriveTwoRobots(directory / "0", options);
  std::uint64_t position = 0;
  {
    const auto store = *OpenStore(directory / "0");
    const auto checkpoint = ReadCheckpoint(*store, 1);
    ASSERT_TRUE(checkpoint && *checkpoint);
    // The end of the record that contains the entry of this position.
    const auto find = [&](std::uint64_t number, std::string_view) -> Result<void> {
      if (position == 0 && number >= (*checkpoint)->position) position = number;
      return {};
    };
    ASSERT_TRUE(store->Read({.kind = RecordKind::kJournal, .owner = 1}, find));
    ASSERT_GT(position, 0U);
  }
  ASSERT_NO_FATAL_FAILURE(DamageCheckpoint(directory / "0", 1));
  std::filesystem::copy(directory / "0", directory / "1");
  {
    // The journal is whole, and does as well.
    StoredServer second(directory / "0", options);
    EXPECT_EQ(second->Ask(About(RequestKind::kStatus, "")).robots.size(), 2U);
    EXPECT_EQ(PathOf(*second.operator->(), "r1").size(), 60U);
  }
  // The journal before it was removed, with or without anything after it.
  for (const std::uint64_t last : {position, UINT64_MAX}) {
    {
      const auto store = *OpenStore(directory / "1");
      ASSERT_TRUE(store->Commit(
          {.removed = {{.kind = RecordKind::kJournal, .owner = 1, .first = 0, .last = last}}, .put = {}}));
    }
    StoredServer second(directory / "1", options);
    const Reply status = second->Ask(About(RequestKind::kStatus, ""));
    ASSERT_EQ(status.robots.size(), 1U);
    EXPECT_EQ(status.robots[0].session.robot, "r2");
    EXPECT_EQ(PathOf(*second.operator->(), "r2").size(), 60U);
    // Its robot is told to open a new session, and why.
    SayStarted(*second.operator->());
    ASSERT_TRUE(second->WaitPhase("r1", kDriver, SessionPhase::kRefused));
    const Status refused = second->LastState("r1", kDriver).status;
    EXPECT_EQ(refused.code, StatusCode::kFailedPrecondition);
    EXPECT_THAT(refused.message, ::testing::AnyOf(::testing::HasSubstr("misses entries"),
                                                  ::testing::HasSubstr("the journal before it was removed")));
  }
}

// Calls a function before anything is read.
class WatchedStore : public Store {
 public:
  using BeforeRead = std::function<void(const RecordRange& range)>;
  WatchedStore(std::unique_ptr<Store> store, BeforeRead before)
      : store_(std::move(store)), before_(std::move(before)) {}
  Result<void> Commit(const RecordChanges& changes) override { return store_->Commit(changes); }
  Result<void> CommitEach(const Next& next) override { return store_->CommitEach(next); }
  Result<void> Read(const RecordRange& range, const Visit& visit) override {
    before_(range);
    return store_->Read(range, visit);
  }
  Result<std::vector<std::uint64_t>> Owners(RecordKind kind) override { return store_->Owners(kind); }
  Result<std::uint64_t> bytes_used() override { return store_->bytes_used(); }

 private:
  const std::unique_ptr<Store> store_;
  const BeforeRead before_;
};

// Starts a server on this state, and stops it; whether it started.
bool StartOnce(const std::filesystem::path& directory, const ServerOptions& options, WatchedStore::BeforeRead before) {
  WatchedStore store(*OpenStore(directory), std::move(before));
  Journal journal(store, {.commit_delay_ms = 5});
  Inbound inbound(16);
  Outbound outbound(16);
  Server server(options, inbound, outbound, 1, &journal);
  const bool started = server.Start().has_value();
  journal.Start();
  server.Stop();
  journal.Stop();
  return started;
}

constexpr int kDead = 77;

// Starts a server in a process of its own, which ends when it reads the journal of a session, as a scan would end it
// that the estimator cannot process. Returns its exit code: 0 where it started.
int StartElsewhere(const std::filesystem::path& directory, const ServerOptions& options, std::uint64_t deadly) {
  const pid_t child = fork();
  if (child == 0) {
    const auto die = [deadly](const RecordRange& range) {
      if (range.kind == RecordKind::kJournal && range.owner == deadly) _exit(kDead);
    };
    _exit(StartOnce(directory, options, die) ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

// The session was taken for one that is gone, and everything that was stored of it was removed.
TEST(Restore, ASessionThatCannotBeReadForLackOfMemoryStaysForTheNextStart) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  DriveTwoRobots(directory / "0", options);
  EXPECT_TRUE(StartOnce(directory / "0", options, [](const RecordRange& range) {
    if (range.kind == RecordKind::kCheckpoint && range.owner == 1) throw std::bad_alloc();
  }));
  StoredServer second(directory / "0", options);
  for (const char* robot : {"r1", "r2"}) EXPECT_EQ(PathOf(*second.operator->(), robot).size(), 60U);
}

TEST(Restore, ASessionWhoseJournalEndsTheServerDoesSoTwiceAndTheOthersComeBack) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  DriveTwoRobots(directory / "0", options);
  const auto failed = [&](std::uint64_t session) {
    const auto store = *OpenStore(directory / "0");
    return RestoreMarks::Read(*store)->failed(session);
  };
  EXPECT_EQ(StartElsewhere(directory / "0", options, 1), kDead);
  EXPECT_EQ(failed(1), 1U);
  EXPECT_EQ(StartElsewhere(directory / "0", options, 1), kDead);
  EXPECT_EQ(failed(1), 2U);
  // The other one was restored alone meanwhile, or its turn has not come.
  EXPECT_LE(failed(2), 1U);
  // Now it goes without that journal.
  EXPECT_EQ(StartElsewhere(directory / "0", options, 1), 0);
  EXPECT_EQ(failed(1), 0U);
  EXPECT_EQ(failed(2), 0U);
  {
    // The part of the map that r1 drew is kept without its session.
    const auto store = *OpenStore(directory / "0");
    EXPECT_EQ(*store->Owners(RecordKind::kSession), std::vector<std::uint64_t>{2});
    std::size_t chunks = 0;
    const auto take = [&chunks](std::uint64_t session, std::string_view bytes) -> Result<void> {
      EXPECT_EQ(session, 1U);
      chunks = LayerOf(bytes)->grid.chunks.size();
      return {};
    };
    EXPECT_TRUE(store->Read({.kind = RecordKind::kLayer, .owner = HashName("lab")}, take));
    EXPECT_GE(chunks, 2U);
  }
  StoredServer second(directory / "0", options);
  const Reply status = second->Ask(About(RequestKind::kStatus, ""));
  ASSERT_EQ(status.robots.size(), 1U);
  EXPECT_EQ(status.robots[0].session.robot, "r2");
  EXPECT_EQ(PathOf(*second.operator->(), "r2").size(), 60U);
}

TEST(Restore, ASessionThatEndsTheServerEvenWithoutItsJournalIsLeftOut) {
  const TempDirectory directory;
  {
    StoredServer first(directory / "0");
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 20);
  }
  {
    const auto store = *OpenStore(directory / "0");
    auto marks = *RestoreMarks::Read(*store);
    for (int failure = 0; failure < 3; ++failure) {
      ASSERT_TRUE(marks.Begin({1}));
      marks = *RestoreMarks::Read(*store);
    }
  }
  StoredServer second(directory / "0");
  EXPECT_TRUE(second->Ask(About(RequestKind::kStatus, "")).robots.empty());
  SayStarted(*second.operator->());
  ASSERT_TRUE(second->WaitPhase("r1", kDriver, SessionPhase::kRefused));
  EXPECT_NE(second->LastState("r1", kDriver).status.message.find("ended 3 times"), std::string::npos)
      << second->LastState("r1", kDriver).status.message;
}

}  // namespace
}  // namespace cairn::server::testing
