// What a recorder makes of the wire's values, without a wire: names, choices, gaps, and the file as it is read back.
#include "client/cli/recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <thread>
#include <vector>

#include "common/bag/foxglove_decoding.h"
#include "common/bag/mcap_file.h"
#include "common/bag/recording.h"
#include "common/ros2/frame_tree.h"
#include "tests/must.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using test::Must;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

constexpr Stamp kBegin = 1'000'000'000'000;

StreamId StreamOf(const std::string& robot, const std::string& sensor, SessionToken session = 5) {
  return {.robot_id = HashName(robot), .sensor_id = HashName(sensor), .session = session};
}

ScanSample ScanOf(const std::string& robot, std::uint64_t sequence, const std::string& sensor = "laser") {
  ScanSample sample;
  sample.stream = StreamOf(robot, sensor);
  sample.scan = {.sequence = sequence,
                 .stamp = kBegin + static_cast<Stamp>(sequence) * 100'000'000,
                 .angle_first_rad = -1.1,
                 .angle_step_rad = 0.1 / 3.0,
                 .range_min_m = 0.02,
                 .range_max_m = 25.3,
                 .beam_period_s = 1e-4,
                 .tilt_rad = 0.0,
                 .T_robot_laser = {0.1, 0.2, 0.3},
                 .ranges_m = std::vector<float>(60, 1.0F + static_cast<float>(sequence) / 7.0F)};
  return sample;
}

OdometrySample OdometryOf(const std::string& robot, std::uint64_t sequence) {
  const auto number = static_cast<double>(sequence);
  return {StreamOf(robot, "odometry"),
          {sequence, kBegin + static_cast<Stamp>(sequence) * 50'000'000, {number / 3.0, 0.0, number / 700.0}}};
}

SessionState StateOf(const std::string& robot, const std::string& site) {
  SessionState state;
  state.robot_id = HashName(robot);
  state.robot = robot;
  state.site = site;
  state.session = 5;
  state.generation = 1;
  return state;
}

Ledger LedgerOf(const std::string& robot, const std::string& site, const std::string& sensor = "laser") {
  Ledger ledger;
  ledger.robot_id = HashName(robot);
  ledger.sensor_id = HashName(sensor);
  ledger.robot = robot;
  ledger.sensor = sensor;
  ledger.site = site;
  return ledger;
}

PoseReport PoseOf(const std::string& robot, const std::string& site, PoseReason reason = PoseReason::kTracking) {
  PoseReport pose;
  pose.robot_id = HashName(robot);
  pose.robot = robot;
  pose.site = site;
  pose.stamp = kBegin;
  pose.T_map_odom = {3.0, 4.0, 0.0};
  pose.T_map_robot = {5.0, 6.0, 0.5};
  pose.reason = reason;
  pose.localized = reason == PoseReason::kTracking;
  pose.generation = 1;
  return pose;
}

