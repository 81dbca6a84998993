#include "tests/server/slam/moved_sweep.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "server/slam/scan_pipeline.h"
#include "tests/server/slam/fleet_drives.h"

namespace cairn::test {
namespace {

// What the odometry shows after the gap.
enum class Odometer {
  kGoesOn,       // What happened in the gap.
  kStandsStill,  // What it showed before: the robot was carried.
  kHalf,         // The first half of the way: then the robot was carried.
  kAtZero,       // It began anew.
};

struct Kind {
  std::string name;
  double skipped_s = 0.0;  // So much of the drive happens in the gap ...
  double lasts_s = 0.0;    // ... which is so long by the robot's clock.
  Odometer odometer = Odometer::kGoesOn;
  bool odometry_missing = true;
  bool new_client = false;
  bool other_robot = false;  // Another robot goes on, which stands somewhere else.
};

const std::vector<Kind> kKinds = {
    {"stands for 10 s", 0.0, 10.0, Odometer::kStandsStill},
    {"stands for 10 min", 0.0, 600.0, Odometer::kStandsStill},
    {"drives 4 s, odometry sees it", 4.0, 4.0, Odometer::kGoesOn, false},
    {"drives 15 s, odometry sees it", 15.0, 15.0, Odometer::kGoesOn, false},
    {"drives 60 s, odometry sees it", 60.0, 60.0, Odometer::kGoesOn, false},
    {"drives 4 s", 4.0, 4.0, Odometer::kGoesOn},
    {"drives 40 s", 40.0, 40.0, Odometer::kGoesOn},
    {"carried for 3 s", 3.0, 3.0, Odometer::kStandsStill},
    {"carried for 12 s", 12.0, 12.0, Odometer::kStandsStill},
    {"carried for 45 s", 45.0, 45.0, Odometer::kStandsStill},
    {"carried for 80 s", 80.0, 80.0, Odometer::kStandsStill},
    {"carried for 1 s", 1.0, 10.0, Odometer::kStandsStill},
    {"carried for 2 s", 2.0, 10.0, Odometer::kStandsStill},
    {"drives, then carried", 20.0, 20.0, Odometer::kHalf},
    {"odometry anew at once", 0.0, 0.0, Odometer::kAtZero, false},
    {"odometry anew, carried for 5 s", 5.0, 30.0, Odometer::kAtZero},
    {"odometry anew, carried for 50 s", 50.0, 50.0, Odometer::kAtZero},
    {"new client, carried for 12 s", 12.0, 12.0, Odometer::kStandsStill, true, true},
    {"other robot", 0.0, 5.0, Odometer::kAtZero, true, true, true},
    {"other robot, odometry fits", 0.0, 5.0, Odometer::kStandsStill, true, true, true},
};

// Nothing is missing in what the robot sends: its scans show another place, and its odometry goes on.
const std::vector<Kind> kKidnapped = {
    {"carried unseen, 10 s of the way", 10.0, 0.0, Odometer::kStandsStill},
    {"carried unseen, 20 s of the way", 20.0, 0.0, Odometer::kStandsStill},
    {"carried unseen, 45 s of the way", 45.0, 0.0, Odometer::kStandsStill},
    {"carried unseen, 80 s of the way", 80.0, 0.0, Odometer::kStandsStill},
};

// A place of the world, and where the map shows it.
struct Shown {
  Pose2 T_world_robot;
  Pose2 T_map_robot;
};

constexpr double kSamePlaceM = 10.0;  // The map is rigid over such a distance.

double DistanceM(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm();
}

// Feeds one estimator and counts.
class Follower {
 public:
  explicit Follower(const Pose2& start, const MovedSweepOptions& options)
      : pipeline_(MapperOptionsOf(options), start, slam::SerialFor,
                  {.used = [this](const Scan& scan, const slam::ScanOutcome& outcome) { Judge(scan, outcome); },
                   .dropped = [](const Scan&, DropReason) {}}) {}

  // The truth of what is fed, and the shift of its stamps.
  void Watch(const Trajectory& truth, Stamp later, MovedCase* counted) {
    truth_ = &truth;
    later_ = later;
    case_ = counted;
  }
  // Where the map of the drive without a gap shows the places of the world, and the truth of the drive before the gap,
  // at which the present map is compared. The drift of an unclosed map is no fault of the gap.
  void CompareWith(const std::vector<Shown>* undisturbed, const Trajectory* before, Stamp until) {
    undisturbed_ = undisturbed;
    truth_before_ = before;
    until_ = until;
  }
  [[nodiscard]] const std::vector<Shown>& shown() const { return shown_; }
  [[nodiscard]] const Pose2& T_odom_robot() const { return T_odom_robot_; }  // At the last scan.
  void Feed(LogRecord record, const Pose2& T_new_old) {
    if (auto* const scan = std::get_if<Scan>(&record)) {
      scan->stamp += later_;
      scan->sequence = 0;
      pipeline_.Add(std::make_shared<const Scan>(std::move(*scan)));
    } else {
      auto& odometry = std::get<Odometry>(record);
      odometry.stamp += later_;
      odometry.sequence = 0;
      odometry.T_odom_robot = T_new_old * odometry.T_odom_robot;
      pipeline_.Add(odometry);
    }
  }
  [[nodiscard]] slam::ScanPipeline& pipeline() { return pipeline_; }

