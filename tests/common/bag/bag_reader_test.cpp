// Bags as people have them: topics to choose from, lidars mounted anywhere, odometry in messages or in transforms. And
// the same drive in a bag and in a log gives the same records.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "common/bag/recording.h"
#include "common/sensor/carmen_writer.h"
#include "tests/common/bag/bag_writer.h"
#include "tests/temp_directory.h"

namespace cairn {
namespace {

using recorded::BagMessage;
using recorded::CdrOf;
using recorded::Link;
using recorded::McapOf;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr Stamp kStart = 1'700'000'000 * kNanosPerSecond;

struct Content {
  std::vector<Scan> scans;
  std::vector<Odometry> odometries;
  LogSummary summary;
  std::string error;
};

Content Read(const std::filesystem::path& path, const LogReaderOptions& options = {}) {
  Content content;
  const auto summary = ReadRecording(path, options, [&](LogRecord&& record) {
    if (auto* const scan = std::get_if<Scan>(&record)) content.scans.push_back(std::move(*scan));
    if (const auto* const odometry = std::get_if<Odometry>(&record)) content.odometries.push_back(*odometry);
    return true;
  });
  if (summary) content.summary = *summary;
  if (!summary) content.error = summary.error().message;
  return content;
}

ros2::LaserScan ScanAt(Stamp stamp, const std::string& frame = "laser") {
  ros2::LaserScan scan;
  scan.header = {stamp, frame};
  scan.angle_min = -1.5;
  scan.angle_increment = 0.015625;  // A float has it exactly.
  scan.range_max = 80.0;
  for (int i = 0; i < 193; ++i) scan.ranges.push_back(i % 9 == 0 ? kInfinity : 1.0F + static_cast<float>(i) / 64.0F);
  return scan;
}

ros2::Odometry OdometryAt(Stamp stamp, const Pose2& pose) {
  return {{stamp, "odom"}, "base_link", Link("", "", pose).T_frame_child};
}

Pose2 PoseAt(int step) {
  return {0.1 * step, -0.02 * step, 0.03 * step};
}

ros2::Transforms Message(const ros2::Transform& transform) {
  ros2::Transforms message;
  message.transforms.push_back(transform);
  return message;
}

class Bag : public ::testing::Test {
 protected:
  void Add(const std::string& topic, const char* type, const std::string& bytes) {
    messages_.push_back({topic, type, static_cast<std::uint64_t>(kStart) + messages_.size() * 1000, bytes});
  }
  void AddMounting(const Pose2& T_base_laser = {0.25, 0.0, 0.0}) {
    Add("/tf_static", recorded::kTransformType, CdrOf(Message(Link("base_link", "laser", T_base_laser))));
  }
  void AddDrive(int steps = 4) {
    for (int step = 0; step < steps; ++step) {
      const Stamp stamp = kStart + step * 100'000'000;
      Add("/odom", recorded::kOdometryType, CdrOf(OdometryAt(stamp, PoseAt(step))));
      Add("/scan", recorded::kScanType, CdrOf(ScanAt(stamp)));
    }
  }
  Content ReadIt(const LogReaderOptions& options = {}) {
    return Read(directory_.Write("bag.mcap", McapOf(messages_, "zstd", 3)), options);
  }

