#include <cmath>
#include <functional>
#include <iomanip>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "common/options/config.h"
#include "server/slam/mapper_options.h"
#include "server/tools/calibrate/laser_run.h"
#include "server/tools/log_run/json_line.h"

namespace cairn::server {
namespace {

using slam::LaserUnknown;
using enum slam::LaserUnknown;

struct Line {
  LaserUnknown what;
  const char* key;
  const char* name;
  const char* unit;
  double factor;  // From the value to the unit that is printed.
  int digits;
  const char* option = nullptr;  // In slam.pairing; null: an option of those who read the log.
};
constexpr Line kLines[] = {
    {kLag, "lag_s", "lag", "s", 1.0, 3, "laser_lag_s"},
    {kWheelScale, "wheel_scale", "wheel scale", "", 1.0, 4, "wheels.wheel_scale"},
    {kTurnScale, "turn_scale", "turn scale", "", 1.0, 4, "wheels.turn_scale"},
    {kTurnPerM, "turn_per_m", "turn per m", "rad", 1.0, 4, "wheels.turn_per_m"},
    {kX, "x_m", "laser x", "m", 1.0, 3},
    {kY, "y_m", "laser y", "m", 1.0, 3},
    {kHeading, "heading_rad", "laser heading", "deg", 180.0 / kPi, 2},
};

double ValueOf(const LaserReport& report, LaserUnknown what) {
  const slam::MountingFit& fit = report.fit.mounting;
  switch (what) {
    case kLag:
      return report.fit.lag_s;
    case kWheelScale:
      return fit.wheels.wheel_scale;
    case kTurnScale:
      return fit.wheels.turn_scale;
    case kTurnPerM:
      return fit.wheels.turn_per_m;
    case kX:
      return fit.T_robot_laser.x;
    case kY:
      return fit.T_robot_laser.y;
    case kHeading:
      return fit.T_robot_laser.theta;
  }
  return 0.0;
}

const char* PlaceName(const LidarTiming& timing) {
  constexpr const char* kPlaces[] = {"first", "middle", "last"};
  return kPlaces[static_cast<std::size_t>(timing.stamp_at.value_or(StampAt::kFirst))];
}

// Lets only those fields pass that the log has shown, each explained by how sure its value is, so that a file with them
// leaves all others to the configuration that it is added to.
class OnlyShown final : public OptionVisitor {
 public:
  using Doubts = std::map<std::string, std::string, std::less<>>;  // By key.
  OnlyShown(OptionVisitor& to, const Doubts& doubts) : to_(to), doubts_(doubts) {}

  void Section(std::string_view key, std::string_view help, const std::function<void()>& fields) override {
    const std::string outer = std::exchange(prefix_, prefix_ + std::string(key) + '.');
    to_.Section(key, help, fields);
    prefix_ = outer;
  }
  void Real(std::string_view key, double& value, std::string_view unit, double min, double max,
            const Help& /*help*/) override {
    if (const auto doubt = doubts_.find(prefix_ + std::string(key)); doubt != doubts_.end())
      to_.Real(key, value, unit, min, max, doubt->second.c_str());
  }
  void Integer(std::string_view /*key*/, std::int64_t& /*value*/, std::string_view /*unit*/, std::int64_t /*min*/,
               std::int64_t /*max*/, const Help& /*help*/) override {}
  void Flag(std::string_view /*key*/, bool& /*value*/, const Help& /*help*/) override {}
  void Text(std::string_view /*key*/, std::string& /*value*/, const Help& /*help*/) override {}
  void Choice(std::string_view /*key*/, int& /*value*/, std::span<const std::string_view> /*names*/,
              const Help& /*help*/) override {}

