#include "tests/studies/kills/standing_robot.h"

#include <algorithm>
#include <utility>
#include <variant>

#include "common/sensor/log_reader.h"
#include "tests/must.h"

namespace cairn::studies {
namespace {

constexpr Stamp kPeriod_ns = 100'000'000;

}  // namespace

StandingRobot::StandingRobot(wire::Bus& bus, const std::string& robot, const std::string& site,
                             const std::filesystem::path& log) {
  const auto keep = [this](LogRecord&& record) {
    if (auto* const scan = std::get_if<Scan>(&record)) {
      scan_ = std::move(*scan);
    } else {
      odometry_ = std::get<Odometry>(record);
    }
    return true;
  };
  static_cast<void>(test::Must(ReadLog(log, {}, keep)));
  scan_.stamp = std::max(scan_.stamp, odometry_.stamp);
  SessionRequest request;
  request.robot = robot;
  request.site = site;
  request.sensors = {"laser"};
  client::RobotClientOptions options;
  options.window = 0;
  client::RobotClient::Callbacks callbacks;
  callbacks.pose = [this](const PoseReport& pose) { Take(pose); };
  client_ = test::Must(client::RobotClient::Open(bus, request, 20.0, std::move(callbacks), options));
}

void StandingRobot::Publish() {
  scan_.stamp += kPeriod_ns;
  for (const Stamp stamp : {scan_.stamp - kPeriod_ns / 4, scan_.stamp + kPeriod_ns / 4}) {
    odometry_.stamp = stamp;
    test::Must(client_->Publish(odometry_));
    if (stamp < scan_.stamp) test::Must(client_->Publish(scan_));
  }
  const MutexLock lock(mutex_);
  published_ = scan_.stamp;
}

void StandingRobot::Expect() {
  const MutexLock lock(mutex_);
  before_ = last_ ? last_->generation : 0;
  after_ = published_;
  back_.reset();
}

std::optional<StandingRobot::Clock::time_point> StandingRobot::back() const {
  const MutexLock lock(mutex_);
  return back_;
}

void StandingRobot::Take(const PoseReport& pose) {
  const MutexLock lock(mutex_);
  last_ = pose;
  if (!back_ && pose.generation > before_ && pose.stamp > after_) back_ = Clock::now();
}

}  // namespace cairn::studies