class Recording : public ::testing::Test {
 protected:
  void Begin(const RecorderOptions& options = {}) { recorder_.emplace(*file_, options); }
  template <typename Value>
  void Take(Value value) {
    Must(recorder_->Take({++time_ * 1'000'000, std::move(value)}));
  }
  // Names of two robots, each in its own site.
  void Introduce() {
    Take(StateOf("r1", "hall"));
    Take(StateOf("r2", "yard"));
    Take(LedgerOf("r1", "hall"));
  }
  // Ends the file; the number of messages of each topic, and their bytes in messages_.
  std::map<std::string, int> Topics() {
    Must(file_->Finish());
    const auto file = Must(bag::OpenMcap(path_));
    std::vector<std::size_t> all(file->topics().size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    std::map<std::string, int> counts;
    Must(file->Read(all, [&](std::size_t topic, std::string_view message) {
      ++counts[file->topics()[topic].name];
      messages_[file->topics()[topic].name].emplace_back(message);
      return true;
    }));
    return counts;
  }

  const TempDirectory directory_;
  const std::filesystem::path path_ = directory_ / "out.mcap";
  const std::unique_ptr<RecordingFile> file_ = Must(RecordingFile::Create(path_, false));
  std::optional<Recorder> recorder_;
  std::int64_t time_ = 0;
  std::map<std::string, std::vector<std::string>> messages_;
};

TEST_F(Recording, IsReadBackBitForBit) {
  Begin();
  Introduce();
  for (std::uint64_t i = 1; i <= 4; ++i) {
    Take(OdometryOf("r1", 2 * i));
    Take(OdometryOf("r1", 2 * i + 1));
    Take(ScanOf("r1", i));
    Take(OdometryOf("r2", i));
    Take(ScanOf("r2", i));
  }
  Must(file_->Finish());
  std::vector<Scan> scans;
  std::vector<Odometry> odometries;
  const LogReaderOptions options{.scan_topic = "/robots/r1/scan/laser"};
  const LogSummary summary = Must(ReadRecording(path_, options, [&](LogRecord&& record) {
    if (auto* const scan = std::get_if<Scan>(&record)) scans.push_back(std::move(*scan));
    if (const auto* const odometry = std::get_if<Odometry>(&record)) odometries.push_back(*odometry);
    return true;
  }));
  EXPECT_EQ(summary.complaint_count, 0);
  ASSERT_EQ(scans.size(), 4U);
  ASSERT_EQ(odometries.size(), 8U) << "those of r1, although nobody named the topic";
  for (std::size_t i = 0; i < 4; ++i) {
    const Scan sent = ScanOf("r1", i + 1).scan;
    EXPECT_EQ(scans[i].stamp, sent.stamp);
    EXPECT_EQ(scans[i].angle_first_rad, sent.angle_first_rad);
    EXPECT_EQ(scans[i].angle_step_rad, sent.angle_step_rad);
    EXPECT_EQ(scans[i].range_max_m, sent.range_max_m);
    EXPECT_EQ(scans[i].beam_period_s, sent.beam_period_s);
    EXPECT_EQ(scans[i].T_robot_laser, sent.T_robot_laser);
    EXPECT_EQ(scans[i].ranges_m, sent.ranges_m);
  }
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(odometries[i].stamp, OdometryOf("r1", i + 2).odometry.stamp);
    EXPECT_EQ(odometries[i].T_odom_robot, OdometryOf("r1", i + 2).odometry.T_odom_robot);
  }
}

TEST_F(Recording, SamplesWaitForTheirNames) {
  Begin();
  Take(ScanOf("r1", 1));
  Take(OdometryOf("r1", 1));
  Take(PoseOf("r1", "hall"));  // Names the robot, not the sensor.
  Take(ScanOf("r1", 2));
  EXPECT_EQ(file_->counts().scans, 0U);
  EXPECT_EQ(file_->counts().odometry, 1U);
  Take(LedgerOf("r1", "hall"));
  Take(ScanOf("r1", 3));
  Take(ScanOf("stranger", 1));
  EXPECT_EQ(file_->counts().scans, 3U);
  EXPECT_EQ(recorder_->account().nameless, 1U);
  EXPECT_EQ(recorder_->account().missing, 0U);
  EXPECT_THAT(recorder_->robots(), ElementsAre("r1"));
}

TEST_F(Recording, WaitsWithBoundedMemory) {
  Begin();
  ScanSample large = ScanOf("r1", 1);
  large.scan.ranges_m.assign(8192, 1.0F);
  const std::size_t room = Recorder::kMaxWaitingBytes / RecordEvent{0, large}.bytes();
  for (std::uint64_t i = 1; i <= room + 10; ++i) {
    large.scan.sequence = i;
    Take(large);
  }
  EXPECT_EQ(recorder_->account().nameless, room + 10);
  Take(LedgerOf("r1", "hall"));
  EXPECT_EQ(file_->counts().scans, room) << "the oldest have given way";
  EXPECT_EQ(recorder_->account().nameless, 10U);
}

TEST_F(Recording, TopicsTellRobotsSensorsAndSitesApart) {
  Begin();
  Introduce();
  Take(LedgerOf("r1", "hall", "rear"));
  Take(ScanOf("r1", 1));
  Take(ScanOf("r1", 1, "rear"));
  Take(ScanOf("r2", 1));
  Take(OdometryOf("r2", 1));
  Take(PoseOf("r2", "yard"));
  const auto topics = Topics();
  std::vector<std::string> names;
  for (const auto& [name, count] : topics) names.push_back(name);
  EXPECT_THAT(names, UnorderedElementsAre("/log", "/robots/r1/scan/laser", "/robots/r1/scan/laser/details",
                                          "/robots/r1/scan/rear", "/robots/r1/scan/rear/details", "/robots/r2/odometry",
                                          "/robots/r2/odometry/details", "/robots/r2/pose", "/robots/r2/scan/laser",
                                          "/robots/r2/scan/laser/details", "/robots/r2/tf"));
  EXPECT_EQ(topics.at("/robots/r2/tf"), 2);
  EXPECT_EQ(Must(bag::DecodeFoxgloveScan(messages_["/robots/r2/scan/laser"][0])).scan.header.frame, "r2/base");
}

