// Records that a server cannot read, because they are damaged or a newer server has written them: they stay in the
// store as they are, the operator is told, and everything else comes back.
#include <gmock/gmock.h>

#include <iomanip>
#include <sstream>

#include "server/store/envelope.h"
#include "server/store/site_edit.h"
#include "tests/server/support/raw_records.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

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
  ServerOptions options = TestOptions();
  options.robots.max_earlier = 0;
  StoredServer server(state, options);
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

// A damaged index hides a record. The site began anew, and wrote over its versions.
TEST(Restore, ASiteWhoseRecordIsMissingIsSetAsideUntilItIsDeleted) {
  const TempDirectory directory;
  const auto state = directory / "0";
  ASSERT_NO_FATAL_FAILURE(MakeTwoSites(state));
  const auto remains = [](Store& store) {
    return std::pair{*store.Numbers({.kind = RecordKind::kMapVersion, .owner = HashName("lab")}),
                     *store.Numbers({.kind = RecordKind::kLayer, .owner = HashName("lab")})};
  };
  {
    const auto store = *OpenStore(state);
    ASSERT_TRUE(store->Commit({.removed = {{.kind = RecordKind::kSite, .owner = HashName("lab")}}, .put = {}}));
  }
  StoredServer server(state);
  const auto before = remains(server.store());
  ASSERT_FALSE(before.first.empty());
  ASSERT_FALSE(before.second.empty());
  Request everybody = About(RequestKind::kStatus, "");
  everybody.site.clear();
  const Reply status = server->Ask(everybody);
  EXPECT_EQ(Robots(status), std::vector<std::string>{"r2"});
  EXPECT_THAT(status.status.message, ::testing::HasSubstr("site 'lab' is set aside (its own record is missing"));
  server->Open("r1", kDriver);
  ASSERT_TRUE(server->WaitPhase("r1", kDriver, SessionPhase::kRefused));
  EXPECT_EQ(remains(server.store()), before);
  const Reply deleted = server->Ask(About(RequestKind::kSiteDelete));
  EXPECT_TRUE(deleted.status.ok()) << deleted.status.message;
  EXPECT_EQ(remains(server.store()), (std::pair<std::vector<std::uint64_t>, std::vector<std::uint64_t>>{}));
  server->Open("r1", kDriver);
  ASSERT_TRUE(server->WaitPhase("r1", kDriver, SessionPhase::kActive));
}

struct BadRecord {
  RecordKind kind;
  std::string owner;                // As SQL.
  std::vector<std::string> robots;  // Who is there without it.
  std::string told;                 // In the server's state.
  Result<void> (*remove)(Store&);
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

  // As deploy/README.md says how to be rid of it.
  {
    const auto store = *OpenStore(state);
    ASSERT_TRUE(GetParam().remove(*store));
    ASSERT_TRUE(RemoveRests(*store));
  }
  StoredServer cleaned(state);
  const Reply status = cleaned->Ask(About(RequestKind::kStatus, ""));
  EXPECT_TRUE(status.status.ok());
  EXPECT_THAT(status.status.message, ::testing::Not(::testing::HasSubstr("set aside")));
}

Result<void> DeleteLab(Store& store) {
  return DeleteSite(store, "lab");
}
Result<void> DeleteLayer(Store& store) {
  return DeleteSession(store, "lab", 1);
}
Result<void> DeleteThird(Store& store) {
  return DeleteUnreadable(store, 3);
}
Result<void> DeleteFirstJob(Store& store) {
  return DeleteJob(store, 1);
}

INSTANTIATE_TEST_SUITE_P(
    OfEachKind, RestoreOneBadRecord,
    ::testing::Values(BadRecord{RecordKind::kSite, Sql(HashName("lab")), {"r2"}, "site 'lab'", DeleteLab},
                      BadRecord{RecordKind::kMapVersion,
                                Sql(HashName("lab")) + " AND number = " + Sql(2),
                                {"r0", "r1", "r2"},
                                "map version 2 of site 'lab'",
                                DeleteLab},
                      BadRecord{RecordKind::kLayer,
                                Sql(HashName("lab")),
                                {"r0", "r1", "r2"},
                                "session 1 has drawn of site 'lab'",
                                DeleteLayer},
                      BadRecord{RecordKind::kSession, Sql(3), {"r0", "r2"}, "session 3", DeleteThird},
                      BadRecord{RecordKind::kJob, Sql(1), {"r0", "r1", "r2"}, "job 1", DeleteFirstJob}),
    [](const auto& one) { return "Kind" + std::to_string(static_cast<int>(one.param.kind)); });

// A robot that does not say where it starts comes to the site. It must not begin the map anew.
void JoinsAndBeginsNothing(StoredServer& server) {
  server->Open("r2", 8, "lab", std::nullopt);
  ASSERT_TRUE(server->WaitPhase("r2", 8, SessionPhase::kActive));
  server->Drive("r2", 8, 0, 4);
  std::optional<PoseReport> pose;
  ASSERT_TRUE(server->WaitFor([&] {
    for (const PoseReport& one : server->All<PoseReport>())
      if (!pose && one.robot == "r2") pose = one;
    return pose.has_value();
  }));
  EXPECT_EQ(pose->reason, PoseReason::kNotJoined);
}

