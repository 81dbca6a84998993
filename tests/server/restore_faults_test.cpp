// Sessions that cannot be restored: damaged checkpoints, and data that ends every server that reads it. The others come
// back, and the robot of such a session is told to open a new one.
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <new>

#include "server/store/crash_note.h"
#include "server/store/restore_marks.h"
#include "tests/server/store/passing_store.h"
#include "tests/server/support/raw_records.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

// Turns over one byte in every part of the session's newest checkpoint, as a bad disk does.
void DamageCheckpoint(const std::filesystem::path& directory, std::uint64_t session) {
  EXPECT_GE(RawRecords(directory).Run("UPDATE records SET content = CAST(substr(content, 1, 200) || x'00ff00' ||"
                                      " substr(content, 204) AS BLOB) WHERE kind = 3 AND length(content) > 300 AND"
                                      " owner = " +
                                      Sql(session)),
            1);
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
class WatchedStore : public PassingStore {
 public:
  using BeforeRead = std::function<void(const RecordRange& range)>;
  WatchedStore(Store& store, BeforeRead before) : PassingStore(store), before_(std::move(before)) {}
  Result<void> Read(const RecordRange& range, const Visit& visit) override {
    before_(range);
    return PassingStore::Read(range, visit);
  }

 private:
  const BeforeRead before_;
};

// Starts a server on this state, and stops it; whether it started.
bool StartOnce(const std::filesystem::path& directory, const ServerOptions& options, WatchedStore::BeforeRead before) {
  const auto stored = *OpenStore(directory);
  WatchedStore store(*stored, std::move(before));
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

// Starts a server in a process of its own, in which this signal is raised when the journal of a session is read: as
// would a scan that the estimator cannot process, or somebody who kills it at this moment. Whether it started.
bool StartsElsewhere(const std::filesystem::path& directory, const ServerOptions& options, std::uint64_t deadly,
                     int signal) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit no_core{0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    const auto die = [deadly, signal](const RecordRange& range) {
      if (range.kind == RecordKind::kJournal && range.owner == deadly) raise(signal);
    };
    _exit(StartOnce(directory, options, die) ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
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
    return RestoreMarks::Read(*store, {.restoring = CrashNote::Of(directory / "0" / "crashed-session")})
        ->failed(session);
  };
  EXPECT_FALSE(StartsElsewhere(directory / "0", options, 1, SIGABRT));
  EXPECT_EQ(failed(1), 1U);
  EXPECT_EQ(failed(2), 0U);
  EXPECT_FALSE(StartsElsewhere(directory / "0", options, 1, SIGABRT));
  EXPECT_EQ(failed(1), 2U);
  EXPECT_EQ(failed(2), 0U);
  // Now it goes without that journal.
  EXPECT_TRUE(StartsElsewhere(directory / "0", options, 1, SIGABRT));
  // And so does every later start.
  EXPECT_TRUE(StartsElsewhere(directory / "0", options, 1, SIGABRT));
  EXPECT_EQ(failed(1), 2U);
  EXPECT_EQ(failed(2), 0U);
  StoredServer second(directory / "0", options);
  const Reply status = second->Ask(About(RequestKind::kStatus, ""));
  ASSERT_EQ(status.robots.size(), 1U);
  EXPECT_EQ(status.robots[0].session.robot, "r2");
  EXPECT_EQ(PathOf(*second.operator->(), "r2").size(), 60U);
}

// Two kills in a row at the start, by whoever, cost a robot its session and its journal.
TEST(Restore, KillsDuringStartsLoseNothing) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  DriveTwoRobots(directory / "0", options);
  for (int kill = 0; kill < 6; ++kill) EXPECT_FALSE(StartsElsewhere(directory / "0", options, 1, SIGKILL));
  StoredServer second(directory / "0", options);
  for (const char* robot : {"r1", "r2"}) EXPECT_EQ(PathOf(*second.operator->(), robot).size(), 60U) << robot;
  EXPECT_EQ(second->Ask(About(RequestKind::kStatus, "")).status.message, "");
}

// Where memory is not enough for a session, the system kills the process.
TEST(Restore, ASessionDuringWhichEveryStartIsKilledIsLeftOutInTheEnd) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  DriveTwoRobots(directory / "0", options);
  int kills = 0;
  while (!StartsElsewhere(directory / "0", options, 1, SIGKILL)) ASSERT_LT(++kills, 20);
  EXPECT_EQ(kills, 2 * static_cast<int>(RestoreMarks::kKillsPerFailure));
  StoredServer second(directory / "0", options);
  EXPECT_EQ(PathOf(*second.operator->(), "r2").size(), 60U);
}

// Starts that were given up are not counted as ends of the process.
TEST(Restore, AStartThatIsGivenUpIsDoneByTheNextOne) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  DriveTwoRobots(directory / "0", options);
  for (int start = 0; start < 4; ++start) {
    StartControl control;
    const auto stored = *OpenStore(directory / "0");
    WatchedStore store(*stored, [&control](const RecordRange& range) {
      if (range.kind == RecordKind::kJournal) control.GiveUp();
    });
    Journal journal(store, {.commit_delay_ms = 5});
    Inbound inbound(16);
    Outbound outbound(16);
    Server server(options, inbound, outbound, 1, &journal);
    const Result<void> started = server.Start(control);
    ASSERT_FALSE(started);
    EXPECT_EQ(started.error().code, StatusCode::kCancelled);
  }
  EXPECT_EQ(RestoreMarks::Read(**OpenStore(directory / "0"), {})->failed(1), 0U);
  StoredServer second(directory / "0", options);
  for (const char* robot : {"r1", "r2"}) EXPECT_EQ(PathOf(*second.operator->(), robot).size(), 60U);
}

