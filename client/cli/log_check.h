// Checks whether a robot log is fit for mapping, before anything is sent: counts, layout, stamps, rates, odometry, and
// what to do about each finding. It applies the rules that the server applies to scans (ValidateScan), and a few that
// need the whole log. Not an estimator. One thread at a time; memory does not grow with the log.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "client/cli/percentiles.h"
#include "client/cli/turn_check.h"
#include "common/sensor/log_record.h"

namespace cairn::client {

// Spacing and order of one stream's stamps.
struct StampSummary {
  std::uint64_t count = 0;
  std::uint64_t repeated = 0;
  std::uint64_t went_back = 0;
  std::uint64_t gaps = 0;  // Longer than 2 s and ten median periods.
  double duration_s = 0.0;
  double rate_hz = 0.0;  // From the median period.
  double period_p99_s = 0.0;
  double longest_gap_s = 0.0;
};

struct Finding {
  bool error = false;  // True: scans will be lost. False: a warning.
  std::string what;
  std::string advice;
};

struct LogReport {
  LogSummary summary;
  StampSummary scans;
  StampSummary odometry;
  std::map<std::size_t, std::uint64_t> beam_counts;  // Scans by their number of beams.
  double field_of_view_rad = 0.0;                    // As the first scan has it; so are the three values below.
  double angle_step_rad = 0.0;
  double range_max_m = 0.0;
  Pose2 T_robot_laser;
  double hit_share = 0.0;  // Shares of all beams.
  double no_return_share = 0.0;
  double invalid_share = 0.0;
  std::map<std::string, std::uint64_t> refused;  // Scans ValidateScan refuses, by its words.
  double way_m = 0.0;                            // Measured by the odometry, as the two values below.
  double turned_rad = 0.0;
  double fastest_m_s = 0.0;
  TurnFinding turns;
  bool beams_timed = false;  // The first scan says when its beams were measured.
  std::vector<Finding> findings;

  [[nodiscard]] bool has_errors() const;
};

class LogCheck {
 public:
  void Add(const LogRecord& record);
  [[nodiscard]] LogReport Finish(const LogSummary& summary);

 private:
  struct StampTrack {
    std::optional<Stamp> first, last;
    StampSummary summary;
    Percentiles periods_s;

    void Add(Stamp stamp);
    StampSummary Finish();
  };

  void AddScan(const Scan& scan);
  void AddOdometry(const Odometry& odometry);
  void CollectFindings();
  void CollectLidarFindings();

  LogReport report_;
  StampTrack scans_;
  StampTrack odometry_;
  TurnCheck turns_;
  std::optional<Odometry> last_odometry_;
  std::uint64_t jumps_ = 0;  // Odometry steps that are too fast for a robot.
  std::uint64_t bad_odometry_ = 0;
  std::uint64_t hits_ = 0, no_returns_ = 0, invalid_ = 0;
};

}  // namespace cairn::client