// The chain of frames in which Foxglove shows a scan: the map, the odometry, the robot.
TEST_F(Recording, TransformsLeadFromTheMapToTheRobot) {
  Begin();
  Introduce();
  Take(OdometryOf("r1", 30));
  PoseReport pose = PoseOf("r1", "hall");
  pose.T_map_robot = pose.T_map_odom * OdometryOf("r1", 30).odometry.T_odom_robot;
  Take(pose);
  static_cast<void>(Topics());
  ros2::FrameTree tree;
  for (const std::string& message : messages_["/robots/r1/tf"])
    for (const auto& transform : Must(bag::DecodeFrameTransform(message)).transforms) Must(tree.Set(transform));
  const auto motion =
      ros2::FindMotion(std::array<const ros2::FrameTree*, 1>{&tree}, "hall/map", "r1/base", std::vector<std::string>{});
  ASSERT_TRUE(motion);
  const Pose2 shown = ros2::PlanarPart(*motion);
  EXPECT_NEAR(shown.x, pose.T_map_robot.x, 1e-9);
  EXPECT_NEAR(shown.theta, pose.T_map_robot.theta, 1e-9);
  const auto reported = Must(bag::DecodePoseInFrame(messages_["/robots/r1/pose"][0]));
  EXPECT_EQ(reported.header.frame, "hall/map");
  EXPECT_NEAR(reported.pose.translation.x(), pose.T_map_robot.x, 1e-9);
}

TEST_F(Recording, HoldsOnlyWhatWasAskedFor) {
  const auto record = [&](const RecorderOptions& options) {
    recorder_.emplace(*file_, options);
    Introduce();
    for (const char* robot : {"r1", "r2"}) Take(ScanOf(robot, 1));
    for (const char* site : {"hall", "yard", "attic"}) {
      MapInfo info;
      info.site = site;
      info.site_id = HashName(site);
      Take(info);
    }
    return std::pair(recorder_->robots(), recorder_->sites());
  };
  using Names = std::vector<std::string>;
  using Sites = std::set<std::string>;
  EXPECT_EQ(record({}), std::pair(Names({"r1", "r2"}), Sites({"attic", "hall", "yard"})));
  EXPECT_EQ(record({.robots = {"r2"}, .sites = {}}), std::pair(Names({"r2"}), Sites({"yard"})));
  EXPECT_EQ(record({.robots = {}, .sites = {"hall"}}), std::pair(Names({"r1"}), Sites({"hall"})));
  EXPECT_EQ(record({.robots = {"r2"}, .sites = {"hall"}}), std::pair(Names({"r2"}), Sites({"hall"})));
}

TEST_F(Recording, CountsWhatIsMissingAndLeavesOutWhatIsSentAgain) {
  Begin();
  Introduce();
  for (const std::uint64_t sequence : {3, 4, 8, 8, 5, 9}) Take(ScanOf("r1", sequence));
  EXPECT_EQ(recorder_->account().missing, 3U) << "5 to 7; nobody knows of those before the first";
  EXPECT_EQ(recorder_->account().repeated, 2U);
  EXPECT_EQ(file_->counts().scans, 4U);
  ScanSample again = ScanOf("r1", 1);
  again.stream.session = 6;
  Take(again);
  EXPECT_EQ(file_->counts().scans, 5U) << "a new session counts anew";
}