 private:
  static slam::MapperOptions MapperOptionsOf(const MovedSweepOptions& sweep) {
    slam::MapperOptions options = sweep.mapper;
    options.filter.particles = 20;
    options.seed = static_cast<std::int64_t>(sweep.seed);
    return options;
  }
  void Judge(const Scan& scan, const slam::ScanOutcome& outcome) {
    if (case_ == nullptr) return;
    const auto truth = PoseOn(*truth_, scan.stamp - later_, 1.0);
    if (!truth) return;
    if (!first_) first_ = scan.stamp;
    if (before_) {
      const double step_m = DistanceM(*truth, *before_);
      way_m_ += step_m;
      if (DrovePast(*truth)) case_->shown_m += step_m;
    }
    before_ = *truth;
    if (outcome.localized) shown_.push_back({*truth, outcome.T_map_robot});
    ++case_->poses;
    T_odom_robot_ = outcome.T_map_odom.Inverse() * outcome.T_map_robot;
    const double error_m = ErrorOf(outcome.T_map_robot, *truth);
    if (!outcome.localized) {
      if (case_->noticed_after_m < 0.0) case_->noticed_after_m = way_m_;
      case_->found_after_s = case_->found_after_m = -1.0;
    } else if (case_->found_after_s < 0.0) {
      case_->found_after_s = SecondsFromStamp(scan.stamp - *first_);
      case_->found_after_m = way_m_;
    }
    if (!outcome.localized) return;
    case_->worst_m = std::max(case_->worst_m, error_m);
    if (error_m <= kMovedWrongM) return;
    ++case_->wrong;
    case_->wrong_later += way_m_ > kNoticedWithinM ? 1 : 0;
  }
  // Whether the way before the gap leads past this place.
  [[nodiscard]] bool DrovePast(const Pose2& truth) const {
    if (truth_before_ == nullptr) return false;
    return std::ranges::any_of(*truth_before_, [&](const auto& one) {
      return one.stamp <= until_ && DistanceM(one.T_map_robot, truth) < kShownM;
    });
  }
  // The places before the gap, as the best hypothesis has them now.
  [[nodiscard]] std::vector<Shown> Mapped() const {
    std::vector<Shown> mapped;
    const slam::MapperSnapshot now = pipeline_.mapper().Snapshot();
    for (std::size_t k = 0; k < now.keyframes.size() && now.keyframes[k].scan->stamp <= until_; ++k)
      mapped.push_back({*PoseOn(*truth_before_, now.keyframes[k].scan->stamp, 1.0), now.full_path[k]});
    return mapped;
  }
  [[nodiscard]] double ErrorOf(const Pose2& told, const Pose2& truth) const {
    double error_m = (told.translation() - truth.translation()).norm();
    if (undisturbed_ == nullptr || error_m <= kMovedWrongM) return error_m;
    std::vector<Shown> places = Mapped();
    places.insert(places.end(), undisturbed_->begin(), undisturbed_->end());
    double nearest_m = std::numeric_limits<double>::infinity();
    for (const Shown& one : places) nearest_m = std::min(nearest_m, DistanceM(one.T_world_robot, truth));
    const double near_m = std::max(nearest_m, kSamePlaceM);
    for (const Shown& one : places) {
      if (DistanceM(one.T_world_robot, truth) > near_m) continue;
      const Pose2 T_robot_now = Between(one.T_world_robot, truth);
      error_m = std::min(error_m, DistanceM(told, one.T_map_robot * T_robot_now));
    }
    return error_m;
  }

