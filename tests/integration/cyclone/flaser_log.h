/* Reads the FLASER lines of a CARMEN log. Metres, radians, nanoseconds. Lines of other kinds are skipped. */
#pragma once

#include <stdint.h>
#include <stdio.h>

enum { kMaxFlaserBeams = 1081 };

struct FlaserPose {
  double x, y, theta;
};

struct FlaserScan {
  int beams;
  float ranges_m[kMaxFlaserBeams];
  struct FlaserPose T_odom_laser;
  struct FlaserPose T_odom_robot;
  int64_t stamp_ns;
};

/* Returns 1 with the next scan, 0 at the end of the file. */
int ReadFlaser(FILE* log, struct FlaserScan* scan);
