// Writes CARMEN logs (ODOM and FLASER / ROBOTLASER1 lines) that ReadLog reads back. FLASER where the scan is CARMEN's
// 180-degree layout with a SICK's range limit of 80 m, ROBOTLASER1 otherwise (layout and range limit are in the
// message). Stamps, poses, angles and hits come back exactly; a beam without a hit as one without a hit, an invalid one
// as 0. Tilted scans become TILTLASER1 lines, an extension (log_reader.h) that other readers of CARMEN logs skip.
// CARMEN has no place for beam times and range_min: they are lost. Validated scans only. Not thread-safe.
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

  std::ostream& out_;
  Stamp first_stamp_ = 0;
  bool has_first_ = false;
};

}  // namespace cairn
