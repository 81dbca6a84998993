#include "tests/studies/fleet/ros2_latency.h"

#include <cmath>
#include <map>
#include <stdexcept>
#include <thread>

#include "client/lib/robot_client.h"
#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "common/mutex.h"
#include "common/wire/ros2/bus.h"
#include "tests/must.h"
#include "tests/studies/fleet/live_server.h"
#include "tests/studies/stopwatch.h"
#include "tests/test_domain.h"

namespace cairn::studies {
namespace {

using Clock = std::chrono::steady_clock;
using test::Must;

constexpr int kRobots = 3;
constexpr double kMostRatio = 1.2;  // Of the medians.

// When each scan was published, until its pose comes. Thread-safe.
class Waiting {
 public:
  void Sent(int robot, Stamp stamp) {
    const MutexLock lock(mutex_);
    sent_[{robot, stamp}] = Clock::now();
  }
  void Came(int robot, Stamp stamp) {
    const auto now = Clock::now();
    const MutexLock lock(mutex_);
    const auto found = sent_.find({robot, stamp});
    if (found == sent_.end()) return;
    latency_ms_.push_back(std::chrono::duration<double, std::milli>(now - found->second).count());
    sent_.erase(found);
  }
  [[nodiscard]] std::vector<double> latency_ms() const {
    const MutexLock lock(mutex_);
    return latency_ms_;
  }

 private:
  mutable Mutex mutex_;
  std::map<std::pair<int, Stamp>, Clock::time_point> sent_ CAIRN_GUARDED_BY(mutex_);
  std::vector<double> latency_ms_ CAIRN_GUARDED_BY(mutex_);
};

// A fleet as one of the doors sees it. Each robot has a site of its own: in a site with a map it would not be localized
// before a job has joined it, and until then ROS 2 gets no pose of it.
class Door {
 public:
  virtual ~Door() = default;
  virtual void Send(int robot, const Odometry& odometry) = 0;
  virtual void Send(int robot, const Scan& scan) = 0;
};

class NativeDoor final : public Door {
 public:
  NativeDoor(const std::string& prefix, Waiting& waiting) : bus_(Must(wire::Bus::Create(Wire(), "cairn-study"))) {
    for (int robot = 0; robot < kRobots; ++robot) {
      SessionRequest request;
      request.robot = prefix + std::to_string(robot);
      request.site = request.robot;
      request.sensors = {"scan"};
      client::RobotClient::Callbacks callbacks;
      callbacks.pose = [&waiting, robot](const PoseReport& pose) { waiting.Came(robot, pose.stamp); };
      robots_.push_back(Must(client::RobotClient::Open(*bus_, request, 20.0, callbacks)));
    }
  }
  static wire::WireOptions Wire() {
    wire::WireOptions options;
    options.domain = test::TestDomain();
    return options;
  }
  void Send(int robot, const Odometry& odometry) override { Must(of(robot).Publish(odometry)); }
  void Send(int robot, const Scan& scan) override { Must(of(robot).Publish(scan)); }

 private:
  client::RobotClient& of(int robot) { return *robots_[static_cast<std::size_t>(robot)]; }

  std::unique_ptr<wire::Bus> bus_;
  std::vector<std::unique_ptr<client::RobotClient>> robots_;
};

class Ros2Side final : public Door {
 public:
  Ros2Side(const std::string& prefix, Waiting& waiting)
      : bus_(Must(ros2::Bus::Create(NativeDoor::Wire(), "cairn-study-ros2"))) {
    for (int robot = 0; robot < kRobots; ++robot) {
      const std::string name = prefix + std::to_string(robot);
      const std::string in = "rt/" + name + "/" + name + "/";  // The rule in StudyRos2Latency: /{site}/{robot}.
      robots_.push_back({Must(bus_->Advertise<ros2::LaserScan>(in + "scan", {true, false, 10})),
                         Must(bus_->Advertise<ros2::Odometry>(in + "odom", {true, false, 10})),
                         Must(bus_->Advertise<ros2::Transforms>(in + "tf_static", {true, true, 1})), false});
      poses_.push_back(Must(bus_->Subscribe<ros2::PoseWithCovariance>(
          in + "cairn/pose", {true, false, 10},
          [&waiting, robot](ros2::PoseWithCovariance&& pose, const ros2::Origin&) {
            waiting.Came(robot, pose.header.stamp);
          })));
    }
    thread_ = std::jthread([this](const std::stop_token& stop) {
      bus_->Run(
          stop, [] {}, std::chrono::milliseconds(1000), [](const std::exception&) {});
    });
  }
  void Send(int robot, const Odometry& odometry) override {
    ros2::Odometry message;
    message.header = {odometry.stamp, "odom"};
    message.child_frame = "base_link";
    message.pose = InSpace(odometry.T_odom_robot);
    Must(of(robot).odom->Publish(message));
  }
  void Send(int robot, const Scan& scan) override {
    Robot& to = of(robot);
    if (!to.mounted) {
      ros2::Transforms mounting;
      ros2::Transform& link = mounting.transforms.emplace_back();
      link.header.frame = "base_link";
      link.child_frame = "laser";
      link.T_frame_child = InSpace(scan.T_robot_laser);
      Must(to.tf_static->Publish(mounting));
      to.mounted = true;
    }
    ros2::LaserScan message;
    message.header = {scan.stamp, "laser"};
    message.angle_min = scan.angle_first_rad;
    message.angle_increment = scan.angle_step_rad;
    message.time_increment = scan.beam_period_s;
    message.range_min = scan.range_min_m;
    message.range_max = scan.range_max_m;
    message.ranges = scan.ranges_m;
    Must(to.scan->Publish(message));
  }

