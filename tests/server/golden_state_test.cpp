// State directories that earlier versions have written are restored for ever (tests/golden/README.md says how each was
// made), also where only the checkpoints are left, and although this server has other options.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>

#include "server/slam/checkpoint.h"
#include "server/store/envelope.h"
#include "server/store/site_file.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

Request OfLab(RequestKind kind) {
  Request request;
  request.kind = kind;
  request.site = "lab";
  return request;
}

// A new format needs a state directory in tests/golden that was written with it; one of site files, a saved site.
static_assert(slam::kCheckpointFormat == 15);
static_assert(kRecordFormat == 2);
static_assert(kSiteFileFormat == 2);

// However long ago the states were written: no session is too old to be shown.
ServerOptions AnyAge() {
  ServerOptions options = TestOptions();
  options.robots.suspended_expiry_s = 1e10;
  return options;
}

class GoldenState : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const char* const source = std::getenv("CAIRN_SOURCE_DIR");
    ASSERT_NE(source, nullptr);
    std::filesystem::create_directories(state());
    const auto golden = std::filesystem::path(source) / "tests" / "golden" / GetParam() / "cairn.db";
    ASSERT_TRUE(std::filesystem::copy_file(golden, state() / "cairn.db")) << golden;
  }
  [[nodiscard]] std::filesystem::path state() const { return directory_ / "0"; }
  // Removes what came before the checkpoints, as a small store.max_gib does.
  void RemoveBeginnings() const {
    const auto store = *OpenStore(state());
    const auto sessions = store->Owners(RecordKind::kSession);
    ASSERT_TRUE(sessions);
    for (const std::uint64_t session : *sessions) {
      const auto checkpoint = ReadCheckpoint(*store, session);
      ASSERT_TRUE(checkpoint && *checkpoint);
      ASSERT_TRUE(store->Commit(
          {.removed = {{.kind = RecordKind::kJournal, .owner = session, .first = 0, .last = (*checkpoint)->position}},
           .put = {}}));
    }
  }
  void ExpectWhatItHolds() const {
    StoredServer server(state(), AnyAge());
    WholeServer& house = *server.operator->();
    const Reply status = house.Ask(About(RequestKind::kStatus, ""));
    EXPECT_THAT(status.status.message, ::testing::IsEmpty());  // Nothing is set aside.
    ASSERT_EQ(status.robots.size(), 2U);
    for (const char* const robot : {"robot1", "robot2"}) EXPECT_EQ(PathOf(house, robot).size(), 32U) << robot;
    ASSERT_TRUE(house.WaitFor([&] { return house.CurrentTiles().size() >= 4; }));
    const Reply map = house.Ask(OfLab(RequestKind::kMapInfo));
    ASSERT_EQ(map.maps.size(), 1U);
    EXPECT_EQ(map.maps[0].epoch, 1U);
    EXPECT_EQ(map.maps[0].enabled_version, 2U);
    EXPECT_EQ(house.Ask(OfLab(RequestKind::kJobList)).jobs.size(), 1U);
  }

 private:
  const TempDirectory directory_;
};

TEST_P(GoldenState, IsRestoredFromItsJournals) {
  ExpectWhatItHolds();
}

TEST_P(GoldenState, IsRestoredFromItsCheckpoints) {
  ASSERT_NO_FATAL_FAILURE(RemoveBeginnings());
  ExpectWhatItHolds();
}

const auto kNameOf = [](const ::testing::TestParamInfo<const char*>& state) {
  std::string name = state.param;
  std::ranges::replace(name, '-', '_');
  return name;
};
INSTANTIATE_TEST_SUITE_P(EveryVersion, GoldenState,
                         ::testing::Values("state-1", "state-1-checkpoints-8", "state-1-checkpoints-9",
                                           "state-1-checkpoints-10", "state-1-checkpoints-10-dpslam",
                                           "state-1-checkpoints-11-dpslam", "state-1-checkpoints-12",
                                           "state-1-checkpoints-13", "state-1-checkpoints-14", "state-1-checkpoints-15",
                                           "state-1-ended"),
                         kNameOf);

class GoldenEndedCheckpoint : public GoldenState {};
INSTANTIATE_TEST_SUITE_P(EveryVersion, GoldenEndedCheckpoint,
                         ::testing::Values("state-1-checkpoints-10", "state-1-checkpoints-11-dpslam",
                                           "state-1-checkpoints-12", "state-1-checkpoints-13", "state-1-checkpoints-14",
                                           "state-1-checkpoints-15"),
                         kNameOf);

TEST_P(GoldenEndedCheckpoint, TheEndIsRestoredFromTheCheckpointAlone) {
  ASSERT_NO_FATAL_FAILURE(RemoveBeginnings());
  StoredServer server(state(), AnyAge());
  std::map<std::string, SessionPhase> phases;
  for (const RobotStatus& robot : server->Ask(About(RequestKind::kStatus, "")).robots)
    phases[robot.session.robot] = robot.session.phase;
  EXPECT_EQ(phases["robot1"], SessionPhase::kSuspended);
  EXPECT_EQ(phases["robot2"], SessionPhase::kEnded);
}

class GoldenEnded : public GoldenState {};
INSTANTIATE_TEST_SUITE_P(EveryVersion, GoldenEnded, ::testing::Values("state-1-ended"), kNameOf);

TEST_P(GoldenEnded, TheOrderInWhichSessionsEndedIsRestored) {
  {
    StoredServer server(state(), AnyAge());
    const Reply status = server->Ask(About(RequestKind::kStatus, ""));
    ASSERT_EQ(status.robots.size(), 2U);
    for (const RobotStatus& robot : status.robots) EXPECT_EQ(robot.session.phase, SessionPhase::kEnded);
  }
  const auto store = *OpenStore(state());
  std::vector<std::string> ended;
  const auto sessions = *ReadSessions(*store);
  const auto take = [&](std::uint64_t, std::string_view bytes) -> Result<void> {
    const auto site = SiteOf(bytes);
    for (const std::uint64_t session : site->past) ended.push_back(sessions.at(session).request.robot);
    return {};
  };
  ASSERT_TRUE(store->Read({.kind = RecordKind::kSite, .owner = HashName("lab")}, take));
  EXPECT_THAT(ended, ::testing::ElementsAre("robot2", "robot1"));
}

}  // namespace
}  // namespace cairn::server::testing
