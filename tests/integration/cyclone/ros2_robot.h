/* What the robot of ros2_robot.c is and what it publishes. */
#pragma once

#include <dds/dds.h>
#include <stdbool.h>

#include "tests/integration/cyclone/ros2_endpoints.h"
#include "tests/integration/cyclone/ros2_room.h"

enum { kOdometryMs = 20, kScansEvery = 3 };

/* Words of the command line. */
struct Options {
  bool jazzy, no_tf, tf_odom, nonsense, only_scan, volatile_tf, late_odom, shared_tf, other_slam, hint;
};

struct Robot {
  struct Options options;
  dds_entity_t participant;
  dds_entity_t scan, odom, tf_static;                /* Writers, 0 where there is none. */
  dds_entity_t tf_out, start, other_tf;              /* The same. */
  dds_entity_t pose, tf, map, updates, publications; /* Readers. */
  dds_time_t began;
  /* What came back. */
  int poses, transforms, maps, update_count, early_updates, occupied_cells, hashes;
  bool has_first;
  struct RoomPose first_estimate, first_truth;
  double worst_m, worst_rad;
  uint32_t width, height;
};

/* Of the types that are published and received. */
extern const char kTfHash[], kPoseHash[], kMapHash[];

struct RosQos Qos(const struct Robot* robot, bool reliable, bool transient_local, int depth, const char* hash);
/* Since it began to drive. */
double Seconds(const struct Robot* robot, dds_time_t time);

/* `prefix` as the names of its topics begin, `site` as those of its site. */
void MakeWriters(struct Robot* robot, const char* prefix, const char* site);
void PublishStatic(const struct Robot* robot);
void PublishOdometry(const struct Robot* robot, dds_time_t time);
/* The scan that ends at `time`. */
void PublishScan(const struct Robot* robot, dds_time_t time);
/* Where it is. False: nobody listens yet. */
bool PublishStart(const struct Robot* robot, dds_time_t time);