 private:
  struct Robot {
    std::unique_ptr<ros2::Publication<ros2::LaserScan>> scan;
    std::unique_ptr<ros2::Publication<ros2::Odometry>> odom;
    std::unique_ptr<ros2::Publication<ros2::Transforms>> tf_static;
    bool mounted = false;
  };
  static ros2::Pose3 InSpace(const Pose2& pose) {
    return {{pose.x, pose.y, 0.0}, Eigen::Quaterniond(Eigen::AngleAxisd(pose.theta, Eigen::Vector3d::UnitZ()))};
  }
  Robot& of(int robot) { return robots_[static_cast<std::size_t>(robot)]; }

  std::unique_ptr<ros2::Bus> bus_;
  std::vector<Robot> robots_;
  std::vector<std::unique_ptr<ros2::Subscription>> poses_;
  std::jthread thread_;
};

struct Drive {
  std::vector<double> latency_ms;
  int scans = 0;
  double server_cpu_s = 0.0;
};

// The same records for both doors, at the pace of their stamps.
Drive DriveThrough(Door& door, Waiting& waiting, const LiveServer& server, std::uint64_t seed, double seconds) {
  sim::FleetOptions options;
  options.robots = kRobots;
  options.laser.beams = 360;
  options.seed = seed;
  sim::Fleet fleet = Must(sim::Fleet::Create(Must(sim::OpenWorld("building")), options));
  const pid_t pid = std::stoi(server.pid());
  const double cpu_before = CpuSecondsOf(pid);
  const auto began = Clock::now();
  Drive drive;
  for (;;) {
    const sim::FleetRecord next = fleet.Next();
    const Stamp stamp = std::visit([](const auto& record) { return record.stamp; }, next.record);
    const auto since_start = std::chrono::nanoseconds(stamp - options.first_stamp);
    if (since_start > std::chrono::duration<double>(seconds)) break;
    std::this_thread::sleep_until(began + since_start);
    if (const auto* const scan = std::get_if<Scan>(&next.record)) {
      waiting.Sent(next.robot, stamp);
      door.Send(next.robot, *scan);
      ++drive.scans;
    } else {
      door.Send(next.robot, std::get<Odometry>(next.record));
    }
  }
  // The last poses are on their way, and a pose that was lost never comes: there is no condition to wait for.
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  drive.server_cpu_s = CpuSecondsOf(pid) - cpu_before;
  drive.latency_ms = waiting.latency_ms();
  return drive;
}

void Add(Drive& sum, Drive&& more) {
  sum.latency_ms.insert(sum.latency_ms.end(), more.latency_ms.begin(), more.latency_ms.end());
  sum.scans += more.scans;
  sum.server_cpu_s += more.server_cpu_s;
}

}  // namespace

void StudyRos2Latency(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Scan published to pose received, through the native door and through that for ROS 2");
  const LiveServer server({"--set", "ros2.enabled=true", "--set", "ros2.domain=" + std::to_string(test::TestDomain()),
                           "--set", "ros2.namespaces=/{site}/{robot}"});
  const int rounds = context.Pick(4, 1);
  const double seconds = context.Pick(30.0, 5.0);
  Drive native, ros2;
  // In turn, so that both meet the same changes of the machine. Every round has robots of its own.
  for (int round = 0; round < rounds; ++round) {
    const std::uint64_t seed = context.seed + static_cast<std::uint64_t>(round);
    {
      Waiting waiting;
      NativeDoor door("native" + std::to_string(round) + "_", waiting);
      Add(native, DriveThrough(door, waiting, server, seed, seconds));
    }
    {
      Waiting waiting;
      Ros2Side door("ros" + std::to_string(round) + "_", waiting);
      Add(ros2, DriveThrough(door, waiting, server, seed, seconds));
    }
  }
  Table table({"door, 3 robots at 10 Hz, 360 beams", "scans", "poses", "p50 (ms)", "p99 (ms)", "max (ms)",
               "server, CPU ms a scan"});
  const auto row = [&table](const std::string& name, const Drive& drive) {
    const Distribution latency = DistributionOf(drive.latency_ms);
    table.Add({name, Count(drive.scans), Count(static_cast<long long>(drive.latency_ms.size())),
               Number(latency.median, 2), Number(latency.p99, 1), Number(latency.max, 1),
               Number(1e3 * drive.server_cpu_s / drive.scans, 2)});
    return latency.median;
  };
  const double native_ms = row("native", native);
  const double ros2_ms = row("ROS 2", ros2);
  report.Add(table, "ros2");
  report.Expect(ros2_ms <= kMostRatio * native_ms,
                "the median through the door for ROS 2 is " + Number(ros2_ms / native_ms, 2) +
                    " times the native one, wanted at most " + Number(kMostRatio, 1));
  // The scans of the first two seconds may come before the two sides have discovered each other.
  const int undiscovered = rounds * kRobots * 20;
  report.Expect(static_cast<int>(ros2.latency_ms.size()) >= ros2.scans - undiscovered,
                "too few poses came back to ROS 2");
}

}  // namespace cairn::studies
