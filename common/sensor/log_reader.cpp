#include "common/sensor/log_reader.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <system_error>
#include <utility>

#include "common/sensor/log_fields.h"
#include "common/sensor/log_message.h"
#include "common/sensor/log_survey.h"

namespace cairn {
namespace {

constexpr double kSickLimit = 80.0;   // m; readings above it are error codes of the scanner.
constexpr double kSickStated = 82.0;  // m; what messages state for such a scanner lies between the two.
constexpr int kMostComplaints = 100;
constexpr int kLinesToRecognise = 10'000;  // A log shows its first message within these.

std::size_t Index(LaserKind kind) {
  return static_cast<std::size_t>(kind);
}

std::string Metres(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3f m", value);
  return text.data();
}

// Findings of the first pass about one kind of laser message.
struct LaserFacts {
  std::int64_t scans = 0;
  std::optional<double> no_return;
  Pose2 T_robot_laser;
};

struct LogFacts {
  bool dpslam = false;
  std::array<LaserFacts, kLaserKindCount> lasers;
  std::vector<std::string> notes;
};

std::string_view KindName(LaserKind kind) {
  constexpr std::array<std::string_view, kLaserKindCount> kNames = {"FLASER",    "RLASER", "ROBOTLASER1",
                                                                    "RAWLASER1", "Laser",  "TILTLASER1"};
  return kNames[Index(kind)];
}

tl::unexpected<Status> CannotRead(const std::filesystem::path& path, const std::string& why) {
  return Fail(StatusCode::kNotFound, path.string() + ": " + why);
}

Result<LogLines> Open(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return CannotRead(path, "no such file");
  if (!std::filesystem::is_regular_file(path, error)) return CannotRead(path, "not a regular file");
  LogLines lines(path);
  if (!lines.is_open()) return CannotRead(path, "cannot be opened");
  return lines;
}

LaserFacts Conclude(LaserKind kind, const LaserSurvey& survey, const LogReaderOptions& options,
                    std::vector<std::string>& notes) {
  LaserFacts facts;
  facts.scans = survey.scans();
  if (facts.scans == 0) return facts;
  const std::string name(KindName(kind));
  facts.no_return = survey.NoReturn();
  if (facts.no_return) notes.push_back(name + ": saturated readings from " + Metres(*facts.no_return) + " on");
  if (kind == LaserKind::kDpslam) {
    facts.T_robot_laser = Pose2{options.dpslam_laser_forward_m, 0.0, 0.0};
  } else if (const auto mounting = survey.Mounting()) {
    facts.T_robot_laser = *mounting;
  } else if (kind != LaserKind::kRaw) {
    notes.push_back(name + ": laser poses follow no fixed mounting; the laser is taken to be at the robot's centre");
  }
  return facts;
}

Result<LogFacts> Survey(const std::filesystem::path& path, const LogReaderOptions& options) {
  auto lines = Open(path);
  if (!lines) return tl::unexpected(lines.error());
  LogFacts facts;
  std::array<LaserSurvey, kLaserKindCount> surveys;
  bool recognised = false;
  std::string_view line;
  while (lines->Next(line) && (recognised || lines->number() <= kLinesToRecognise)) {
    const LogMessage message = ParseLogLine(line);
    const auto* laser = std::get_if<LaserMessage>(&message);
    const auto* odometry = std::get_if<OdometryMessage>(&message);
    const auto* bad = std::get_if<BadMessage>(&message);
    if (!recognised && (laser != nullptr || odometry != nullptr)) {
      facts.dpslam = laser != nullptr ? laser->kind == LaserKind::kDpslam : odometry->dpslam;
    }
    recognised = recognised || laser != nullptr || odometry != nullptr || (bad != nullptr && bad->known_kind);
    if (laser != nullptr) surveys[Index(laser->kind)].Add(*laser);
  }
  if (lines->failed()) return Fail(StatusCode::kDataLoss, path.string() + ": reading failed");
  if (!recognised) {
    return Fail(StatusCode::kInvalidArgument, path.string() + ": not a robot log (no CARMEN or DP-SLAM message in " +
                                                  std::to_string(lines->number()) + " lines)");
  }
  for (std::size_t i = 0; i < surveys.size(); ++i) {
    facts.lasers[i] = Conclude(static_cast<LaserKind>(i), surveys[i], options, facts.notes);
  }
  return facts;
}

// Turns messages into records, with the facts of the whole file.
class LogEmitter {
 public:
  LogEmitter(LogFacts facts, const LogReaderOptions& options, const std::function<bool(LogRecord&&)>& sink)
      : facts_(std::move(facts)), options_(options), sink_(sink) {
    summary_.notes = facts_.notes;
  }

  // False if the sink wants no more.
  bool Take(int line, LogMessage&& message) {
    if (auto* laser = std::get_if<LaserMessage>(&message)) return TakeLaser(line, std::move(*laser));
    if (const auto* odometry = std::get_if<OdometryMessage>(&message)) return TakeOdometry(line, *odometry);
    if (const auto* bad = std::get_if<BadMessage>(&message)) Complain(line, bad->reason);
    if (const auto* timing = std::get_if<TimingMessage>(&message)) {
      if (const auto set = SetLidarTiming(logged_timing_, timing->name, timing->value); !set)
        Complain(line, set.error().message);
    }
    if (std::holds_alternative<IgnoredMessage>(message)) ++summary_.ignored;
    return true;
  }

  void Complain(int line, const std::string& reason) {
    if (++summary_.complaint_count <= kMostComplaints) summary_.complaints.push_back({line, reason});
  }

  // At the end of the file: an odometry that no laser message followed.
  void Finish() {
    if (pending_ && EmitOdometry(NextDpslamStamp(), *pending_)) pending_.reset();
  }

