#include "tests/studies/kills/returning_robot.h"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <variant>

#include "common/sensor/log_reader.h"
#include "tests/must.h"

namespace cairn::studies {
namespace {

constexpr Stamp kPeriod_ns = 100'000'000;
constexpr std::ptrdiff_t kSteps = 300;

}  // namespace

ReturningRobot::ReturningRobot(wire::Bus& bus, const std::string& robot, const std::string& site,
                               const std::filesystem::path& log) {
  Odometry odometry;
  const auto keep = [&](LogRecord&& record) {
    if (auto* const scan = std::get_if<Scan>(&record)) {
      steps_.push_back({odometry, std::move(*scan)});
      if (std::ssize(steps_) > 2 * kSteps) steps_.erase(steps_.begin(), steps_.end() - kSteps);
    } else {
      odometry = std::get<Odometry>(record);
      stamp_ = std::max(stamp_, odometry.stamp);
    }
    return true;
  };
  static_cast<void>(test::Must(ReadLog(log, {}, keep)));
  if (steps_.empty()) throw std::runtime_error(log.string() + " holds no scan");
  if (std::ssize(steps_) > kSteps) steps_.erase(steps_.begin(), steps_.end() - kSteps);
  at_ = steps_.size() - 1;
  stamp_ = std::max(stamp_, steps_.back().scan.stamp);
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

void ReturningRobot::Publish() {
  if (at_ == 0) direction_ = 1;
  if (at_ + 1 == steps_.size()) direction_ = -1;
  if (steps_.size() > 1) at_ = direction_ > 0 ? at_ + 1 : at_ - 1;
  stamp_ += kPeriod_ns;
  Step& step = steps_[at_];
  step.odometry.stamp = step.scan.stamp = stamp_;
  test::Must(client_->Publish(step.odometry));
  test::Must(client_->Publish(step.scan));
  const MutexLock lock(mutex_);
  published_ = stamp_;
}

void ReturningRobot::Expect() {
  const MutexLock lock(mutex_);
  before_ = last_ ? last_->generation : 0;
  after_ = published_;
  back_.reset();
}

std::optional<ReturningRobot::Clock::time_point> ReturningRobot::back() const {
  const MutexLock lock(mutex_);
  return back_;
}

void ReturningRobot::Take(const PoseReport& pose) {
  const MutexLock lock(mutex_);
  last_ = pose;
  if (!back_ && pose.generation > before_ && pose.stamp > after_) back_ = Clock::now();
}

}  // namespace cairn::studies