TEST(Restore, OnlyEndsAtTheSamePlaceAreCountedTogether) {
  const TempDirectory directory;
  std::filesystem::create_directories(directory / "0");
  const auto store = *OpenStore(directory / "0");
  const auto ends_at = [&](std::uint64_t entries) {
    auto marks = *RestoreMarks::Read(*store, {.restoring = 1});
    ASSERT_TRUE(marks.Begin({1}));
    for (std::uint64_t entry = 1; entry <= entries; ++entry) ASSERT_TRUE(marks.Reached(1, entry));
  };
  const auto failed = [&] { return RestoreMarks::Read(*store, {.restoring = 1})->failed(1); };
  constexpr std::uint64_t kPlace = RestoreMarks::kPlaceEntries;
  ends_at(kPlace + 5);
  EXPECT_EQ(failed(), 1U);
  ends_at(3 * kPlace);
  EXPECT_EQ(failed(), 1U);
  ends_at(3 * kPlace + 7);
  EXPECT_EQ(failed(), 2U);
  // Without the journal it does not come to that place, and is one more all the same.
  ASSERT_TRUE(RestoreMarks::Read(*store, {.restoring = 1})->BeginWithoutJournal(1));
  EXPECT_EQ(failed(), 3U);
  ends_at(7);
  EXPECT_EQ(failed(), 1U);
}

// After a change of the estimator's options the whole journal is processed again. Where its beginning is gone, the
// session goes on as it was begun, so that no map is lost.
TEST(Restore, WithOtherOptionsASessionWithoutItsWholeJournalKeepsItsOwn) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  DriveTwoRobots(directory / "0", options);
  {
    const auto store = *OpenStore(directory / "0");
    const auto checkpoint = ReadCheckpoint(*store, 1);
    ASSERT_TRUE(checkpoint && *checkpoint);
    ASSERT_TRUE(store->Commit(
        {.removed = {{.kind = RecordKind::kJournal, .owner = 1, .first = 0, .last = (*checkpoint)->position}},
         .put = {}}));
  }
  const std::int64_t before = options.slam.filter.particles;
  options.slam.filter.particles = before + 1;
  for (int start = 0; start < 2; ++start) {
    StoredServer later(directory / "0", options);
    for (const char* robot : {"r1", "r2"}) EXPECT_EQ(PathOf(*later.operator->(), robot).size(), 60U) << robot;
    EXPECT_THAT(later->Ask(About(RequestKind::kStatus, "")).status.message, ::testing::IsEmpty());
    // It goes on.
    SayStarted(*later.operator->());
    ASSERT_TRUE(later->WaitPhase("r1", kDriver, SessionPhase::kActive));
  }
}

// Its journal was removed once, although another version of the server may be able to read it.
TEST(Restore, ASessionThatEndedTheServerStaysInTheStoreWithItsPartOfTheMapShown) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  {
    StoredServer first(directory / "0", options);
    first->Open("r1", kDriver);
    first->Drive("r1", kDriver, 0, 60);
    ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 60; }));
  }
  const auto records = [&] {
    RawRecords raw(directory / "0");
    return std::pair(raw.Of("kind = 2 AND owner = " + Sql(1)), raw.Of("kind = 3 AND owner = " + Sql(1)));
  };
  const auto before = records();
  ASSERT_FALSE(before.second.empty());
  ASSERT_TRUE(RestoreMarks::Read(**OpenStore(directory / "0"), {})->Set(1, 2));
  for (std::uint64_t start = 0; start < 2; ++start) {
    StoredServer second(directory / "0", options);
    const Reply status = second->Ask(About(RequestKind::kStatus, ""));
    EXPECT_TRUE(status.robots.empty());
    EXPECT_THAT(status.status.message, ::testing::HasSubstr("session 1 of robot 'r1' in site 'lab' is set aside"));
    EXPECT_THAT(status.status.message, ::testing::HasSubstr("ended 2 times"));
    EXPECT_TRUE(second->WaitFor([&] { return second->CurrentTiles().size() >= 4; }));
    // The next session of the robot has a number of its own.
    if (start == 0) continue;
    second->Open("r1", kDriver);
    ASSERT_TRUE(second->WaitPhase("r1", kDriver, SessionPhase::kActive));
  }
  EXPECT_EQ(records(), before);
  EXPECT_EQ(*(*OpenStore(directory / "0"))->Owners(RecordKind::kSession), (std::vector<std::uint64_t>{1, 2}));
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
    auto marks = *RestoreMarks::Read(*store, {});
    for (int failure = 0; failure < 3; ++failure) {
      ASSERT_TRUE(marks.Begin({1}));
      marks = *RestoreMarks::Read(*store, {.restoring = 1});
    }
    ASSERT_TRUE(marks.Settle());
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
