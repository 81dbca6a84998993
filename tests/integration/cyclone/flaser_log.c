#include "tests/integration/cyclone/flaser_log.h"

#include <stdlib.h>
#include <string.h>

/* Reads a number and moves on; a broken line yields zeros and is refused by the count of beams or by the server. */
static double Next(char** at) {
  return strtod(*at, at);
}

static struct FlaserPose NextPose(char** at) {
  struct FlaserPose pose;
  pose.x = Next(at);
  pose.y = Next(at);
  pose.theta = Next(at);
  return pose;
}

int ReadFlaser(FILE* log, struct FlaserScan* scan) {
  char* line = NULL;
  size_t capacity = 0;
  int found = 0;
  while (!found && getline(&line, &capacity, log) > 0) {
    if (strncmp(line, "FLASER ", 7) != 0) continue;
    char* at = line + 7;
    scan->beams = (int)strtol(at, &at, 10);
    if (scan->beams < 2 || scan->beams > kMaxFlaserBeams) continue;
    for (int i = 0; i < scan->beams; ++i) scan->ranges_m[i] = (float)Next(&at);
    scan->T_odom_laser = NextPose(&at);
    scan->T_odom_robot = NextPose(&at);
    scan->stamp_ns = (int64_t)(Next(&at) * 1e9 + 0.5);
    found = 1;
  }
  free(line);
  return found;
}
