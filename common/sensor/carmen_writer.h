// Writes CARMEN logs (ODOM and FLASER / ROBOTLASER1 lines) that ReadLog reads back. FLASER where the scan is CARMEN's
// 180-degree layout with a SICK's range limit of 80 m, ROBOTLASER1 otherwise (layout and range limit are in the
// message). Stamps, poses, angles and hits come back exactly; a beam without a hit as one without a hit, an invalid one
// as 0. Tilted scans become TILTLASER1 lines, an extension (log_reader.h) that other readers of CARMEN logs skip.
// The time of a turn is a PARAM line before the scan (log_reader.h) where it changes. CARMEN has no place for
// range_min: it is lost. Validated scans only. Not thread-safe.
#pragma once

#include <ostream>
#include <string>

#include "common/sensor/log_record.h"

namespace cairn {

class CarmenWriter {
 public:
  explicit CarmenWriter(std::ostream& out);
  void Write(const Odometry& odometry);
  // `T_odom_robot` is the odometry at the scan's stamp: CARMEN laser messages carry it.
  void Write(const Scan& scan, const Pose2& T_odom_robot);

 private:
  void WriteTime(std::string& line, Stamp stamp);

  void WriteTiming(const Scan& scan);

  std::ostream& out_;
  Stamp first_stamp_ = 0;
  bool has_first_ = false;
  double scan_period_s_ = 0.0;  // As the last PARAM line says it.
};

}  // namespace cairn
