// Sessions that cannot be restored: damaged records, and data that ends every server that reads it. The others come
// back, and the robot of such a session is told to open a new one.
#include <gmock/gmock.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <iomanip>
#include <new>
#include <sstream>

#include "server/store/envelope.h"
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

// The owner as a number of SQL.
std::string Sql(std::uint64_t owner) {
  return std::to_string(static_cast<std::int64_t>(owner ^ (std::uint64_t{1} << 63)));
}

class RawRecords {
 public:
  explicit RawRecords(const std::filesystem::path& directory) {
    EXPECT_EQ(sqlite3_open((directory / "cairn.db").c_str(), &database_), SQLITE_OK);
  }
  RawRecords(const RawRecords&) = delete;
  RawRecords& operator=(const RawRecords&) = delete;
  ~RawRecords() { sqlite3_close(database_); }

  int Run(const std::string& sql) {
    EXPECT_EQ(sqlite3_exec(database_, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database_);
    return sqlite3_changes(database_);
  }
  // The bytes of these records, in hexadecimal digits.
  std::vector<std::string> Of(const std::string& where) {
    std::vector<std::string> all;
    const auto take = [](void* to, int, char** values, char**) {
      static_cast<std::vector<std::string>*>(to)->emplace_back(values[0]);
      return 0;
    };
    const std::string sql = "SELECT hex(content) FROM records WHERE " + where + " ORDER BY owner, number";
    EXPECT_EQ(sqlite3_exec(database_, sql.c_str(), take, &all, nullptr), SQLITE_OK) << sqlite3_errmsg(database_);
    return all;
  }

 private:
  sqlite3* database_ = nullptr;
};

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
  Result<std::vector<std::uint64_t>> Numbers(const RecordRange& range) override { return store_->Numbers(range); }
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
  // And so does every later start.
  EXPECT_EQ(StartElsewhere(directory / "0", options, 1), 0);
  EXPECT_EQ(failed(1), 2U);
  EXPECT_EQ(failed(2), 0U);
  StoredServer second(directory / "0", options);
  const Reply status = second->Ask(About(RequestKind::kStatus, ""));
  ASSERT_EQ(status.robots.size(), 1U);
  EXPECT_EQ(status.robots[0].session.robot, "r2");
  EXPECT_EQ(PathOf(*second.operator->(), "r2").size(), 60U);
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
  ASSERT_TRUE(RestoreMarks::Read(**OpenStore(directory / "0"))->Set(1, 2));
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

std::vector<std::string> Robots(const Reply& status) {
  std::vector<std::string> robots;
  for (const RobotStatus& robot : status.robots) robots.push_back(robot.session.robot);
  return robots;
}

enum class Newer { kRecord, kEstimator };

// Makes the session's newest checkpoint one of a format that this server does not know.
void MakeNewer(const std::filesystem::path& directory, std::uint64_t session, Newer what) {
  RecordKey key{RecordKind::kCheckpoint, session, 0};
  std::string bytes;
  {
    const auto store = *OpenStore(directory);
    const auto find = [&](std::uint64_t number, std::string_view content) -> Result<void> {
      if (content.find("CAIRNEST") == std::string_view::npos) return {};
      key.number = number;
      bytes = content;
      return {};
    };
    ASSERT_TRUE(store->Read({.kind = RecordKind::kCheckpoint, .owner = session}, find));
    ASSERT_FALSE(bytes.empty());
    if (what == Newer::kEstimator) {
      ++bytes[bytes.find("CAIRNEST") + 8];
      ASSERT_TRUE(store->Commit({.removed = {}, .put = {{key, bytes}}}));
      return;
    }
  }
  std::ostringstream hex;
  for (const char byte : EnvelopeCodec().Seal(key, bytes, kRecordFormat + 1))
    hex << std::hex << std::setw(2) << std::setfill('0') << static_cast<int>(static_cast<unsigned char>(byte));
  EXPECT_EQ(RawRecords(directory).Run("UPDATE records SET content = x'" + hex.str() + "' WHERE kind = 3 AND owner = " +
                                      Sql(session) + " AND number = " + Sql(key.number)),
            1);
}

// The server went on from the journal, and wrote over it.
TEST(Restore, ACheckpointOfANewerServerIsKeptAndItsSessionIsSetAside) {
  for (const Newer what : {Newer::kRecord, Newer::kEstimator}) {
    const TempDirectory directory;
    ServerOptions options = TestOptions();
    options.robots.checkpoint_entries = 40;
    DriveTwoRobots(directory / "0", options);
    ASSERT_NO_FATAL_FAILURE(MakeNewer(directory / "0", 1, what));
    const auto records = [&] { return RawRecords(directory / "0").Of("kind IN (2, 3) AND owner = " + Sql(1)); };
    const auto before = records();
    {
      StoredServer second(directory / "0", options);
      const Reply status = second->Ask(About(RequestKind::kStatus, ""));
      EXPECT_EQ(Robots(status), std::vector<std::string>{"r2"});
      EXPECT_THAT(status.status.message, ::testing::HasSubstr("session 1 of robot 'r1' in site 'lab' is set aside"));
      EXPECT_THAT(status.status.message, ::testing::HasSubstr("format"));
      SayStarted(*second.operator->());
      ASSERT_TRUE(second->WaitPhase("r1", kDriver, SessionPhase::kRefused));
      second->Open("r1", kDriver);
      second->Drive("r1", kDriver, 0, 60);
    }
    EXPECT_EQ(records(), before);
  }
}

// Site lab with a session that is gone (its part of the map is left), r1 whose map was smoothed, and a job; site hall
// with r2.
void MakeTwoSites(const std::filesystem::path& state) {
  StoredServer server(state);
  server->Open("r0", 9);
  server->Drive("r0", 9, 0, 20);
  server->End("r0", 9);
  ASSERT_TRUE(server->WaitPhase("r0", 9, SessionPhase::kEnded));
  server->Open("r0", 9);
  ASSERT_TRUE(server->WaitPhase("r0", 9, SessionPhase::kActive));
  server->Open("r1", kDriver);
  server->Drive("r1", kDriver, 0, 60);
  const Reply submitted = server->Ask(About(RequestKind::kJobSubmit));
  ASSERT_EQ(submitted.jobs.size(), 1U);
  ASSERT_EQ(server->WaitJob(submitted.jobs[0].id).state, JobState::kSucceeded);
  server->Open("r2", 8, "hall");
  server->Drive("r2", 8, 0, 40);
  ASSERT_TRUE(server->WaitFor([&] { return server->LastLedger("r2").durable_through == 40; }));
}

struct BadRecord {
  RecordKind kind;
  std::string owner;                // As SQL.
  std::vector<std::string> robots;  // Who is there without it.
  std::string told;                 // In the server's state.
};

class RestoreOneBadRecord : public ::testing::TestWithParam<BadRecord> {
 protected:
  static std::string Where() {
    return "kind = " + std::to_string(static_cast<int>(GetParam().kind)) + " AND owner = " + GetParam().owner;
  }
};

// One such record kept every site from being served.
TEST_P(RestoreOneBadRecord, StaysInTheStoreAndEverythingElseComesBack) {
  const TempDirectory directory;
  const auto state = directory / "0";
  ASSERT_NO_FATAL_FAILURE(MakeTwoSites(state));
  std::vector<std::string> bad;
  {
    RawRecords raw(state);
    ASSERT_GE(raw.Run("UPDATE records SET content = CAST(x'00ff00' || substr(content, 4) AS BLOB) WHERE " + Where()),
              1);
    bad = raw.Of(Where());
  }
  for (int start = 0; start < 2; ++start) {
    StoredServer second(state);
    Request everybody = About(RequestKind::kStatus, "");
    everybody.site.clear();
    const Reply status = second->Ask(everybody);
    if (start == 0) {
      EXPECT_THAT(Robots(status), ::testing::UnorderedElementsAreArray(GetParam().robots));
    }
    EXPECT_THAT(status.status.message, ::testing::HasSubstr(GetParam().told));
    EXPECT_THAT(status.status.message, ::testing::HasSubstr("set aside"));
    EXPECT_EQ(PathOf(*second.operator->(), "r2").size(), 40U);
    // Whoever comes now writes over nothing.
    const std::string in_lab = "a" + std::to_string(start), in_hall = "b" + std::to_string(start);
    second->Open(in_hall, 98, "hall");
    ASSERT_TRUE(second->WaitPhase(in_hall, 98, SessionPhase::kActive));
    second->Open(in_lab, 99, "lab");
    ASSERT_TRUE(second->WaitFor([&] { return second->LastState(in_lab, 99).robot == in_lab; }));
    Request submit = About(RequestKind::kJobSubmit);
    submit.site = "hall";
    const Reply submitted = second->Ask(submit);
    ASSERT_EQ(submitted.jobs.size(), 1U);
    second->WaitJob(submitted.jobs[0].id);
  }
  const std::vector<std::string> left = RawRecords(state).Of(Where());
  EXPECT_THAT(left, ::testing::IsSupersetOf(bad));
}

INSTANTIATE_TEST_SUITE_P(OfEachKind, RestoreOneBadRecord,
                         ::testing::Values(BadRecord{RecordKind::kSite, Sql(HashName("lab")), {"r2"}, "site 'lab'"},
                                           BadRecord{RecordKind::kMapVersion,
                                                     Sql(HashName("lab")) + " AND number = " + Sql(2),
                                                     {"r0", "r1", "r2"},
                                                     "map version 2 of site 'lab'"},
                                           BadRecord{RecordKind::kLayer,
                                                     Sql(HashName("lab")),
                                                     {"r0", "r1", "r2"},
                                                     "session 1 has drawn of site 'lab'"},
                                           BadRecord{RecordKind::kSession, Sql(3), {"r0", "r2"}, "session 3"},
                                           BadRecord{RecordKind::kJob, Sql(1), {"r0", "r1", "r2"}, "job 1"}),
                         [](const auto& one) { return "Kind" + std::to_string(static_cast<int>(one.param.kind)); });

}  // namespace
}  // namespace cairn::server::testing