  const TempDirectory directory_;
  std::vector<BagMessage> messages_;
};

// A log is text with all digits; the numbers of this scan lose none as floats either.
TEST_F(Bag, HoldsTheSameAsALog) {
  std::ofstream file(directory_ / "drive.log");
  CarmenWriter writer(file);
  for (int step = 0; step < 4; ++step) {
    const Stamp stamp = kStart + step * 100'000'000;
    const ros2::LaserScan message = ScanAt(stamp);
    Scan scan{.stamp = stamp,
              .angle_first_rad = message.angle_min,
              .angle_step_rad = message.angle_increment,
              .range_max_m = message.range_max,
              .T_robot_laser = {0.25, 0.0, 0.0},
              .ranges_m = message.ranges};
    writer.Write(Odometry{0, stamp, PoseAt(step)});
    writer.Write(scan, PoseAt(step));
  }
  file.close();
  AddMounting();
  AddDrive();
  const Content log = Read(directory_ / "drive.log"), bag = ReadIt();
  ASSERT_EQ(bag.error, "");
  ASSERT_EQ(bag.scans.size(), 4U);
  ASSERT_EQ(log.scans.size(), 4U);
  ASSERT_EQ(log.odometries.size(), bag.odometries.size());
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(bag.odometries[i].stamp, log.odometries[i].stamp);
    EXPECT_NEAR(bag.odometries[i].T_odom_robot.x, log.odometries[i].T_odom_robot.x, 1e-12);
    EXPECT_NEAR(bag.odometries[i].T_odom_robot.theta, log.odometries[i].T_odom_robot.theta, 1e-12);
    EXPECT_EQ(bag.scans[i].stamp, log.scans[i].stamp);
    EXPECT_EQ(bag.scans[i].angle_first_rad, log.scans[i].angle_first_rad);
    EXPECT_EQ(bag.scans[i].angle_step_rad, log.scans[i].angle_step_rad);
    EXPECT_EQ(bag.scans[i].range_max_m, log.scans[i].range_max_m);
    EXPECT_NEAR(bag.scans[i].T_robot_laser.x, log.scans[i].T_robot_laser.x, 1e-12);
    ASSERT_EQ(bag.scans[i].ranges_m.size(), log.scans[i].ranges_m.size());
    for (std::size_t k = 0; k < 193; ++k) {
      const BeamClass beam = ClassifyRange(bag.scans[i].ranges_m[k], 0.0, 80.0);
      ASSERT_EQ(beam, ClassifyRange(log.scans[i].ranges_m[k], 0.0, 80.0)) << k;
      if (beam == BeamClass::kHit) {
        ASSERT_EQ(bag.scans[i].ranges_m[k], log.scans[i].ranges_m[k]);
      }
    }
  }
}

TEST_F(Bag, IsTheSameInEveryStorage) {
  AddMounting();
  AddDrive();
  const auto folder = [&](const std::string& name, const std::vector<std::string>& files) {
    std::filesystem::create_directory(directory_ / name);
    static_cast<void>(directory_.Write(name + "/metadata.yaml", recorded::MetadataOf(files)));
    return directory_ / name;
  };
  const std::vector<BagMessage> first(messages_.begin(), messages_.begin() + 5);
  const std::vector<BagMessage> second(messages_.begin() + 5, messages_.end());
  std::vector<BagMessage> packed = messages_;
  for (BagMessage& message : packed) message.bytes = recorded::PackZstd(message.bytes);

  const auto sqlite = folder("sqlite", {"bag_0.db3", "bag_1.db3"});
  recorded::WriteSqlite(sqlite / "bag_0.db3", first);
  recorded::WriteSqlite(sqlite / "bag_1.db3", second);
  const auto mcap = folder("mcap", {"mcap/bag_0.mcap", "mcap/bag_1.mcap"});  // As old recorders name them.
  static_cast<void>(directory_.Write("mcap/bag_0.mcap", McapOf(first, "lz4", 2)));
  static_cast<void>(directory_.Write("mcap/bag_1.mcap", McapOf(second, "zstd", 2)));
  const auto sqlite_packed = folder("sqlite_packed", {"bag_0.db3"});
  recorded::WriteSqlite(sqlite_packed / "bag_0.db3", packed);
  const auto unpacked = folder("unpacked", {"bag_0.db3.zstd"});
  recorded::WriteSqlite(unpacked / "bag_0.db3", messages_);
  const auto whole_mcap = folder("whole_mcap", {"bag_0.mcap.zstd", "bag_1.mcap.zstd"});
  static_cast<void>(directory_.Write("whole_mcap/bag_0.mcap.zstd", recorded::PackZstd(McapOf(first, "", 2))));
  static_cast<void>(directory_.Write("whole_mcap/bag_1.mcap.zstd", recorded::PackZstd(McapOf(second, "lz4", 2))));
  const auto whole_sqlite = folder("whole_sqlite", {"bag_0.db3.zstd", "bag_1.db3.zstd"});
  for (const char* name : {"bag_0.db3", "bag_1.db3"}) {
    const std::string file = directory_.Read(std::string("sqlite/") + name);
    // In two frames, as a program that packs while it reads may write them.
    const std::string packed_file = recorded::PackZstd(file.substr(0, 5000)) + recorded::PackZstd(file.substr(5000));
    static_cast<void>(directory_.Write(std::string("whole_sqlite/") + name + ".zstd", packed_file));
  }

  for (const auto& path : {sqlite, mcap, sqlite_packed, unpacked, whole_mcap, whole_sqlite, sqlite_packed / "bag_0.db3",
                           directory_.Write("one.mcap.zstd", recorded::PackZstd(McapOf(messages_, "", 0))),
                           directory_.Write("one.db3.zstd", recorded::PackZstd(directory_.Read("unpacked/bag_0.db3"))),
                           directory_.Write("packed.mcap", McapOf(packed, "", 0))}) {
    const Content content = Read(path);
    EXPECT_EQ(content.error, "") << path;
    EXPECT_EQ(content.summary.complaint_count, 0) << path;
    ASSERT_EQ(content.scans.size(), 4U) << path;
    ASSERT_EQ(content.odometries.size(), 4U) << path;
    EXPECT_EQ(content.scans[3].stamp, kStart + 300'000'000);
    EXPECT_NEAR(content.odometries[3].T_odom_robot.theta, 0.09, 1e-12);
    EXPECT_NEAR(content.scans[3].T_robot_laser.x, 0.25, 1e-12);
  }
}

TEST_F(Bag, WithAFolderThatIsNoneSaysWhy) {
  std::filesystem::create_directory(directory_ / "bag");
  EXPECT_THAT(Read(directory_ / "bag").error, HasSubstr("metadata.yaml"));
  for (const char* text : {"", "a: [", "rosbag2_bagfile_information: {relative_file_paths: 3}", "[[[[[[[["}) {
    static_cast<void>(directory_.Write("bag/metadata.yaml", text));
    EXPECT_THAT(Read(directory_ / "bag").error, HasSubstr("it names no files")) << text;
  }
  static_cast<void>(directory_.Write("bag/metadata.yaml", recorded::MetadataOf({"../../etc/passwd"})));
  EXPECT_THAT(Read(directory_ / "bag").error, HasSubstr("bag/passwd: no such file"));
  static_cast<void>(directory_.Write("bag/metadata.yaml", recorded::MetadataOf({"bag_0.mcap.zstd"})));
  const std::string whole = recorded::PackZstd(McapOf(messages_, "", 0));
  static_cast<void>(directory_.Write("bag/bag_0.mcap.zstd", whole.substr(0, whole.size() - 1)));
  EXPECT_THAT(Read(directory_ / "bag").error, HasSubstr("bag_0.mcap.zstd: zstd: the end is missing"));
  static_cast<void>(directory_.Write("bag/bag_0.mcap.zstd", recorded::PackZstd("no bag")));
  EXPECT_THAT(Read(directory_ / "bag").error, HasSubstr("bag_0.mcap.zstd, unpacked: neither MCAP"));
}

TEST_F(Bag, WithSeveralTopicsNeedsAChoice) {
  AddMounting();
  AddDrive();
  Add("/rear/scan", recorded::kScanType, CdrOf(ScanAt(kStart)));
  Add("/odometry/filtered", recorded::kOdometryType, CdrOf(OdometryAt(kStart, {5.0, 0.0, 0.0})));
  Add("/camera", "sensor_msgs/msg/Image", "picture");
  EXPECT_THAT(ReadIt().error, AllOf(HasSubstr("--scan-topic"), HasSubstr("/scan (sensor_msgs/msg/LaserScan)"),
                                    HasSubstr("/rear/scan"), ::testing::Not(HasSubstr("/camera"))));
  EXPECT_THAT(ReadIt({.scan_topic = "/rear/scan"}).error, HasSubstr("--odom-topic"));
  const Content rear = ReadIt({.scan_topic = "rear/scan", .odometry_topic = "/odometry/filtered"});
  EXPECT_EQ(rear.error, "");
  EXPECT_EQ(rear.scans.size(), 1U);
  ASSERT_EQ(rear.odometries.size(), 1U);
  EXPECT_NEAR(rear.odometries[0].T_odom_robot.x, 5.0, 1e-12);
  EXPECT_EQ(ReadIt({.scan_topic = "/scan", .odometry_topic = "/odom"}).scans.size(), 4U);
  EXPECT_THAT(ReadIt({.scan_topic = "/odom"}).error,
              AllOf(HasSubstr("no topic '/odom' of type sensor_msgs/msg/LaserScan"), HasSubstr("/camera")));
}

// Two lidars that are mounted on one robot, the second one a little later, and some of its scans late.
TEST_F(Bag, MayHoldSeveralLidarsOfOneRobot) {
  AddMounting();
  Add("/tf_static", recorded::kTransformType, CdrOf(Message(Link("base_link", "rear_laser", {-0.25, 0.0, kPi}))));
  AddDrive(3);  // At 0, 0.1 and 0.2 s.
  for (const Stamp after : {30'000'000, 130'000'000, 200'000'000})
    Add("/rear/scan", recorded::kScanType, CdrOf(ScanAt(kStart + after, "rear_laser")));
  EXPECT_THAT(ReadIt().error, HasSubstr("more than one topic of type sensor_msgs/msg/LaserScan"));
  const LogReaderOptions all = {.all_lidars = true};
  const Content both = ReadIt(all);
  ASSERT_EQ(both.error, "");
  EXPECT_THAT(both.summary.lidars, ::testing::ElementsAre("/scan", "/rear/scan"));
  EXPECT_THAT(both.summary.notes, Contains(HasSubstr("/rear/scan: frame 'rear_laser' is mounted on 'base_link'")));
  ASSERT_EQ(both.scans.size(), 6U);
  EXPECT_EQ(both.summary.scans, 6);
  std::vector<double> forward;
  std::vector<Stamp> stamps;
  for (const Scan& scan : both.scans) {
    forward.push_back(scan.T_robot_laser.x);
    stamps.push_back(scan.stamp - kStart);
  }
  EXPECT_THAT(forward, ::testing::ElementsAre(0.25, -0.25, 0.25, -0.25, 0.25, -0.25));
  // The last two were taken at the same moment.
  EXPECT_THAT(stamps, ::testing::ElementsAre(0, 30'000'000, 100'000'000, 130'000'000, 200'000'000, 200'001'000));
  std::vector<std::size_t> lidars;
  const auto path = directory_.Write("bag.mcap", McapOf(messages_, "zstd", 3));
  const auto summary = ReadLidars(path, all, [&](LogRecord&& record, std::size_t lidar) {
    if (std::holds_alternative<Scan>(record)) lidars.push_back(lidar);
    return true;
  });
  ASSERT_TRUE(summary.has_value());
  EXPECT_THAT(lidars, ::testing::ElementsAre(0, 1, 0, 1, 0, 1));
  EXPECT_EQ(ReadIt({.scan_topic = "/rear/scan", .all_lidars = true}).scans.size(), 3U);
  EXPECT_EQ(ReadIt({.scan_topic = "/rear/scan,scan", .all_lidars = true}).scans.size(), 6U);
  EXPECT_THAT(ReadIt({.scan_topic = "/scan,/scan", .all_lidars = true}).error, HasSubstr("names a topic twice"));
  EXPECT_THAT(ReadIt({.scan_topic = "/scan,/none", .all_lidars = true}).error, HasSubstr("no topic '/none'"));
  EXPECT_THAT(ReadIt({.T_robot_laser = Pose2{}, .all_lidars = true}).error, HasSubstr("--laser-at says where one"));
}

TEST_F(Bag, WithSeveralTopicsOfScansThatAreNotLidarsOfOneRobotNamesThem) {
  AddMounting();
  AddDrive();
  const LogReaderOptions all = {.all_lidars = true};
  Add("/scan_filtered", recorded::kScanType, CdrOf(ScanAt(kStart)));
  EXPECT_THAT(ReadIt(all).error,
              AllOf(HasSubstr("/scan and /scan_filtered are of one lidar"), HasSubstr("--scan-topic chooses")));
  EXPECT_EQ(ReadIt({.scan_topic = "/scan", .all_lidars = true}).scans.size(), 4U);
  messages_.pop_back();
  Add("/other/scan", recorded::kScanType, CdrOf(ScanAt(kStart, "other/laser")));
  EXPECT_THAT(ReadIt(all).error,
              AllOf(HasSubstr("/other/scan: no transform connects"), HasSubstr("/scan, /other/scan")));
}

TEST_F(Bag, WithoutScansOrOdometrySaysWhatItHas) {
  Add("/camera", "sensor_msgs/msg/Image", "picture");
  EXPECT_THAT(ReadIt().error, AllOf(HasSubstr("no topic of type sensor_msgs/msg/LaserScan"), HasSubstr("/camera")));
  Add("/scan", recorded::kScanType, CdrOf(ScanAt(kStart)));
  EXPECT_THAT(ReadIt().error, HasSubstr("no topic of type nav_msgs/msg/Odometry"));
}

TEST_F(Bag, NeedsToKnowWhereTheLidarIs) {
  AddDrive();
  EXPECT_THAT(ReadIt().error, AllOf(HasSubstr("'laser'"), HasSubstr("'base_link'"), HasSubstr("--laser-at")));
  const Content told = ReadIt({.T_robot_laser = Pose2{0.1, 0.2, 0.3}});
  ASSERT_EQ(told.scans.size(), 4U);
  EXPECT_EQ(told.scans[0].T_robot_laser.y, 0.2);
  // The transform may come after the scans, and on the topic of those that move; here the lidar hangs upside down.
  ros2::Transform link = Link("base_link", "laser", {0.25, 0.0, 0.0});
  link.T_frame_child.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(kPi, Eigen::Vector3d::UnitX()));
  Add("/tf", recorded::kTransformType, CdrOf(Message(link)));
  const Content found = ReadIt();
  ASSERT_EQ(found.scans.size(), 4U);
  EXPECT_EQ(found.scans[0].angle_first_rad, 1.5);
  EXPECT_EQ(found.scans[0].angle_step_rad, -0.015625);
  EXPECT_THAT(found.summary.notes, Contains(HasSubstr("upside down")));
  // What a person says counts, but does not turn the lidar over.
  const Content both = ReadIt({.T_robot_laser = Pose2{0.1, 0.2, 0.3}});
  EXPECT_EQ(both.scans[0].T_robot_laser.y, 0.2);
  EXPECT_EQ(both.scans[0].angle_step_rad, -0.015625);
}

