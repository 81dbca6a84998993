// cairnd as a process, over real DDS on loopback: what a stranger sees of it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <random>
#include <sstream>

#include "common/wire/bus.h"
#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/server/support/room_world.h"
#include "tests/temp_directory.h"

namespace cairn::server {
namespace {

using test::Eventually;
using test::Inbox;
using test::Must;
using ::testing::HasSubstr;
using testing::RoomOdometry;
using testing::RoomScan;
using testing::TruePose;

constexpr ClientId kClient = 77;

ChildProcess::Outcome RunCairnd(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), CAIRND_PATH);
  return ChildProcess(std::move(arguments)).Wait();
}

// CAIRN_DOMAIN is the machine's: above a shipped file, below what is typed.
TEST(CairndCommandLine, TheDomainOfTheMachineGivesWayToWhatIsTyped) {
  const TempDirectory directory;
  const std::string path = (directory / "c.yaml").string();
  std::ofstream(path) << "wire: {domain: 5}\n";
  setenv("CAIRN_DOMAIN", "77", 1);
  EXPECT_THAT(RunCairnd({"--config", path, "--print-config"}).output, HasSubstr("domain: 77 "));
  EXPECT_THAT(RunCairnd({"--set", "wire.domain=6", "--print-config"}).output, HasSubstr("domain: 6 "));
  EXPECT_THAT(RunCairnd({"--set", "wire.domain=6", "--domain", "7", "--print-config"}).output, HasSubstr("domain: 7 "));
  setenv("CAIRN_DOMAIN", "much", 1);
  const auto outcome = RunCairnd({"--check-config"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.output, HasSubstr("CAIRN_DOMAIN"));
  unsetenv("CAIRN_DOMAIN");
}

// systemd starts it again at once: ten times a second, for as long as something keeps it from starting.
TEST(CairndCommandLine, ThatCannotStartUnderSystemdTakesItsTime) {
  const auto begin = std::chrono::steady_clock::now();
  const auto outcome =
      ChildProcess({"/usr/bin/env", "NOTIFY_SOCKET=@none", CAIRND_PATH, "--set", "wire.interfaces=192.0.2.77",
                    "--domain", std::to_string(test::TestDomain()), "--state", "none"})
          .Wait();
  EXPECT_EQ(outcome.exit_code, 1) << outcome.output;
  EXPECT_GT(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(1900));
}

TEST(CairndCommandLine, PrintsItsVersion) {
  const auto outcome = RunCairnd({"--version"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.output, HasSubstr("cairnd "));
}

TEST(CairndCommandLine, TheCommentedDefaultConfigurationIsWhatItPrints) {
  const auto outcome = RunCairnd({"--print-config"});
  EXPECT_EQ(outcome.exit_code, 0);
  std::ifstream file(CAIRND_DEFAULT_CONFIG);
  const std::string deployed((std::istreambuf_iterator<char>(file)), {});
  EXPECT_EQ(outcome.output, deployed) << "renew it: cairnd --print-config > deploy/cairnd.yaml";
  EXPECT_EQ(RunCairnd({"--config", CAIRND_DEFAULT_CONFIG, "--check-config"}).exit_code, 0);
}

TEST(CairndCommandLine, SetOverridesTheFileAndDomainOverridesBoth) {
  const TempDirectory directory;
  const std::string path = (directory / "c.yaml").string();
  std::ofstream(path) << "maps: {publish_rate_hz: 4}\nwire: {domain: 5}\n";
  const auto outcome =
      RunCairnd({"--config", path, "--set", "maps.publish_rate_hz=3", "--domain", "9", "--print-config"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.output, HasSubstr("publish_rate_hz: 3 "));
  EXPECT_THAT(outcome.output, HasSubstr("domain: 9 "));
}

TEST(CairndCommandLine, WrongUsageAndABadFileEndWithTwoNamingTheLine) {
  EXPECT_EQ(RunCairnd({"--no-such-flag"}).exit_code, 2);
  EXPECT_EQ(RunCairnd({"--set", "slam.no_such_key=1"}).exit_code, 2);
  EXPECT_EQ(RunCairnd({"--domain", "9999"}).exit_code, 2);
  EXPECT_EQ(RunCairnd({"--domain", "-1"}).exit_code, 2);
  EXPECT_EQ(RunCairnd({"--set", "server.sites=a,b/c", "--check-config"}).exit_code, 2);
  EXPECT_EQ(RunCairnd({"--log-level", "loud"}).exit_code, 2);
  const TempDirectory directory;
  const std::string path = (directory / "bad.yaml").string();
  std::ofstream(path) << "maps:\n  publish_rate_hz: 4000\n";
  const auto outcome = RunCairnd({"--config", path, "--check-config"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.output, HasSubstr("bad.yaml:2"));
  EXPECT_THAT(outcome.output, HasSubstr("maps.publish_rate_hz"));
  EXPECT_EQ(RunCairnd({"--config", (directory / "absent.yaml").string()}).exit_code, 2);
}

TEST(CairndCommandLine, OptionsThatContradictEachOtherEndWithTwoAndOneLine) {
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"slam.grid.no_return_free_m=26", "slam.grid.no_return_free_m (26) must not exceed slam.grid.max_ray_m (25)"},
      {"server.inbound_capacity=100", "server.inbound_capacity (100) must be at least robots.max_robots (256)"},
      {"wire.liveliness_lease_s=4", "wire.liveliness_lease_s (4) must not exceed wire.participant_lease_s (3)"}};
  for (const auto& [assignment, message] : wrong) {
    for (const char* task : {"--check-config", "--domain=3"}) {
      const auto outcome = RunCairnd({"--set", assignment, task});
      EXPECT_EQ(outcome.exit_code, 2) << assignment;
      EXPECT_EQ(outcome.output, "cairnd: " + message + "\n");
    }
  }
}

// Whoever runs a server finds what there is to set on the first page, and nothing has two places.
TEST(CairndCommandLine, TheFirstPageIsForOperators) {
  const std::string output = RunCairnd({"--print-config"}).output;
  const std::string first = output.substr(0, output.find("\nexpert:\n"));
  ASSERT_LT(first.size(), output.size());
  int keys = 0;
  std::istringstream lines(first);
  for (std::string line; std::getline(lines, line);) {
    const auto text = line.find_first_not_of(' ');
    if (text == std::string::npos || line[text] == '#') continue;
    const std::string value = line.substr(line.find(':') + 1);
    keys += value.empty() || value.starts_with("  #") ? 0 : 1;
  }
  EXPECT_GE(keys, 25);
  EXPECT_LE(keys, 40);
  for (const char* wanted : {"domain:", "interfaces:", "log_level:", "threads:", "max_robots:", "particles:", "filter:",
                             "matcher:", "use_odometry:", "max_tilt_rad:", "resolution_m:"})
    EXPECT_THAT(first, HasSubstr(wanted));
  EXPECT_EQ(first.find("max_rival"), std::string::npos);
}

TEST(CairndCommandLine, AnAddressOfAnotherMachineIsAClearStartUpError) {
  const auto outcome = RunCairnd({"--set", "wire.interfaces=203.0.113.7"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.output, HasSubstr("203.0.113.7"));
}

// The first may come up; the others never will.
TEST(CairndCommandLine, TheCheckWarnsOfAnAddressThatIsNotThereAndRefusesWhatIsNone) {
  const auto absent = RunCairnd({"--set", "wire.interfaces=203.0.113.7", "--check-config"});
  EXPECT_EQ(absent.exit_code, 0);
  EXPECT_THAT(absent.output, HasSubstr("warning: wire.interfaces: this machine has no address 203.0.113.7"));
  EXPECT_THAT(absent.output, HasSubstr("the configuration is valid"));
  EXPECT_EQ(RunCairnd({"--check-config"}).output, "the configuration is valid\n");
  for (const std::string wrong : {"eth0", "127.0.0.1,300.0.0.1", "127.0.0.1,127.0.0.1", ""}) {
    for (const char* task : {"--check-config", "--domain=3"}) {
      const auto outcome = RunCairnd({"--set", "wire.interfaces=" + wrong, task});
      EXPECT_EQ(outcome.exit_code, 2) << wrong;
      EXPECT_THAT(outcome.output, HasSubstr("wire.interfaces: ")) << wrong;
    }
  }
}

// A robot's and a client's end of the wire, and cairnd at the other.
class Cairnd : public ::testing::Test {
 protected:
  void SetUp() override {
    process_.emplace(std::vector<std::string>{CAIRND_PATH, "--domain", std::to_string(test::TestDomain()), "--set",
                                              "slam.particles=20", "--set", "server.log_level=warn"});
    bus_ = test::MakeBus("test");
    sessions_ = Must(bus_->Advertise<SessionRequest>());
    scans_ = Must(bus_->Advertise<ScanSample>());
    odometry_ = Must(bus_->Advertise<OdometrySample>());
    requests_ = Must(bus_->Advertise<Request>());
    commands_ = Must(bus_->Advertise<Command>());
    subscriptions_.push_back(Must(bus_->Subscribe<SessionState>(states_.Sink())));
    subscriptions_.push_back(Must(bus_->Subscribe<PoseReport>(poses_.Sink())));
    subscriptions_.push_back(Must(bus_->Subscribe<Ledger>(ledgers_.Sink())));
    subscriptions_.push_back(Must(bus_->Subscribe<Reply>(replies_.Sink())));
    ASSERT_TRUE(Eventually([&] {
      return sessions_->matched() > 0 && scans_->matched() > 0 && odometry_->matched() > 0 &&
             requests_->matched() > 0 && commands_->matched() > 0 &&
             std::all_of(subscriptions_.begin(), subscriptions_.end(), [](auto& s) { return s->matched() > 0; });
    }));
  }
  void Open() {
    const SessionRequest request{.robot = "r1",
                                 .site = "lab",
                                 .sensors = {"laser"},
                                 .client = kClient,
                                 .has_start = false,
                                 .T_map_robot_start = {},
                                 .end = false,
                                 .session = kClient};
    ASSERT_TRUE(sessions_->Publish(request));
    ASSERT_TRUE(Eventually([&] {
      const auto states = states_.values();
      return !states.empty() && states.back().phase == SessionPhase::kActive;
    }));
  }
  void Send(const Scan& scan) { ASSERT_TRUE(scans_->Publish({stream_, scan})); }
  void Send(const Odometry& odometry) { ASSERT_TRUE(odometry_->Publish({stream_, odometry})); }
  // Of the scans: odometry has a ledger of its own.
  Ledger LastLedger() {
    Ledger last;
    for (const Ledger& ledger : ledgers_.values()) {
      if (ledger.sensor_id == stream_.sensor_id) last = ledger;
    }
    return last;
  }
  void Drive(int first, int last) {
    for (int step = first; step < last; ++step) {
      Send(RoomOdometry(step));
      Send(RoomScan(step));
      const auto ahead = static_cast<std::uint64_t>(std::max(0, step - 15));
      ASSERT_TRUE(Eventually([&] { return LastLedger().settled_through >= ahead; }));
    }
    ASSERT_TRUE(Eventually([&] { return LastLedger().settled_through >= static_cast<std::uint64_t>(last); }));
  }
  Reply Ask(RequestKind kind) {
    Request request;
    request.client = kClient;
    request.sequence = ++asked_;
    request.kind = kind;
    request.site = "lab";
    request.robot = "r1";
    EXPECT_TRUE(IsCommand(request.kind) ? commands_->Publish({request}) : requests_->Publish(request));
    Reply whole;
    whole.status.code = StatusCode::kDeadlineExceeded;
    Eventually([&] {
      for (const Reply& part : replies_.values()) {
        if (part.client != kClient || part.sequence != asked_) continue;
        whole = part;
        return part.last;
      }
      return false;
    });
    return whole;
  }

  StreamId stream_{HashName("r1"), HashName("laser"), kClient};
  std::optional<ChildProcess> process_;
  std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<wire::Publication<SessionRequest>> sessions_;
  std::unique_ptr<wire::Publication<ScanSample>> scans_;
  std::unique_ptr<wire::Publication<OdometrySample>> odometry_;
  std::unique_ptr<wire::Publication<Request>> requests_;
  std::unique_ptr<wire::Publication<Command>> commands_;
  Inbox<SessionState> states_;
  Inbox<PoseReport> poses_;
  Inbox<Ledger> ledgers_;
  Inbox<Reply> replies_;
  std::int64_t asked_ = 0;
  std::vector<std::unique_ptr<wire::Subscription>> subscriptions_;
};

TEST_F(Cairnd, StreamsAnswersAndStopsCleanly) {
  Open();
  Drive(0, 60);
  EXPECT_EQ(LastLedger().used, 60U);
  EXPECT_EQ(LastLedger().dropped_total(), 0U);
  // A busy reader may miss poses, each superseded by the next; the newest always comes.
  ASSERT_TRUE(Eventually([&] {
    const std::vector<PoseReport> poses = poses_.values();
    return !poses.empty() && poses.back().scan_sequence == 60U;
  }));
  EXPECT_LT(Between(TruePose(59), poses_.values().back().T_map_robot).translation().norm(), 0.1);
  EXPECT_EQ(Ask(RequestKind::kPath).path.size(), 60U);
  EXPECT_FALSE(Ask(RequestKind::kPing).server_version.empty());

  // A late joiner gets the whole map, every level.
  Inbox<TileSample> tiles;
  const auto late = Must(bus_->Subscribe<TileSample>(tiles.Sink()));
  const auto count = [&] {
    std::map<TileKey, Tile> current;
    for (const TileSample& sample : tiles.values()) current[sample.tile.key] = sample.tile;
    return current;
  };
  ASSERT_TRUE(Eventually([&] { return count().size() >= 6; }));
  for (const auto& [key, tile] : count()) EXPECT_TRUE(DecodeCells(tile.bytes, tile.encoding));

  const auto begin = std::chrono::steady_clock::now();
  process_->Signal(SIGTERM);
  const auto outcome = process_->Wait();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(30));  // Also on a busy machine.
  ASSERT_TRUE(Eventually([&] { return states_.values().back().phase == SessionPhase::kSuspended; }));
  EXPECT_THAT(states_.values().back().status.message, HasSubstr("stopping"));
}

TEST_F(Cairnd, BadInputOverTheWireIsCountedAndHarmsNobody) {
  Open();
  Drive(0, 10);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<std::pair<DropReason, std::function<void(Scan&)>>> spoils = {
      {DropReason::kEmpty, [](Scan& scan) { scan.ranges_m.clear(); }},
      {DropReason::kEmpty, [nan](Scan& scan) { scan.ranges_m.assign(181, nan); }},
      {DropReason::kTooManyBeams, [](Scan& scan) { scan.ranges_m.assign(kMaxBeams + 1, 3.0F); }},
      {DropReason::kBadGeometry, [](Scan& scan) { scan.angle_step_rad = 0.0; }},
      {DropReason::kDuplicateStamp, [](Scan& scan) { scan.stamp = RoomScan(9).stamp; }},
      {DropReason::kStampWentBack, [](Scan& scan) { scan.stamp = RoomScan(5).stamp; }},
      {DropReason::kStampJump, [](Scan& scan) { scan.stamp += 365LL * 86400 * kNanosPerSecond; }}};
  std::map<DropReason, std::uint64_t> expected;
  int sequence = 10;
  for (const auto& [reason, spoil] : spoils) {
    Scan scan = RoomScan(10);
    scan.sequence = static_cast<std::uint64_t>(++sequence);
    spoil(scan);
    Send(scan);
    ++expected[reason];
  }
  for (int step = 10; step < 20; ++step) {
    Scan scan = RoomScan(step);
    scan.sequence = static_cast<std::uint64_t>(++sequence);
    Send(RoomOdometry(step));
    Send(scan);
  }
  ASSERT_TRUE(Eventually([&] { return LastLedger().used == 20; }));
  const Ledger ledger = LastLedger();
  for (const auto& [reason, count] : expected) {
    EXPECT_EQ(ledger.dropped[static_cast<std::size_t>(reason)], count) << DropReasonName(reason);
  }
  EXPECT_EQ(ledger.received, 27U);
  ASSERT_TRUE(Eventually([&] { return poses_.values().back().scan_sequence == 27U; }));
  EXPECT_LT(Between(TruePose(19), poses_.values().back().T_map_robot).translation().norm(), 0.1);
}

// The domain's lock keeps a second cairnd of this machine away; who subscribes to requests is a server of another one.
TEST_F(Cairnd, SaysWhenAServerOfAnotherMachineJoinsItsDomain) {
  const auto bus = test::MakeBus("another server");
  const auto requests = Must(bus->Subscribe<Request>([](Request&&) {}));
  EXPECT_TRUE(process_->Says("another server serves this DDS domain"));
}

TEST_F(Cairnd, ASmoothingJobRunsWhileScansStream) {
  Open();
  Drive(0, 30);
  const Reply submitted = Ask(RequestKind::kJobSubmit);
  ASSERT_EQ(submitted.jobs.size(), 1U) << submitted.status.message;
  Drive(30, 60);
  ASSERT_TRUE(Eventually([&] {
    const Reply jobs = Ask(RequestKind::kJobList);
    return jobs.jobs.size() == 1 && jobs.jobs[0].state == JobState::kSucceeded;
  }));
  const Reply info = Ask(RequestKind::kMapInfo);
  ASSERT_EQ(info.maps.size(), 1U);
  EXPECT_EQ(info.maps[0].epoch, 1U);
  EXPECT_EQ(info.maps[0].enabled_version, 2U);
  EXPECT_EQ(LastLedger().used, 60U);
}

}  // namespace
}  // namespace cairn::server
