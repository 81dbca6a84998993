// `cairn record` as a process beside cairnd, over real DDS on loopback: a robot whose drive is recorded, and the
// recording read as a log.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "client/cli/program.h"
#include "common/bag/mcap_file.h"
#include "common/bag/recording.h"
#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/system/cli/simulated_log.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using test::Eventually;
using test::Must;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct Drive {
  std::vector<Scan> scans;
  std::vector<Odometry> odometries;
  std::vector<std::string> notes;
};

Drive Read(const std::filesystem::path& path) {
  Drive drive;
  const LogSummary summary = Must(ReadRecording(path, {}, [&](LogRecord&& record) {
    if (auto* const scan = std::get_if<Scan>(&record)) drive.scans.push_back(std::move(*scan));
    if (const auto* const odometry = std::get_if<Odometry>(&record)) drive.odometries.push_back(*odometry);
    return true;
  }));
  drive.notes = summary.notes;
  return drive;
}

// A robot that is told by the wire itself who listens: samples that are sent before the recorder is found do not reach
// it. The client library waits for the server only.
class ListenedRobot {
 public:
  ListenedRobot(const std::string& name, int listeners) : bus_(test::MakeBus(name)) {
    request_.robot = name;
    request_.site = "hall";
    request_.sensors = {"laser"};
    request_.client = HashName(name) | 1U;
    request_.session = request_.client;
    stream_.robot_id = HashName(name);
    stream_.session = request_.session;
    sessions_ = Must(bus_->Advertise<SessionRequest>(name));
    scans_ = Must(bus_->Advertise<ScanSample>(name));
    odometry_ = Must(bus_->Advertise<OdometrySample>(name));
    states_ = Must(bus_->Subscribe<SessionState>(answers_.Sink()));
    EXPECT_TRUE(Eventually([&] {
      return sessions_->matched() > 0 && scans_->matched() == listeners && odometry_->matched() == listeners;
    }));
    EXPECT_TRUE(Eventually([&] {
      Must(sessions_->Publish(request_));
      return answers_.WaitFor(1, std::chrono::milliseconds(500));
    }));
  }

  // Waits now and then until everything has arrived everywhere: a writer keeps only its last samples.
  void Publish(LogRecord record) {
    if (auto* const scan = std::get_if<Scan>(&record)) {
      scan->sequence = ++scans_sent_;
      stream_.sensor_id = HashName("laser");
      Must(scans_->Publish({stream_, std::move(*scan)}));
    } else {
      std::get<Odometry>(record).sequence = ++odometry_sent_;
      stream_.sensor_id = HashName("odometry");
      Must(odometry_->Publish({stream_, std::get<Odometry>(record)}));
    }
    if ((scans_sent_ + odometry_sent_) % 16 == 0) Settle();
  }
  void Settle() {
    constexpr std::chrono::seconds kDeadline{20};
    ASSERT_TRUE(scans_->WaitForAcknowledgement(kDeadline));
    ASSERT_TRUE(odometry_->WaitForAcknowledgement(kDeadline));
  }

 private:
  SessionRequest request_;
  StreamId stream_;
  std::uint64_t scans_sent_ = 0, odometry_sent_ = 0;
  test::Inbox<SessionState> answers_;
  const std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<wire::Publication<SessionRequest>> sessions_;
  std::unique_ptr<wire::Publication<ScanSample>> scans_;
  std::unique_ptr<wire::Publication<OdometrySample>> odometry_;
  std::unique_ptr<wire::Subscription> states_;
};