TEST_F(Bag, TakesOdometryFromTransforms) {
  AddMounting();
  for (int step = 0; step < 4; ++step) {
    const Stamp stamp = kStart + step * 100'000'000;
    // Twice, as some programs repeat it; and with other transforms in the same message.
    for (int twice = 0; twice < 2; ++twice) {
      ros2::Transforms message = Message(Link("map", "odom", {9.0, 9.0, 9.0}, stamp));
      message.transforms.push_back(Link("odom", "base_link", PoseAt(step), stamp));
      Add("/tf", recorded::kTransformType, CdrOf(message));
    }
    Add("/scan", recorded::kScanType, CdrOf(ScanAt(stamp)));
  }
  const Content content = ReadIt();
  ASSERT_EQ(content.error, "");
  ASSERT_EQ(content.odometries.size(), 4U);
  EXPECT_NEAR(content.odometries[2].T_odom_robot.x, 0.2, 1e-12);
  ASSERT_EQ(content.scans.size(), 4U);
  EXPECT_NEAR(content.scans[0].T_robot_laser.x, 0.25, 1e-12);
  Add("/odom", recorded::kOdometryType, CdrOf(OdometryAt(kStart, {7.0, 0.0, 0.0})));
  EXPECT_EQ(ReadIt().odometries.size(), 1U) << "a topic of odometry counts before transforms";
  EXPECT_EQ(ReadIt({.odometry_topic = "/tf"}).odometries.size(), 4U) << "unless somebody says so";
  Add("/tf", recorded::kTransformType, CdrOf(Message(Link("r2/odom", "r2/base_link", {}, kStart))));
  EXPECT_THAT(ReadIt({.odometry_topic = "/tf"}).error, HasSubstr("more than one transform from a frame 'odom'"));
}

