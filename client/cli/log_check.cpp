#include "client/cli/log_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <variant>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/json_output.h"
#include "client/cli/option_checks.h"
#include "client/cli/text_output.h"
#include "common/bag/recording.h"
#include "common/sensor/log_options.h"

namespace cairn::client {
namespace {

struct CheckArguments {
  std::string log;
  LogReaderOptions reader;
};

// Each lidar by itself: two at a time have other rates and gaps.
ExitCode CheckLog(Program& program, const CheckArguments& arguments) {
  LogReaderOptions reader = arguments.reader;
  reader.all_lidars = true;
  const auto survey = ReadRecording(arguments.log, reader, [](LogRecord&&) { return false; });
  if (!survey) return program.Refuse(survey.error());
  const bool several = survey->lidars.size() > 1;
  std::vector<LogCheck> checks(std::max<std::size_t>(survey->lidars.size(), 1));
  const auto summary = ReadLidars(arguments.log, reader, [&](LogRecord&& record, std::size_t lidar) {
    const bool of_all = std::holds_alternative<Odometry>(record);
    for (std::size_t i = 0; i < checks.size(); ++i)
      if (of_all || i == lidar) checks[i].Add(record);
    return !Interrupted();
  });
  if (!summary) return program.Refuse(summary.error());
  bool good = true;
  for (std::size_t i = 0; i < checks.size(); ++i) {
    const LogReport report = checks[i].Finish(*summary);
    nlohmann::json object = report;
    if (several) object["scan_topic"] = summary->lidars[i];
    program.Print((several ? summary->lidars[i] + "\n" : std::string()) + FormatLogReport(report), object);
    good = good && !report.has_errors();
  }
  return good ? ExitCode::kOk : ExitCode::kFailed;
}

}  // namespace

void LogCheck::StampTrack::Add(Stamp stamp) {
  ++summary.count;
  if (!first) first = stamp;
  if (last) {
    const double period_s = SecondsFromStamp(stamp - *last);
    if (stamp == *last) {
      ++summary.repeated;
    } else if (stamp < *last) {
      ++summary.went_back;
    } else {
      periods_s.Add(period_s);
      summary.longest_gap_s = std::max(summary.longest_gap_s, period_s);
    }
  }
  last = stamp;
}

StampSummary LogCheck::StampTrack::Finish() {
  if (!last) return summary;
  summary.duration_s = SecondsFromStamp(*last - *first);
  const double median_s = periods_s.At(0.5);
  summary.rate_hz = median_s > 0.0 ? 1.0 / median_s : 0.0;
  summary.period_p99_s = periods_s.At(0.99);
  summary.gaps = periods_s.CountAbove(std::max(2.0, 10 * median_s));
  return summary;
}

bool LogReport::has_errors() const {
  return std::any_of(findings.begin(), findings.end(), [](const Finding& finding) { return finding.error; });
}

void LogCheck::Add(const LogRecord& record) {
  if (const auto* scan = std::get_if<Scan>(&record)) {
    AddScan(*scan);
  } else {
    AddOdometry(std::get<Odometry>(record));
  }
}

void LogCheck::AddScan(const Scan& scan) {
  if (scans_.summary.count == 0) {
    report_.angle_step_rad = scan.angle_step_rad;
    report_.field_of_view_rad =
        std::abs(scan.angle_step_rad) * std::max<double>(0.0, static_cast<double>(scan.ranges_m.size()) - 1);
    report_.range_max_m = scan.range_max_m;
    report_.T_robot_laser = scan.T_robot_laser;
    report_.beams_timed = scan.beam_period_s > 0.0;
  }
  turns_.Add(scan);
  scans_.Add(scan.stamp);
  ++report_.beam_counts[scan.ranges_m.size()];
  constexpr std::size_t kMostKinds =
      20;  // Further reasons are counted together, so that a broken log cannot fill the memory.
  if (const auto valid = ValidateScan(scan); !valid) {
    const bool known = report_.refused.count(valid.error().message) > 0 || report_.refused.size() < kMostKinds;
    ++report_.refused[known ? valid.error().message : "other reasons"];
  }
  for (const float range : scan.ranges_m) {
    switch (ClassifyRange(range, scan.range_min_m, scan.range_max_m)) {
      case BeamClass::kHit:
        ++hits_;
        break;
      case BeamClass::kNoReturn:
        ++no_returns_;
        break;
      case BeamClass::kInvalid:
        ++invalid_;
        break;
    }
  }
}

void LogCheck::AddOdometry(const Odometry& odometry) {
  odometry_.Add(odometry.stamp);
  turns_.Add(odometry);
  if (!ValidateOdometry(odometry)) {
    ++bad_odometry_;
    return;
  }
  if (last_odometry_ && odometry.stamp > last_odometry_->stamp) {
    constexpr double kImpossible_m_s = 5.0, kImpossibleStep_m = 1.0, kShortestStep_s = 0.02;
    const Pose2 step = Between(last_odometry_->T_odom_robot, odometry.T_odom_robot);
    const double way = step.translation().norm(), seconds = SecondsFromStamp(odometry.stamp - last_odometry_->stamp);
    // Over a time shorter than the clock's accuracy, a speed has no meaning.
    const double speed = seconds >= kShortestStep_s ? way / seconds : 0.0;
    if (way > kImpossibleStep_m && way / seconds > kImpossible_m_s) {
      ++jumps_;
    } else {
      report_.way_m += way;
      report_.turned_rad += std::abs(step.theta);
      report_.fastest_m_s = std::max(report_.fastest_m_s, speed);
    }
  }
  last_odometry_ = odometry;
}

LogReport LogCheck::Finish(const LogSummary& summary) {
  report_.summary = summary;
  report_.scans = scans_.Finish();
  report_.odometry = odometry_.Finish();
  if (const auto beams = static_cast<double>(hits_ + no_returns_ + invalid_); beams > 0) {
    report_.hit_share = static_cast<double>(hits_) / beams;
    report_.no_return_share = static_cast<double>(no_returns_) / beams;
    report_.invalid_share = static_cast<double>(invalid_) / beams;
  }
  report_.turns = turns_.Finish();
  CollectFindings();
  CollectLidarFindings();
  return report_;
}

void LogCheck::CollectFindings() {
  const auto error = [this](std::string what, std::string advice) {
    report_.findings.push_back({true, std::move(what), std::move(advice)});
  };
  const auto note = [this](std::string what, std::string advice) {
    report_.findings.push_back({false, std::move(what), std::move(advice)});
  };
  const auto& r = report_;
  if (r.scans.count == 0) error("no scan", "is this a CARMEN or DP-SLAM log?");
  if (r.odometry.count == 0 && r.scans.count > 0)
    note("no odometry",
         "the robot is followed by its scans alone, which drifts more; the way along bare corridors comes out too "
         "short");
  if (r.summary.complaint_count > 0)
    error(fmt::format("{} unreadable lines", r.summary.complaint_count),
          "they are skipped; see the list for line and reason");
  for (const auto& [why, count] : r.refused)
    error(fmt::format("{} scans would be refused: {}", count, why),
          "the server drops them as bad_geometry, empty or too_many_beams");
  if (r.scans.repeated > 0)
    error(fmt::format("{} scans repeat the stamp before", r.scans.repeated), "they are dropped as duplicate_stamp");
  if (r.scans.went_back > 0)
    error(fmt::format("{} scans are older than the scan before", r.scans.went_back),
          "they are dropped as stamp_went_back; sort the log by stamp");
  if (r.odometry.went_back > 0)
    error(fmt::format("{} odometry samples go back in time", r.odometry.went_back),
          "they are dropped; sort the log by stamp");
  if (bad_odometry_ > 0) error(fmt::format("{} odometry samples are not finite", bad_odometry_), "they are dropped");
  if (jumps_ > 0)
    note(fmt::format("{} odometry steps faster than 5 m/s", jumps_),
         "wheel slip, a carried robot, or a reset odometry");
  if (r.scans.gaps > 0)
    note(fmt::format("{} gaps in the scans, the longest {:.1f} s", r.scans.gaps, r.scans.longest_gap_s),
         "the robot must stand still, or odometry must carry it");
  if (r.beam_counts.size() > 1)
    note(fmt::format("{} different numbers of beams", r.beam_counts.size()), "allowed, but check for cut lines");
  if (r.invalid_share > 0.3)
    note(fmt::format("{:.0f} % of the beams say nothing", 100 * r.invalid_share), "check the range limits");
  if (r.scans.count > 0 && r.hit_share < 0.2)
    note(fmt::format("only {:.0f} % of the beams hit something", 100 * r.hit_share),
         "check the no-return value, or expect poor matching in the open");
  if (r.odometry.count > 1 && r.way_m < 0.1) note("the odometry hardly moves", "a standing robot maps one place only");
  if (r.odometry.rate_hz > 0 && r.scans.rate_hz > 0 && r.odometry.rate_hz < 0.5 * r.scans.rate_hz)
    note("odometry is sparser than scans", "poses between samples are interpolated");
}

// What scans and odometry together show of the lidar.
void LogCheck::CollectLidarFindings() {
  constexpr double kStands_rad = 1.0, kSure = 0.7, kClearly = 0.02, kWorthwhile_s = 0.05, kSlow_hz = 20.0,
                   kFullTurn_rad = 6.0;
  const auto& r = report_;
  const TurnFinding& turns = r.turns;
  if (turns.turned_while_standing_rad > kStands_rad)
    report_.findings.push_back(
        {true,
         fmt::format("the odometry does not move although the scans do (they turn by {:.0f} degrees while it stands)",
                     Degrees(turns.turned_while_standing_rad)),
         "the robot is then followed by its scans alone, which drifts more; mend the odometry"});
  const std::string measure = "`cairn-calibrate laser LOG` measures it and says what to do";
  if (turns.correlation < -kSure)
    report_.findings.push_back({false, "the scans turn against the odometry",
                                "the array of beams is turned over, the lidar hangs upside down, or the odometry "
                                "counts its turns the wrong way"});
  if (turns.correlation > kSure && turns.correlation > turns.correlation_at_once + kClearly &&
      std::abs(turns.lag_s) >= kWorthwhile_s)
    report_.findings.push_back(
        {false,
         fmt::format("the scans seem to be {:.2f} s {}{} than the odometry", std::abs(turns.lag_s),
                     std::abs(turns.lag_s) > TurnCheck::kWidest_s - 1e-3 ? "or more " : "",
                     turns.lag_s > 0.0 ? "later" : "earlier"),
         measure});
  const bool slow = r.scans.rate_hz > 0.0 && r.scans.rate_hz < kSlow_hz;
  // Without odometry nothing says that the robot does not turn.
  const bool may_turn = r.odometry.count == 0 || r.turned_rad > 1.0;
  if (!r.beams_timed && slow && r.field_of_view_rad > kFullTurn_rad && may_turn)
    report_.findings.push_back(
        {false,
         fmt::format("nothing says when the beams of a turn of up to {:.2f} s were measured", 1.0 / r.scans.rate_hz),
         "if the lidar turns, give --scan-period and the other options of lidars that turn; " +
             (r.odometry.count > 0 ? measure : "its data sheet says how long a turn takes")});
}

void AddCheckLog(CLI::App& app, Program& program) {
  auto* command = app.add_subcommand("check-log", "Say whether a robot log or bag is fit for mapping; needs no server");
  command->footer(
      "Reads CARMEN and DP-SLAM logs, bags of ROS 2 and recordings. Exit code 1 where scans would be lost, or the "
      "odometry is broken (each finding says why and what to do).\n"
      "EXAMPLES\n  cairn check-log intel.clf\n  cairn check-log run.log --json");
  auto arguments = std::make_shared<CheckArguments>();
  command->add_option("log", arguments->log, "The log file, or the bag")->required()->type_name("FILE");
  AddLogOptions(*command, arguments->reader);
  program.OnChosen(*command, arguments, CheckLog);
}

}  // namespace cairn::client