  const Trajectory* truth_ = nullptr;
  const std::vector<Shown>* undisturbed_ = nullptr;
  const Trajectory* truth_before_ = nullptr;
  Stamp until_ = 0;
  std::vector<Shown> shown_;
  Stamp later_ = 0;
  Pose2 T_odom_robot_;
  MovedCase* case_ = nullptr;
  std::optional<Stamp> first_;
  std::optional<Pose2> before_;
  double way_m_ = 0.0;
  slam::ScanPipeline pipeline_;
};

struct Before {
  double seconds = 0.0;
  Odometry odometry;   // The last one.
  Scan scan;           // The last one,
  Pose2 T_odom_robot;  // and the odometry at its stamp.
  std::string state;
};

MovedCase After(const Before& before, const std::vector<FleetDrive>& drives, const std::vector<Shown>& undisturbed,
                const Kind& kind, const MovedSweepOptions& options, MovedCase result) {
  const FleetDrive& drive = drives[kind.other_robot ? 1 : 0];
  Follower follower({}, options);
  if (!follower.pipeline().Load(before.state)) std::abort();
  if (kind.new_client) follower.pipeline().NewClient();
  const double until_s = before.seconds + kind.skipped_s;
  follower.Watch(drive.truth, StampFromSeconds(kind.lasts_s - kind.skipped_s), &result);
  follower.CompareWith(&undisturbed, &drives.front().truth, before.scan.stamp);
  std::optional<Pose2> T_new_old;
  Pose2 T_half;
  if (result.stood_still) {  // The robot still sees what it saw, and then it drives on.
    follower.Feed(Odometry{.sequence = 0, .stamp = before.scan.stamp, .T_odom_robot = before.T_odom_robot}, {});
    follower.Feed(before.scan, {});
  }
  for (const auto& [seconds, record] : drive.records) {
    if (seconds <= before.seconds) continue;
    if (seconds > until_s + options.watched_again_s) break;
    const auto* const odometry = std::get_if<Odometry>(&record);
    if (odometry != nullptr && seconds <= before.seconds + 0.5 * kind.skipped_s) T_half = odometry->T_odom_robot;
    if (seconds <= until_s) {
      if (odometry != nullptr && !kind.odometry_missing) follower.Feed(record, {});
      continue;
    }
    if (!T_new_old) {
      if (odometry == nullptr) continue;
      const Pose2 T_old_odom = odometry->T_odom_robot.Inverse();
      switch (kind.odometer) {
        case Odometer::kGoesOn:
          T_new_old = Pose2{};
          break;
        case Odometer::kStandsStill:
          T_new_old = before.odometry.T_odom_robot * T_old_odom;
          break;
        case Odometer::kHalf:
          T_new_old = T_half * T_old_odom;
          break;
        case Odometer::kAtZero:
          T_new_old = T_old_odom;
          break;
      }
    }
    follower.Feed(record, *T_new_old);
  }
  follower.pipeline().Finish();
  return result;
}

// The state at each moment of the drive as it is without a gap.
std::vector<Before> RunUndisturbed(const FleetDrive& drive, const MovedSweepOptions& options,
                                   std::vector<Shown>* shown) {
  std::vector<Before> moments;
  Follower follower(drive.T_map_robot_start, options);
  MovedCase undisturbed;
  follower.Watch(drive.truth, 0, &undisturbed);
  Before now;
  for (const auto& [seconds, record] : drive.records) {
    const double moment_s = options.first_s + options.between_s * static_cast<double>(moments.size());
    if (seconds > moment_s && std::holds_alternative<Scan>(record) &&
        moments.size() < static_cast<std::size_t>(options.moments)) {
      now.seconds = moment_s;
      now.T_odom_robot = follower.T_odom_robot();
      follower.pipeline().Save(now.state);
      moments.push_back(now);
    }
    if (const auto* const odometry = std::get_if<Odometry>(&record)) now.odometry = *odometry;
    if (const auto* const scan = std::get_if<Scan>(&record)) now.scan = *scan;
    follower.Feed(record, {});
  }
  *shown = follower.shown();
  return moments;
}

}  // namespace

std::vector<std::string> MovedKinds() {
  std::vector<std::string> names;
  for (const Kind& kind : kKinds) names.push_back(kind.name);
  return names;
}

std::vector<MovedCase> RunMovedSweep(const MovedSweepOptions& options) {
  std::vector<MovedCase> cases;
  for (const std::string& world : options.worlds) {
    const double last_s = options.first_s + options.between_s * (options.moments - 1);
    const std::vector<FleetDrive> drives =
        DriveFleet(world, 2, last_s + 80.0 + options.watched_again_s + 1.0, options.seed);
    std::vector<Shown> undisturbed;
    for (const Before& before : RunUndisturbed(drives.front(), options, &undisturbed)) {
      for (const Kind& kind : options.kidnapped ? kKidnapped : kKinds) {
        if (kind.name.find(options.only) == std::string::npos) continue;
        MovedCase one{.world = world, .kind = kind.name, .from_s = before.seconds, .seed = options.seed};
        one.stood_still = kind.odometer == Odometer::kStandsStill && kind.skipped_s == 0.0 && !kind.other_robot;
        cases.push_back(After(before, drives, undisturbed, kind, options, std::move(one)));
        options.done(cases.back());
      }
    }
  }
  return cases;
}

}  // namespace cairn::test