TEST_F(Recording, ChangesOfStateAreLogged) {
  Begin();
  Introduce();
  const std::uint64_t before = file_->counts().log_lines;
  EXPECT_EQ(before, 2U) << "two sessions";
  Take(StateOf("r1", "hall"));
  Take(PoseOf("r1", "hall"));
  Take(PoseOf("r1", "hall"));
  EXPECT_EQ(file_->counts().log_lines, before + 1) << "tracking, once";
  Take(PoseOf("r1", "hall", PoseReason::kLost));
  SessionState stale = StateOf("r1", "hall");
  stale.stale = true;
  stale.status.message = "no scans\nfor 2 s \xff";
  Take(stale);
  Job job;
  job.id = 3;
  job.site = "hall";
  Take(job);
  Take(job);
  SessionState restarted = stale;
  restarted.generation = 2;
  Take(restarted);
  EXPECT_EQ(file_->counts().log_lines, before + 5);
  // What had ended before the recorder came is no news.
  SessionState ended = StateOf("r3", "hall");
  ended.phase = SessionPhase::kEnded;
  ended.generation = 2;
  Take(ended);
  job.id = 4;
  job.state = JobState::kSucceeded;
  Take(job);
  EXPECT_EQ(file_->counts().log_lines, before + 5);
  job.id = 3;
  Take(job);
  EXPECT_EQ(file_->counts().log_lines, before + 6);
  const std::vector<std::string> lines = (static_cast<void>(Topics()), messages_["/log"]);
  EXPECT_THAT(lines, ::testing::Contains(::testing::HasSubstr("lost, not localized")));
  EXPECT_THAT(lines, ::testing::Contains(::testing::HasSubstr("a stream stands still: no scans?for 2 s ?")));
}

// A recorder that is killed loses what is younger.
TEST_F(Recording, ReachesTheFileInTwoSeconds) {
  Begin();
  Introduce();
  const std::uint64_t before = file_->bytes();
  Must(file_->EndOldChunk(1'000'000 + RecordingFile::kChunkAge - 1));
  EXPECT_EQ(file_->bytes(), before);
  Must(file_->EndOldChunk(1'000'000 + RecordingFile::kChunkAge));
  EXPECT_GT(file_->bytes(), before);
  EXPECT_EQ(Must(bag::OpenMcap(path_))->topics().size(), 1U) << "the log";
}

// What a peer can send must not end up in a name.
TEST_F(Recording, NamesThatAreNoneAreIgnored) {
  Begin();
  SessionState forged = StateOf("r1", "hall");
  forged.robot = "r2";  // Not that of the id.
  Take(forged);
  Take(LedgerOf("r9", "hall"));  // Names the sensor.
  Take(ScanOf("r1", 1));
  for (const char* name : {"../x", "a/b", "", "\xff"}) {
    Take(StateOf(name, "hall"));
    Take(ScanOf(name, 1));
  }
  EXPECT_EQ(file_->counts().scans, 0U);
  EXPECT_EQ(recorder_->account().nameless, 5U);
  PoseReport pose = PoseOf("r1", "no/site");
  Take(pose);
  pose = PoseOf("r1", "hall");
  pose.T_map_robot.x = std::nan("");
  Take(pose);
  EXPECT_THAT(recorder_->robots(), ElementsAre("r1")) << "the robot's name was good";
  EXPECT_EQ(file_->counts().poses, 0U);
}

TEST(RecordQueue, LeavesOutAndCountsWhatHasNoRoom) {
  const RecordEvent scan{0, ScanOf("r1", 1)};
  const RecordEvent small{0, OdometryOf("r1", 1)};
  RecordQueue queue(8 * scan.bytes());
  for (int i = 0; i < 10; ++i) queue.Push(RecordEvent(scan));
  EXPECT_EQ(queue.left_out().scans, 4U) << "six fit into three quarters";
  for (int i = 0; i < 10; ++i) queue.Push(RecordEvent(small));
  EXPECT_EQ(queue.left_out().others, 10U - 2 * scan.bytes() / small.bytes());
  const std::size_t taken = queue.Take(std::chrono::milliseconds(0)).size();
  EXPECT_EQ(taken, 6U + 2 * scan.bytes() / small.bytes());
  queue.Push(RecordEvent(scan));
  EXPECT_EQ(queue.left_out().scans, 5U) << "what was taken is being written";
  EXPECT_THAT(queue.Take(std::chrono::milliseconds(0)), IsEmpty());
  queue.Push(RecordEvent(scan));
  EXPECT_EQ(queue.Take(std::chrono::milliseconds(0)).size(), 1U);
}

TEST(RecordQueue, WakesWhoWaits) {
  RecordQueue queue(1 << 20);
  std::thread sender([&] { queue.Push({0, OdometryOf("r1", 1)}); });
  EXPECT_EQ(queue.Take(std::chrono::seconds(20)).size(), 1U);
  sender.join();
}

}  // namespace
}  // namespace cairn::client
