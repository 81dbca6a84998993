#include <math.h>
#include <string.h>

#include "geometry_msgs.h"
#include "nav_msgs.h"
#include "sensor_msgs.h"
#include "tests/integration/cyclone/ros2_robot.h"
#include "tf2_msgs.h"

enum { kBeams = 360 };
static const double kPi = 3.14159265358979323846;
static const double kLaserX = 0.2; /* In base_link. */

typedef sensor_msgs_msg_dds__LaserScan_ LaserScan;
typedef nav_msgs_msg_dds__Odometry_ Odometry;
typedef tf2_msgs_msg_dds__TFMessage_ TFMessage;
typedef geometry_msgs_msg_dds__TransformStamped_ TransformStamped;
typedef geometry_msgs_msg_dds__PoseWithCovarianceStamped_ PoseStamped;

static const char kScanHash[] = "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828";
static const char kOdomHash[] = "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0";
const char kTfHash[] = "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
const char kPoseHash[] = "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e";
const char kMapHash[] = "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7";

struct RosQos Qos(const struct Robot* robot, bool reliable, bool transient_local, int depth, const char* hash) {
  const struct RosQos qos = {reliable, transient_local, depth, robot->options.jazzy ? hash : NULL};
  return qos;
}

void MakeWriters(struct Robot* robot, const char* prefix, const char* site) {
  const struct Options* options = &robot->options;
  const dds_entity_t own = robot->participant;
  const dds_topic_descriptor_t* transforms = &tf2_msgs_msg_dds__TFMessage__desc;
  robot->scan = RosWriter(own, &sensor_msgs_msg_dds__LaserScan__desc, prefix, "scan",
                          Qos(robot, options->jazzy, false, 5, kScanHash));
  if (!options->tf_odom && !options->only_scan)
    robot->odom =
        RosWriter(own, &nav_msgs_msg_dds__Odometry__desc, prefix, "odom", Qos(robot, true, false, 10, kOdomHash));
  if (!options->no_tf && !options->only_scan)
    robot->tf_static =
        RosWriter(own, transforms, prefix, "tf_static", Qos(robot, true, !options->volatile_tf, 1, kTfHash));
  if (options->tf_odom || options->shared_tf)
    robot->tf_out =
        RosWriter(own, transforms, options->shared_tf ? "rt" : prefix, "tf", Qos(robot, true, false, 100, kTfHash));
  if (options->hint)
    robot->start = RosWriter(own, &geometry_msgs_msg_dds__PoseWithCovarianceStamped__desc, prefix, "initialpose",
                             Qos(robot, true, false, 1, kPoseHash));
  if (!options->other_slam) return;
  robot->other_tf = RosWriter(own, transforms, prefix, "tf", Qos(robot, true, false, 100, kTfHash));
  RosWriter(own, &nav_msgs_msg_dds__OccupancyGrid__desc, site, "map", Qos(robot, true, true, 1, kMapHash));
}

static builtin_interfaces_msg_dds__Time_ Stamp(dds_time_t time) {
  const builtin_interfaces_msg_dds__Time_ stamp = {(int32_t)(time / DDS_NSECS_IN_SEC),
                                                   (uint32_t)(time % DDS_NSECS_IN_SEC)};
  return stamp;
}

double Seconds(const struct Robot* robot, dds_time_t time) {
  return (double)(time - robot->began) * 1e-9;
}

static TransformStamped MakeTransform(dds_time_t time, const char* parent, const char* child, struct RoomPose pose) {
  TransformStamped transform;
  memset(&transform, 0, sizeof(transform));
  transform.header.stamp = Stamp(time);
  transform.header.frame_id = (char*)parent;
  transform.child_frame_id = (char*)child;
  transform.transform.translation.x = pose.x;
  transform.transform.translation.y = pose.y;
  transform.transform.rotation.z = sin(pose.theta / 2);
  transform.transform.rotation.w = cos(pose.theta / 2);
  return transform;
}

/* base_footprint is the frame of odometry, base_link above it, the lidar on that. */
void PublishStatic(const struct Robot* robot) {
  const struct RoomPose zero = {0, 0, 0}, laser = {kLaserX, 0, 0};
  TransformStamped transforms[2] = {MakeTransform(0, "base_footprint", "base_link", zero),
                                    MakeTransform(0, "base_link", "laser_frame", laser)};
  transforms[0].transform.translation.z = 0.05;
  TFMessage message;
  memset(&message, 0, sizeof(message));
  message.transforms._length = message.transforms._maximum = 2;
  message.transforms._buffer = transforms;
  if (robot->options.nonsense) transforms[1].transform.rotation.w = 7;
  if (robot->tf_static > 0 && dds_write(robot->tf_static, &message) < 0) Die("tf_static was not written");
}