  [[nodiscard]] LogSummary summary() && { return std::move(summary_); }

 private:
  bool TakeOdometry(int line, const OdometryMessage& odometry) {
    if (odometry.dpslam != facts_.dpslam) return WrongFormat(line);
    if (!odometry.dpslam) return EmitOdometry(odometry.stamp, odometry.T_odom_robot);
    if (pending_) ++summary_.ignored;  // Two in a row have one time only: the later one counts.
    pending_ = odometry.T_odom_robot;
    return true;
  }

  bool TakeLaser(int line, LaserMessage&& laser) {
    if ((laser.kind == LaserKind::kDpslam) != facts_.dpslam) return WrongFormat(line);
    if (facts_.dpslam) {
      laser.stamp = NextDpslamStamp();
      laser.T_odom_robot = std::exchange(pending_, std::nullopt);
    }
    if (laser.T_odom_robot && !EmitOdometry(laser.stamp, *laser.T_odom_robot)) return false;
    if (IsTwin(laser)) {
      ++summary_.ignored;
      return true;
    }
    last_kind_ = laser.kind;
    last_scan_stamp_ = laser.stamp;
    last_beams_ = laser.ranges_m.size();
    const LaserFacts& facts = facts_.lasers[Index(laser.kind)];
    Scan scan;
    scan.stamp = laser.stamp;
    scan.angle_first_rad = laser.angle_first_rad;
    scan.angle_step_rad = laser.angle_step_rad;
    scan.range_max_m = RangeMax(laser, facts);
    scan.tilt_rad = laser.tilt_rad;
    scan.T_robot_laser = options_.T_robot_laser.value_or(facts.T_robot_laser);
    scan.ranges_m = std::move(laser.ranges_m);
    if (const auto timed = PutInOrderOfTime(Merge(options_.timing, logged_timing_), scan); !timed) {
      Complain(line, timed.error().message);
      return true;
    }
    ++summary_.scans;
    return sink_(std::move(scan));
  }

  // CARMEN logs the same sweep as RAWLASER1 and ROBOTLASER1, and some robots as FLASER and ROBOTLASER1.
  [[nodiscard]] bool IsTwin(const LaserMessage& laser) const {
    if (laser.kind == LaserKind::kRaw && facts_.lasers[Index(LaserKind::kRobot)].scans > 0) return true;
    if (laser.kind == LaserKind::kTilted || last_kind_ == LaserKind::kTilted) return false;
    const bool front_twins = laser.kind != LaserKind::kRear && last_kind_ != LaserKind::kRear;
    return summary_.scans > 0 && front_twins && laser.kind != last_kind_ && laser.stamp == last_scan_stamp_ &&
           laser.ranges_m.size() == last_beams_;
  }

  [[nodiscard]] double RangeMax(const LaserMessage& laser, const LaserFacts& facts) const {
    if (options_.no_return_m > 0.0) return options_.no_return_m;
    const double stated = laser.stated_range_max_m;
    if (laser.kind == LaserKind::kTilted && stated > 0.0) return stated;  // Ours: it says what it means.
    const bool sick = stated <= 0.0 || (stated >= kSickLimit && stated <= kSickStated);
    if (!facts_.dpslam && !sick) return stated;
    const double limit = facts_.dpslam ? options_.dpslam_range_max_m : kSickLimit;
    return std::min(limit, facts.no_return.value_or(limit));
  }

  bool EmitOdometry(Stamp stamp, const Pose2& T_odom_robot) {
    if (summary_.odometries > 0 && stamp == last_odometry_stamp_) return true;
    last_odometry_stamp_ = stamp;
    ++summary_.odometries;
    return sink_(Odometry{0, stamp, T_odom_robot});
  }

  bool WrongFormat(int line) {
    Complain(line, facts_.dpslam ? "CARMEN message in a DP-SLAM log" : "DP-SLAM message in a CARMEN log");
    return true;
  }

  // Whole nanoseconds, multiplied: no error grows along the log.
  Stamp NextDpslamStamp() { return ++dpslam_pairs_ * StampFromSeconds(options_.dpslam_scan_period_s); }

  LogFacts facts_;
  LogReaderOptions options_;
  const std::function<bool(LogRecord&&)>& sink_;
  LogSummary summary_;
  LidarTiming logged_timing_;     // What the lines so far say.
  std::optional<Pose2> pending_;  // DP-SLAM odometry waiting for its laser message.
  std::int64_t dpslam_pairs_ = 0;
  Stamp last_odometry_stamp_ = 0;
  Stamp last_scan_stamp_ = 0;
  std::size_t last_beams_ = 0;
  LaserKind last_kind_ = LaserKind::kFront;
};

}  // namespace

Result<LogSummary> ReadLog(const std::filesystem::path& path, const LogReaderOptions& options,
                           const std::function<bool(LogRecord&&)>& sink) {
  auto facts = Survey(path, options);
  if (!facts) return tl::unexpected(facts.error());
  auto lines = Open(path);
  if (!lines) return tl::unexpected(lines.error());
  LogEmitter emitter(std::move(*facts), options, sink);
  std::string_view line;
  bool wanted = true;
  while (wanted && lines->Next(line)) {
    if (lines->too_long()) {
      emitter.Complain(lines->number(), "line longer than " + std::to_string(LogLines::kMaxLength) + " bytes");
    } else {
      wanted = emitter.Take(lines->number(), ParseLogLine(line));
    }
  }
  if (lines->failed()) return Fail(StatusCode::kDataLoss, path.string() + ": reading failed");
  if (wanted) emitter.Finish();
  return std::move(emitter).summary();
}

}  // namespace cairn