TEST_F(Bag, SaysWhenBeamsWereMeasured) {
  AddMounting();
  AddDrive(1);
  ros2::LaserScan turning = ScanAt(kStart + 100'000'000);
  turning.time_increment = 0.0005;
  turning.scan_time = 0.1;
  Add("/scan", recorded::kScanType, CdrOf(turning));
  EXPECT_EQ(ReadIt().scans[0].beam_period_s, 0.0);
  EXPECT_NEAR(ReadIt().scans[1].beam_period_s, 0.0005, 1e-9);
  LogReaderOptions options;
  options.timing.scan_period_s = 0.0;
  EXPECT_EQ(ReadIt(options).scans[1].beam_period_s, 0.0) << "all beams at once";
  options.timing.scan_period_s = 0.2;
  options.timing.stamp_at = StampAt::kLast;
  const double period_s = 0.2 * 0.015625 / (2.0 * kPi);
  EXPECT_NEAR(ReadIt(options).scans[0].beam_period_s, period_s, 1e-12);
  EXPECT_NEAR(SecondsFromStamp(kStart - ReadIt(options).scans[0].stamp), 192 * period_s, 1e-6);
}

TEST_F(Bag, ANoReturnLimitCountsBeforeTheMessage) {
  AddMounting();
  AddDrive(1);
  const Content content = ReadIt({.no_return_m = 3.0});
  EXPECT_EQ(content.scans[0].range_max_m, 3.0);
  EXPECT_EQ(ClassifyRange(content.scans[0].ranges_m[192], 0.0, 3.0), BeamClass::kNoReturn);
  EXPECT_EQ(ClassifyRange(content.scans[0].ranges_m[1], 0.0, 3.0), BeamClass::kHit);
}