/* Odometry that drifts a little: it turns 1 % less than the robot. */
static struct RoomPose OdometryAt(double seconds) {
  struct RoomPose pose = RelativePose(TruthAt(0), TruthAt(seconds));
  pose.theta *= 0.99;
  return pose;
}

static void PublishTransform(dds_entity_t writer, TransformStamped transform) {
  TFMessage message;
  memset(&message, 0, sizeof(message));
  message.transforms._length = message.transforms._maximum = 1;
  message.transforms._buffer = &transform;
  if (dds_write(writer, &message) < 0) Die("tf was not written");
}

void PublishOdometry(const struct Robot* robot, dds_time_t time) {
  const struct RoomPose pose = OdometryAt(Seconds(robot, time)), zero = {0, 0, 0};
  if (robot->tf_out > 0) PublishTransform(robot->tf_out, MakeTransform(time, "odom", "base_footprint", pose));
  if (robot->other_tf > 0) PublishTransform(robot->other_tf, MakeTransform(time, "map", "odom", zero));
  if (robot->odom <= 0) return;
  Odometry odometry;
  memset(&odometry, 0, sizeof(odometry));
  odometry.header.stamp = Stamp(time - (robot->options.late_odom ? DDS_SECS(5) : 0));
  odometry.header.frame_id = (char*)"odom";
  odometry.child_frame_id = (char*)"base_footprint";
  odometry.pose.pose.position.x = pose.x;
  odometry.pose.pose.position.y = pose.y;
  odometry.pose.pose.orientation.z = sin(pose.theta / 2);
  odometry.pose.pose.orientation.w = cos(pose.theta / 2);
  if (robot->options.nonsense) {
    odometry.header.stamp.nanosec = 4000000000U;
    odometry.pose.pose.orientation.w = NAN;
  }
  if (dds_write(robot->odom, &odometry) < 0) Die("odometry was not written");
}

/* The map begins where the robot was at its first pose, or about where it began to drive. */
bool PublishStart(const struct Robot* robot, dds_time_t time) {
  dds_publication_matched_status_t matched;
  if (robot->start <= 0 || dds_get_publication_matched_status(robot->start, &matched) < 0) return false;
  if (matched.current_count == 0) return false;
  const struct RoomPose zero = {0, 0, 0}, truth = TruthAt(Seconds(robot, time));
  const struct RoomPose first_truth = robot->has_first ? robot->first_truth : TruthAt(0);
  const struct RoomPose first = robot->has_first ? robot->first_estimate : zero;
  /* first * first_truth^-1 * truth. */
  const struct RoomPose pose = RelativePose(RelativePose(first, zero), RelativePose(first_truth, truth));
  PoseStamped start;
  memset(&start, 0, sizeof(start));
  start.header.stamp = Stamp(time);
  start.header.frame_id = (char*)"map";
  start.pose.pose.position.x = pose.x;
  start.pose.pose.position.y = pose.y;
  start.pose.pose.orientation.z = sin(pose.theta / 2);
  start.pose.pose.orientation.w = cos(pose.theta / 2);
  if (dds_write(robot->start, &start) < 0) Die("an initial pose was not written");
  return true;
}

void PublishScan(const struct Robot* robot, dds_time_t time) {
  static float ranges[40000];
  LaserScan scan;
  memset(&scan, 0, sizeof(scan));
  const double period = robot->options.jazzy ? 1e-3 * kOdometryMs * kScansEvery / kBeams : 0.0;
  const dds_time_t first = time - (dds_time_t)(period * (kBeams - 1) * 1e9);
  scan.header.stamp = Stamp(first);
  scan.header.frame_id = (char*)"laser_frame";
  scan.angle_min = (float)-kPi;
  scan.angle_increment = (float)(2 * kPi / kBeams);
  scan.angle_max = scan.angle_min + scan.angle_increment * (kBeams - 1);
  scan.time_increment = (float)period;
  scan.scan_time = (float)(1e-3 * kOdometryMs * kScansEvery);
  scan.range_min = 0.1F;
  scan.range_max = 12.0F;
  for (int i = 0; i < kBeams; ++i) {
    const struct RoomPose at = TruthAt(Seconds(robot, first) + period * i);
    const double x = at.x + cos(at.theta) * kLaserX, y = at.y + sin(at.theta) * kLaserX;
    ranges[i] = (float)RangeFrom(x, y, at.theta + scan.angle_min + scan.angle_increment * i);
  }
  ranges[17] = NAN; /* As drivers say it (REP 117). */
  ranges[18] = -INFINITY;
  ranges[19] = INFINITY;
  scan.ranges._length = scan.ranges._maximum = kBeams;
  if (robot->options.nonsense) {
    scan.ranges._length = scan.ranges._maximum = 40000;
    scan.angle_increment = NAN;
  }
  scan.ranges._buffer = ranges;
  if (dds_write(robot->scan, &scan) < 0) Die("a scan was not written");
}