// Robot r1 has driven here, in session 1.
void MakeOneSession(const std::filesystem::path& state) {
  ServerOptions options = TestOptions();
  options.robots.checkpoint_entries = 40;
  StoredServer first(state, options);
  first->Open("r1", kDriver);
  first->Drive("r1", kDriver, 0, 60);
  ASSERT_TRUE(first->WaitFor([&] { return DurableScans(*first.operator->()) == 60; }));
}

// The map that the session had drawn was gone, and the next robot began another one at its origin, `tracking`.
TEST(Restore, ADamagedJournalLeavesTheMapOfTheCheckpointAndNobodyBeginsItAnew) {
  const TempDirectory directory;
  ASSERT_NO_FATAL_FAILURE(MakeOneSession(directory / "0"));
  {
    ServerOptions options = TestOptions();
    options.robots.checkpoint_entries = 1'000'000;  // What follows stays in the journal.
    options.robots.checkpoint_work_s = 1e6;
    StoredServer again(directory / "0", options);
    SayStarted(*again.operator->());
    ASSERT_TRUE(again->WaitPhase("r1", kDriver, SessionPhase::kActive));
    again->Drive("r1", kDriver, 60, 65);
    ASSERT_TRUE(again->WaitFor([&] { return DurableScans(*again.operator->()) == 65; }));
    CopyState(directory / "0", directory / "1");  // As a kill leaves it.
  }
  const std::string journal = "kind = 2 AND owner = " + Sql(1);
  ASSERT_EQ(RawRecords(directory / "1")
                .Run("UPDATE records SET content = CAST(substr(content, 1, 20) || x'00ff00' ||"
                     " substr(content, 24) AS BLOB) WHERE " +
                     journal + " AND number = (SELECT MAX(number) FROM records WHERE " + journal + ")"),
            1);
  StoredServer second(directory / "1");
  EXPECT_THAT(second->Ask(About(RequestKind::kStatus, "")).status.message,
              ::testing::HasSubstr("session 1 of robot 'r1' in site 'lab' is set aside"));
  EXPECT_TRUE(second->WaitFor([&] { return second->CurrentTiles().size() >= 4; }));
  JoinsAndBeginsNothing(second);
}

// A kill right after the first session of a site: the session was stored, and its site not yet. Where a server makes
// only the sites that it was told, the session was set aside.
TEST(Restore, ASessionComesBackWhoseConfiguredSiteWasNotStoredYet) {
  const TempDirectory directory;
  ASSERT_NO_FATAL_FAILURE(MakeOneSession(directory / "0"));
  {
    const auto store = *OpenStore(directory / "0");
    RecordChanges changes;
    for (const RecordKind kind : {RecordKind::kSite, RecordKind::kMapVersion, RecordKind::kLayer})
      changes.removed.push_back({.kind = kind, .owner = HashName("lab")});
    ASSERT_TRUE(store->Commit(changes));
  }
  ServerOptions options = TestOptions();
  options.server.sites = "lab";
  options.server.create_sites = false;
  StoredServer second(directory / "0", options);
  const Reply status = second->Ask(About(RequestKind::kStatus, ""));
  EXPECT_EQ(Robots(status), std::vector<std::string>{"r1"});
  EXPECT_TRUE(status.status.ok());
  EXPECT_EQ(status.status.message, "");
  EXPECT_EQ(PathOf(*second.operator->()).size(), 60U);
}

// Not even the site of the session can be read. A damaged index hides a record altogether.
TEST(Restore, NobodyBeginsTheMapOfASessionAnewWhoseOwnRecordIsDamagedOrMissing) {
  const std::string record = " WHERE kind = 1 AND owner = " + Sql(1);
  const std::string damage = "UPDATE records SET content = CAST(x'00ff00' || substr(content, 4) AS BLOB)";
  for (const std::string& change : {damage + record, "DELETE FROM records" + record}) {
    const TempDirectory directory;
    ASSERT_NO_FATAL_FAILURE(MakeOneSession(directory / "0"));
    ASSERT_EQ(RawRecords(directory / "0").Run(change), 1);
    const auto journal = [&] { return RawRecords(directory / "0").Of("kind IN (2, 3) AND owner = " + Sql(1)); };
    const auto before = journal();
    ASSERT_FALSE(before.empty());
    {
      StoredServer second(directory / "0");
      EXPECT_THAT(second->Ask(About(RequestKind::kStatus, "")).status.message,
                  ::testing::HasSubstr("session 1 is set aside"));
      JoinsAndBeginsNothing(second);
    }
    EXPECT_EQ(journal(), before);
  }
}

}  // namespace
}  // namespace cairn::server::testing