class CairnRecord : public SimulatedLog<12> {
 protected:
  void StartServer() {
    server_.emplace(std::vector<std::string>{CAIRND_PATH, "--domain", Domain(), "--set", "slam.particles=20",
                                             "--log-level", "info"});
    ASSERT_TRUE(server_->Says("ready"));
  }
  static std::string Domain() { return std::to_string(test::TestDomain()); }
  [[nodiscard]] std::vector<std::string> Command(std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {CAIRN_PATH, "--domain", Domain(), "--timeout", "20s", "record", File().string()});
    return more;
  }
  [[nodiscard]] std::filesystem::path File() const { return directory_ / "out.mcap"; }
  // Sends the log from its beginning, again and again with later stamps, until the condition holds.
  static bool DriveUntil(ListenedRobot& robot, const std::function<bool()>& condition) {
    const Drive log = Read(LogFile());
    const Stamp span = log.odometries.back().stamp - log.odometries.front().stamp + 20'000'000;
    std::size_t odometry = 0;
    for (std::size_t i = 0; i < 100 * log.scans.size(); ++i) {
      const auto later = static_cast<Stamp>(i / log.scans.size()) * span;
      Scan scan = log.scans[i % log.scans.size()];
      scan.stamp += later;
      robot.Publish(Odometry{0, scan.stamp, log.odometries[odometry++ % log.odometries.size()].T_odom_robot});
      robot.Publish(scan);
      if (condition()) return true;
    }
    return false;
  }

  TempDirectory directory_;
  std::optional<ChildProcess> server_;
};

TEST_F(CairnRecord, ADriveIsReadBackBitForBitAndGivesTheSameTrajectory) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  ChildProcess recorder(Command({"--map-every", "0.2"}));
  const Drive log = Read(LogFile());
  {
    ListenedRobot robot("r1", 2);
    Must(ReadRecording(LogFile(), {}, [&](LogRecord&& record) {
      robot.Publish(std::move(record));
      return !::testing::Test::HasFatalFailure();
    }));
    robot.Settle();
    // The server has used the last scan, and its map has been drawn.
    const auto status = [&](const std::vector<std::string>& arguments) {
      std::vector<std::string> all = {"--domain", Domain(), "--json"};
      all.insert(all.end(), arguments.begin(), arguments.end());
      std::ostringstream out, err;
      return RunCairn(all, out, err) == ExitCode::kOk ? nlohmann::json::parse(out.str()) : nlohmann::json();
    };
    EXPECT_TRUE(Eventually([&] {
      const auto pose = status({"pose", "r1"});
      return pose.contains("stamp") && pose["stamp"] == log.scans.back().stamp;
    }));
    EXPECT_TRUE(Eventually([&] { return status({"map", "info", "--site", "hall"})["maps"][0]["tile_count"] > 0; }));
  }
  recorder.Signal(SIGINT);
  const auto outcome = recorder.Wait();
  ASSERT_EQ(outcome.exit_code, 0) << outcome.output;
  EXPECT_THAT(outcome.output, HasSubstr(std::to_string(log.scans.size()) + " scans, "));
  EXPECT_THAT(outcome.output, ::testing::Not(HasSubstr("not recorded")));

  const Drive recorded = Read(File());
  ASSERT_EQ(recorded.scans.size(), log.scans.size());
  for (std::size_t i = 0; i < log.scans.size(); ++i) {
    EXPECT_EQ(recorded.scans[i].stamp, log.scans[i].stamp);
    EXPECT_EQ(recorded.scans[i].angle_first_rad, log.scans[i].angle_first_rad);
    EXPECT_EQ(recorded.scans[i].angle_step_rad, log.scans[i].angle_step_rad);
    EXPECT_EQ(recorded.scans[i].range_max_m, log.scans[i].range_max_m);
    EXPECT_EQ(recorded.scans[i].T_robot_laser, log.scans[i].T_robot_laser);
    EXPECT_EQ(recorded.scans[i].ranges_m, log.scans[i].ranges_m);
  }
  ASSERT_EQ(recorded.odometries.size(), log.odometries.size());
  for (std::size_t i = 0; i < log.odometries.size(); ++i) {
    EXPECT_EQ(recorded.odometries[i].stamp, log.odometries[i].stamp);
    EXPECT_EQ(recorded.odometries[i].T_odom_robot, log.odometries[i].T_odom_robot);
  }
  const auto trajectory = [&](const std::filesystem::path& of, const std::string& name) {
    const auto run = ChildProcess({CAIRN_OFFLINE_PATH, of.string(), "--set", "slam.particles=30", "--trajectory",
                                   (directory_ / name).string()})
                         .Wait();
    EXPECT_EQ(run.exit_code, 0) << run.output;
    return directory_.Read(name);
  };
  const std::string expected = trajectory(LogFile(), "log.tum");
  EXPECT_GT(expected.size(), 1000U);
  EXPECT_TRUE(trajectory(File(), "mcap.tum") == expected);

  const auto file = Must(bag::OpenMcap(File()));
  EXPECT_THAT(file->notes(), IsEmpty());
  std::set<std::string> topics;
  for (const bag::Topic& topic : file->topics()) topics.insert(topic.name + " " + topic.type);
  EXPECT_THAT(topics, ElementsAre("/log foxglove.Log", "/robots/r1/odometry foxglove.PoseInFrame",
                                  "/robots/r1/odometry/details cairn.recording.OdometryDetails",
                                  "/robots/r1/pose foxglove.PoseInFrame", "/robots/r1/scan/laser foxglove.LaserScan",
                                  "/robots/r1/scan/laser/details cairn.recording.ScanDetails",
                                  "/robots/r1/tf foxglove.FrameTransform", "/sites/hall/map foxglove.Grid"));
}