TEST_F(Bag, AMessageThatCannotBeUsedIsAComplaint) {
  AddMounting();
  AddDrive(1);
  Add("/scan", recorded::kScanType, CdrOf(ScanAt(kStart)).substr(0, 200));
  Add("/scan", recorded::kScanType, CdrOf(ScanAt(kStart, "elsewhere")));
  ros2::Odometry no_turn = OdometryAt(kStart, {});
  no_turn.pose.rotation.coeffs().setZero();
  Add("/odom", recorded::kOdometryType, CdrOf(no_turn));
  Add("/scan", recorded::kScanType, recorded::PackZstd(CdrOf(ScanAt(kStart))).substr(0, 50));
  Add("/scan", recorded::kScanType, CdrOf(ScanAt(kStart)));
  const Content content = ReadIt();
  EXPECT_EQ(content.scans.size(), 2U);
  EXPECT_EQ(content.odometries.size(), 1U);
  EXPECT_EQ(content.summary.complaint_count, 4);
  ASSERT_EQ(content.summary.complaints.size(), 4U);
  EXPECT_EQ(content.summary.complaints[0].line, 3);
  EXPECT_THAT(content.summary.complaints[0].reason, HasSubstr("/scan: the message is cut off"));
  EXPECT_THAT(content.summary.complaints[1].reason, HasSubstr("'elsewhere'"));
  EXPECT_THAT(content.summary.complaints[2].reason, HasSubstr("quaternion"));
}

TEST_F(Bag, StopsWhereNoMoreIsWanted) {
  AddMounting();
  AddDrive();
  int seen = 0;
  const auto path = directory_.Write("bag.mcap", McapOf(messages_, "", 0));
  ASSERT_TRUE(ReadRecording(path, {}, [&](LogRecord&&) { return ++seen < 3; }));
  EXPECT_EQ(seen, 3);
}

}  // namespace
}  // namespace cairn
