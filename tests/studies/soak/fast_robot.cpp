#include "tests/studies/soak/fast_robot.h"

#include <algorithm>
#include <utility>

#include "tests/must.h"

namespace cairn::studies {
namespace {

// Scans that are not settled, at most: one that the estimator works on, and the next. So the time to the pose is that
// of the server and not that of a queue.
constexpr std::uint64_t kWindow = 2;
constexpr double kPatience_s = 60.0;

Stamp StampOf(const LogRecord& record) {
  return std::visit([](const auto& value) { return value.stamp; }, record);
}

}  // namespace

FastRobot::FastRobot(wire::Bus& bus, const std::string& name, sim::Fleet fleet, double scan_hz)
    : fleet_(std::move(fleet)), period_(StampFromSeconds(1.0 / scan_hz)) {
  SessionRequest request;
  request.robot = name;
  request.site = "soak";
  request.sensors = {"laser"};
  request.has_start = true;
  request.T_map_robot_start = fleet_.T_map_robot_start(0);
  client::RobotClient::Callbacks callbacks;
  callbacks.pose = [this](const PoseReport& pose) { OnPose(pose); };
  client::RobotClientOptions options;
  options.window = kWindow;
  options.send_timeout_s = kPatience_s;
  client_ = test::Must(client::RobotClient::Open(bus, request, kPatience_s, std::move(callbacks), options));
}

void FastRobot::OnPose(const PoseReport& pose) {
  const auto now = Clock::now();
  const MutexLock lock(mutex_);
  const auto departure = departures_.find(pose.stamp);
  if (departure == departures_.end()) return;
  latency_ms_.push_back(std::chrono::duration<double, std::milli>(now - departure->second).count());
  departures_.erase(departures_.begin(), std::next(departure));
}

void FastRobot::Send(LogRecord&& record) {
  now_ = StampOf(record);
  if (const auto* odometry = std::get_if<Odometry>(&record)) {
    T_odom_robot_ = odometry->T_odom_robot;
    return test::Must(client_->Publish(*odometry));
  }
  last_scan_ = std::get<Scan>(std::move(record));
  {
    const MutexLock lock(mutex_);
    departures_[now_] = Clock::now();
  }
  test::Must(client_->Publish(*last_scan_));
  ++scans_;
}

void FastRobot::Drive(double seconds) {
  std::optional<Stamp> end;
  bool scan = true;
  // The last record is odometry, without which the last scan would wait.
  while (scan || now_ < *end) {
    sim::FleetRecord next = fleet_.Next();
    if (!end) end = StampOf(next.record) + StampFromSeconds(seconds);
    scan = std::holds_alternative<Scan>(next.record);
    Send(std::move(next.record));
  }
}

void FastRobot::Stand(double seconds) {
  if (!last_scan_) throw std::logic_error("a robot has to have driven before it stands");
  const Stamp end = now_ + StampFromSeconds(seconds);
  while (now_ < end) {
    Scan scan = *last_scan_;
    scan.stamp = now_ + period_;
    Send(scan);
    Send(Odometry{.sequence = 0, .stamp = now_, .T_odom_robot = T_odom_robot_});
  }
}

Distribution FastRobot::TakeLatencies() {
  test::Must(client_->WaitSettled(kPatience_s));
  const MutexLock lock(mutex_);
  departures_.clear();
  return DistributionOf(std::exchange(latency_ms_, {}));
}

Ledger FastRobot::ledger() const {
  return client_->ledger().value_or(Ledger{});
}

}  // namespace cairn::studies