TEST_F(CairnRecord, AKilledRecorderLeavesWhatItHasWritten) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  ChildProcess recorder(Command());
  ListenedRobot robot("r1", 2);
  const auto is_large = [&] {
    std::error_code error;
    const auto bytes = std::filesystem::file_size(File(), error);
    return !error && bytes > 20'000;
  };
  EXPECT_TRUE(DriveUntil(robot, is_large));
  recorder.Signal(SIGKILL);
  static_cast<void>(recorder.Wait());
  const Drive recorded = Read(File());
  EXPECT_THAT(recorded.notes, ::testing::Contains(HasSubstr("its end is missing")));
  EXPECT_GT(recorded.scans.size(), 10U);
  EXPECT_GT(recorded.odometries.size(), 10U);

  // What is there is not overwritten unasked.
  const auto again = ChildProcess(Command()).Wait();
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.output, HasSubstr("out.mcap exists; --force overwrites it (ALREADY_EXISTS)"));
  EXPECT_EQ(Read(File()).scans.size(), recorded.scans.size());
  EXPECT_EQ(ChildProcess(Command({"--force", "--seconds", "0.1"})).Wait().exit_code, 0);
  EXPECT_THAT(ReadRecording(File(), {}, [](LogRecord&&) { return true; }).error().message,
              HasSubstr("no topic of type"))
      << "nobody sent a scan";
}

// With a limit of the file's size in the place of a disk that is full.
TEST_F(CairnRecord, AFullDiskEndsItWithAReadableFile) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  std::vector<std::string> command = {"/bin/sh", "-c", "trap '' XFSZ; ulimit -f 1600; exec \"$0\" \"$@\""};
  for (std::string& word : Command()) command.push_back(std::move(word));
  ChildProcess recorder(command);
  ListenedRobot robot("r1", 2);
  EXPECT_TRUE(DriveUntil(robot, [&] { return !recorder.RunningAfter(std::chrono::microseconds(0)); }));
  const auto outcome = recorder.Wait();
  EXPECT_EQ(outcome.exit_code, 1) << outcome.output;
  EXPECT_THAT(outcome.output, HasSubstr("out.mcap: cannot write: File too large (RESOURCE_EXHAUSTED)"));
  EXPECT_GT(Read(File()).scans.size(), 10U);
}

TEST_F(CairnRecord, SaysWhenThereIsNoServerAndLeavesNoFile) {
  const auto outcome =
      ChildProcess({CAIRN_PATH, "--domain", Domain(), "--timeout", "300ms", "record", File().string()}).Wait();
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.output, HasSubstr("UNAVAILABLE"));
  EXPECT_FALSE(std::filesystem::exists(File()));
}

}  // namespace
}  // namespace cairn::client