 private:
  OptionVisitor& to_;
  const Doubts& doubts_;
  std::string prefix_;
};

OnlyShown::Doubts DoubtsOfShown(const LaserReport& report) {
  OnlyShown::Doubts doubts;
  for (const Line& line : kLines) {
    if (line.option == nullptr || !report.fit.mounting.Shows(line.what)) continue;
    std::ostringstream doubt;
    doubt << std::setprecision(2) << "Measured, +- " << report.fit.mounting.Doubt(line.what) << '.';
    doubts.emplace(line.option, doubt.str());
  }
  return doubts;
}

// The robot must do this for the value to show.
const char* NeededFor(LaserUnknown what) {
  switch (what) {
    case kLag:
      return "the robot must begin and end turns";
    case kWheelScale:
    case kHeading:
    case kTurnPerM:
      return "the robot must drive straight ahead past structure";
    case kTurnScale:
      return "the robot must turn";
    case kX:
    case kY:
      return "the robot must turn and drive";
  }
  return "";
}

void PrintTurn(const LaserReport& report, std::ostringstream& out) {
  const slam::TurnFit& turn = report.fit.turn;
  out << "turn          ";
  if (turn.pairs == 0) {
    out << "not shown: the robot must turn at different speeds\n";
    return;
  }
  if (!turn.shown()) {
    out << "this log does not show it: with the best turn scans of one place disagree by " << 1e3 * turn.rms_m
        << " mm, with all beams at once by " << 1e3 * turn.rms_at_once_m << " mm (" << turn.pairs << " pairs).\n"
        << "              That there is a turn is sure by " << turn.turning_sigmas
        << " standard deviations, its sense by " << turn.sense_sigmas << "; both must be " << slam::TurnFit::kShown
        << ", and the disagreement smaller by " << 100.0 * (1.0 - slam::TurnFit::kLargestRmsShare) << " %.\n"
        << "              Leave --scan-period out, or take a log with more turns on the spot in both directions\n";
    return;
  }
  out << (turn.timing.clockwise.value_or(false) ? "clockwise" : "counter-clockwise") << " (by " << turn.sense_sigmas
      << " standard deviations), in " << std::setprecision(3) << *turn.timing.scan_period_s << " s +- "
      << turn.period_doubt_s << " of the " << report.fit.scan_period_s << " s between scans";
  if (turn.timing.turn_from_rad)
    out << std::setprecision(0) << ", from " << Degrees(*turn.timing.turn_from_rad) << " deg +- "
        << Degrees(turn.from_doubt_rad);
  out << "\n              scans of one place disagree by " << std::setprecision(1) << 1e3 * turn.rms_m
      << " mm, with all "
      << "beams at once by " << 1e3 * turn.rms_at_once_m << " mm (" << turn.pairs << " pairs)\n";
}

}  // namespace

std::string ReportText(const LaserReport& report) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(1);
  out << "scans         " << report.scans << " (" << report.unusable_scans << " unusable), "
      << report.fit.mounting.pairs << " pairs aligned\n";
  PrintTurn(report, out);
  for (const Line& line : kLines) {
    out << std::left << std::setw(14) << line.name << std::right << std::setprecision(line.digits);
    const double doubt = line.factor * report.fit.mounting.Doubt(line.what);
    if (!report.fit.mounting.Shows(line.what)) {
      out << "not shown: " << NeededFor(line.what) << " (doubt " << doubt << ' ' << line.unit << ")\n";
      continue;
    }
    out << line.factor * ValueOf(report, line.what) << " +- " << doubt << ' ' << line.unit;
    if (line.what == kLag) {
      if (std::abs(report.fit.lag_s) > doubt)
        out << (report.fit.lag_s < 0.0 ? ": stamps of scans are early" : ": stamps of scans are late");
      else
        out << ": stamps of scans are right";
      if (report.fit.turn.shown()) out << ", if they belong to the " << PlaceName(report.fit.timing) << " beam";
    }
    if (line.what == kTurnScale)
      out << ": the track is " << report.fit.mounting.wheels.wheel_scale / report.fit.mounting.wheels.turn_scale
          << " times what odometry supposes";
    out << '\n';
  }
  if (!report.log_options.empty()) out << "options       " << report.log_options << '\n';
  return out.str();
}

std::string ReportJson(const LaserReport& report) {
  const slam::TurnFit& turn = report.fit.turn;
  Json object = {{"scans", report.scans},
                 {"unusable_scans", report.unusable_scans},
                 {"pairs", report.fit.mounting.pairs},
                 {"time_between_scans_s", report.fit.scan_period_s}};
  Json turning = {{"shown", turn.shown()},
                  {"pairs", turn.pairs},
                  {"turning_sigmas", turn.turning_sigmas},
                  {"sense_sigmas", turn.sense_sigmas},
                  {"disagreement_m", turn.rms_m},
                  {"disagreement_at_once_m", turn.rms_at_once_m}};
  if (turn.shown()) {
    turning["scan_period_s"] = *turn.timing.scan_period_s;
    turning["scan_period_doubt_s"] = turn.period_doubt_s;
    turning["clockwise"] = turn.timing.clockwise.value_or(false);
    if (turn.timing.turn_from_rad) {
      turning["turn_from_rad"] = *turn.timing.turn_from_rad;
      turning["turn_from_doubt_rad"] = turn.from_doubt_rad;
    }
    turning["stamp_at"] = PlaceName(report.fit.timing);
  }
  object["turn"] = std::move(turning);
  for (const Line& line : kLines)
    object[line.key] = {{"value", ValueOf(report, line.what)},
                        {"doubt", report.fit.mounting.Doubt(line.what)},
                        {"shown", report.fit.mounting.Shows(line.what)}};
  object["log_options"] = report.log_options;
  return JsonLine(object);
}

Result<std::string> ReportConfig(const LaserReport& report) {
  slam::PairingOptions pairing;
  // In whole milliseconds: a lag of next to nothing would take scans away from the odometry that has their very stamps.
  if (report.fit.mounting.Shows(kLag)) pairing.laser_lag_s = std::round(1e3 * report.fit.lag_s) / 1e3;
  pairing.wheels = report.fit.mounting.wheels;
  const OnlyShown::Doubts doubts = DoubtsOfShown(report);
  const VisitOptions visit = [&](OptionVisitor& visitor) {
    visitor.Section("slam", "Learnt by cairn-calibrate laser.", [&] {
      visitor.Section("pairing", "", [&] {
        OnlyShown shown(visitor, doubts);
        slam::Visit(shown, pairing);
      });
    });
  };
  std::string yaml = PrintYaml(visit);
  // Check that cairn-offline and cairnd would accept the file.
  if (const auto applied = ApplyYaml(yaml, "what was learnt", visit); !applied) return tl::unexpected(applied.error());
  std::string head = "# What programs that read the log need besides this file:\n#   ";
  return head + (report.log_options.empty() ? "nothing" : report.log_options) + '\n' + yaml;
}

}  // namespace cairn::server
