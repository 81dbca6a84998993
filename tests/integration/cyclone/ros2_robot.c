/* A ROS 2 robot as rmw_cyclonedds puts it on the wire, without ROS: publishes a laser scan, odometry and tf_static of a
 * simulated robot in its namespace, and receives the pose, the transform from map to odom and the map that the server
 * publishes for it; at the end a second participant subscribes late to the map. Prints one line of JSON; exits 0 only
 * where everything came and the poses are right.
 *   ros2_robot DOMAIN NAMESPACE SITE SECONDS [WORD...]
 * NAMESPACE without a slash in front; "-" is the root. Words:
 *   jazzy       type hashes in the user data of endpoints (from Iron on), scans reliable, and a lidar that turns: its
 * rays are measured one after the other. Without it: as Humble, best effort, all rays at once. no-tf       no
 * tf_static: the server cannot know how the lidar is mounted. tf-odom     odometry as a transform on tf, not as a
 * topic. nonsense    scans, odometry and transforms that no robot sends, instead of good ones. only-scan   neither
 * odometry nor tf_static. The last four expect no pose, except tf-odom. CYCLONEDDS_URI chooses the network interface.
 */
#include <dds/dds.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "geometry_msgs.h"
#include "map_msgs.h"
#include "nav_msgs.h"
#include "sensor_msgs.h"
#include "tests/integration/cyclone/ros2_room.h"
#include "tf2_msgs.h"

enum { kBeams = 360, kBatch = 16, kOdometryMs = 20, kScansEvery = 3 };
static const double kPi = 3.14159265358979323846;
static const double kLaserX = 0.2; /* In base_link. */

typedef sensor_msgs_msg_dds__LaserScan_ LaserScan;
typedef nav_msgs_msg_dds__Odometry_ Odometry;
typedef nav_msgs_msg_dds__OccupancyGrid_ OccupancyGrid;
typedef map_msgs_msg_dds__OccupancyGridUpdate_ OccupancyGridUpdate;
typedef tf2_msgs_msg_dds__TFMessage_ TFMessage;
typedef geometry_msgs_msg_dds__TransformStamped_ TransformStamped;
typedef geometry_msgs_msg_dds__PoseWithCovarianceStamped_ PoseStamped;

struct Options {
  bool jazzy, no_tf, tf_odom, nonsense, only_scan;
};

struct Robot {
  struct Options options;
  dds_entity_t participant;
  dds_entity_t scan, odom, tf_out, tf_static;        /* Writers. */
  dds_entity_t pose, tf, map, updates, publications; /* Readers. */
  dds_time_t began;
  /* What came back. */
  int poses, transforms, maps, update_count, early_updates, occupied_cells, hashes;
  bool has_first;
  struct RoomPose first_estimate, first_truth;
  double worst_m, worst_rad;
  uint32_t width, height;
};

static void Die(const char* what) {
  printf("{\"error\":\"%s\"}\n", what);
  exit(1);
}

/* The QoS of ROS 2: keep last; from Iron on with the type's hash. */
static dds_qos_t* MakeQos(const struct Robot* robot, bool reliable, bool transient_local, int depth, const char* hash) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, DDS_INFINITY);
  dds_qset_durability(qos, transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
  if (transient_local)
    dds_qset_durability_service(qos, 0, DDS_HISTORY_KEEP_LAST, depth, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED);
  if (robot->options.jazzy) {
    char data[128];
    snprintf(data, sizeof(data), "typehash=RIHS01_%s;", hash);
    dds_qset_userdata(qos, data, strlen(data));
  }
  return qos;
}

static dds_entity_t Topic(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* name) {
  const dds_entity_t topic = dds_create_topic(participant, type, name, NULL, NULL);
  if (topic < 0) Die("a topic");
  return topic;
}

static dds_entity_t Writer(const struct Robot* robot, const dds_topic_descriptor_t* type, const char* name,
                           dds_qos_t* qos) {
  const dds_entity_t writer = dds_create_writer(robot->participant, Topic(robot->participant, type, name), qos, NULL);
  dds_delete_qos(qos);
  if (writer < 0) Die("a writer");
  return writer;
}

static dds_entity_t Reader(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* name,
                           dds_qos_t* qos) {
  const dds_entity_t reader = dds_create_reader(participant, Topic(participant, type, name), qos, NULL);
  dds_delete_qos(qos);
  if (reader < 0) Die("a reader");
  return reader;
}

static const char kScanHash[] = "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828";
static const char kOdomHash[] = "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0";
static const char kTfHash[] = "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
static const char kPoseHash[] = "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e";
static const char kMapHash[] = "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7";
static const char kUpdateHash[] = "c4095b0be2e4363f8978a1570e0293ee093436f1e1c61d99b48502ac317025e8";

static void Join(struct Robot* robot, dds_domainid_t domain, const char* name_space, const char* site) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_userdata(qos, "enclave=/;", strlen("enclave=/;"));
  robot->participant = dds_create_participant(domain, qos, NULL);
  dds_delete_qos(qos);
  if (robot->participant < 0) Die("the domain cannot be joined");
  char prefix[128], name[256];
  if (strcmp(name_space, "-") == 0) {
    snprintf(prefix, sizeof(prefix), "rt");
  } else {
    snprintf(prefix, sizeof(prefix), "rt/%s", name_space);
  }
  const struct Options* options = &robot->options;
  snprintf(name, sizeof(name), "%s/scan", prefix);
  robot->scan =
      Writer(robot, &sensor_msgs_msg_dds__LaserScan__desc, name, MakeQos(robot, options->jazzy, false, 5, kScanHash));
  snprintf(name, sizeof(name), "%s/odom", prefix);
  if (!options->tf_odom && !options->only_scan)
    robot->odom = Writer(robot, &nav_msgs_msg_dds__Odometry__desc, name, MakeQos(robot, true, false, 10, kOdomHash));
  snprintf(name, sizeof(name), "%s/tf_static", prefix);
  if (!options->no_tf && !options->only_scan)
    robot->tf_static = Writer(robot, &tf2_msgs_msg_dds__TFMessage__desc, name, MakeQos(robot, true, true, 1, kTfHash));
  snprintf(name, sizeof(name), "%s/tf", prefix);
  robot->tf =
      Reader(robot->participant, &tf2_msgs_msg_dds__TFMessage__desc, name, MakeQos(robot, true, false, 100, kTfHash));
  if (options->tf_odom)
    robot->tf_out = Writer(robot, &tf2_msgs_msg_dds__TFMessage__desc, name, MakeQos(robot, true, false, 100, kTfHash));
  snprintf(name, sizeof(name), "%s/cairn/pose", prefix);
  robot->pose = Reader(robot->participant, &geometry_msgs_msg_dds__PoseWithCovarianceStamped__desc, name,
                       MakeQos(robot, true, false, 10, kPoseHash));
  snprintf(name, sizeof(name), "rt/%s/map", site);
  robot->map =
      Reader(robot->participant, &nav_msgs_msg_dds__OccupancyGrid__desc, name, MakeQos(robot, true, true, 1, kMapHash));
  snprintf(name, sizeof(name), "rt/%s/map_updates", site);
  robot->updates = Reader(robot->participant, &map_msgs_msg_dds__OccupancyGridUpdate__desc, name,
                          MakeQos(robot, true, false, 10, kUpdateHash));
  robot->publications = dds_create_reader(robot->participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, NULL, NULL);
}

static builtin_interfaces_msg_dds__Time_ Stamp(dds_time_t time) {
  const builtin_interfaces_msg_dds__Time_ stamp = {(int32_t)(time / DDS_NSECS_IN_SEC),
                                                   (uint32_t)(time % DDS_NSECS_IN_SEC)};
  return stamp;
}

static double Seconds(const struct Robot* robot, dds_time_t time) {
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
static void PublishStatic(struct Robot* robot) {
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

static void PublishOdometry(struct Robot* robot, dds_time_t time) {
  const struct RoomPose pose = OdometryAt(Seconds(robot, time));
  if (robot->tf_out > 0) {
    TransformStamped transform = MakeTransform(time, "odom", "base_footprint", pose);
    TFMessage message;
    memset(&message, 0, sizeof(message));
    message.transforms._length = message.transforms._maximum = 1;
    message.transforms._buffer = &transform;
    if (dds_write(robot->tf_out, &message) < 0) Die("tf was not written");
    return;
  }
  if (robot->odom <= 0) return;
  Odometry odometry;
  memset(&odometry, 0, sizeof(odometry));
  odometry.header.stamp = Stamp(time);
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

/* The scan that ends at `time`. */
static void PublishScan(struct Robot* robot, dds_time_t time) {
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

/* Takes what has arrived on a reader, sample by sample. */
#define TAKE_ALL(reader, Type, sample, body)                            \
  for (;;) {                                                            \
    void* samples[kBatch] = {NULL};                                     \
    dds_sample_info_t infos[kBatch];                                    \
    const int count = dds_take(reader, samples, infos, kBatch, kBatch); \
    if (count <= 0) break;                                              \
    for (int i = 0; i < count; ++i) {                                   \
      const Type* sample = (const Type*)samples[i];                     \
      if (infos[i].valid_data) body                                     \
    }                                                                   \
    dds_return_loan(reader, samples, count);                            \
  }

static double Yaw(geometry_msgs_msg_dds__Quaternion_ turn) {
  return 2 * atan2(turn.z, turn.w);
}

/* Compares a pose with the truth, both relative to the first pose: the map begins where the robot was then. */
static void CheckPose(struct Robot* robot, const PoseStamped* pose) {
  const dds_time_t stamp = (dds_time_t)pose->header.stamp.sec * DDS_NSECS_IN_SEC + pose->header.stamp.nanosec;
  const struct RoomPose truth = TruthAt(Seconds(robot, stamp));
  const struct RoomPose estimate = {pose->pose.pose.position.x, pose->pose.pose.position.y,
                                    Yaw(pose->pose.pose.orientation)};
  if (strcmp(pose->header.frame_id, "map") != 0) Die("the frame of a pose is not map");
  ++robot->poses;
  /* At its start the robot is where it is by definition. */
  if (robot->poses > 20 && (!(pose->pose.covariance[0] > 0) || !(pose->pose.covariance[35] > 0)))
    Die("a pose without covariance");
  if (!robot->has_first) {
    robot->has_first = true;
    robot->first_estimate = estimate;
    robot->first_truth = truth;
  }
  const struct RoomPose error =
      RelativePose(RelativePose(robot->first_truth, truth), RelativePose(robot->first_estimate, estimate));
  robot->worst_m = fmax(robot->worst_m, hypot(error.x, error.y));
  robot->worst_rad = fmax(robot->worst_rad, fabs(error.theta));
}

static void TakeMaps(struct Robot* robot) {
  TAKE_ALL(robot->map, OccupancyGrid, map, {
    if (map->data._length != map->info.width * map->info.height) Die("a map of another size than it says");
    ++robot->maps;
    robot->width = map->info.width;
    robot->height = map->info.height;
    robot->occupied_cells = 0;
    for (uint32_t k = 0; k < map->data._length; ++k) robot->occupied_cells += map->data._buffer[k] > 65;
  })
}

static bool Fits(const struct Robot* robot, const OccupancyGridUpdate* update) {
  return update->x >= 0 && update->y >= 0 && update->x + update->width <= robot->width &&
         update->y + update->height <= robot->height;
}

static void TakeAll(struct Robot* robot) {
  TAKE_ALL(robot->pose, PoseStamped, pose, { CheckPose(robot, pose); })
  TAKE_ALL(robot->tf, TFMessage, message, {
    for (uint32_t k = 0; k < message->transforms._length; ++k) {
      const TransformStamped* one = &message->transforms._buffer[k];
      if (strcmp(one->header.frame_id, "map") != 0) continue;
      if (strcmp(one->child_frame_id, "odom") != 0) Die("map is connected with another frame than odom");
      ++robot->transforms;
    }
  })
  TakeMaps(robot);
  TAKE_ALL(robot->updates, OccupancyGridUpdate, update, {
    if (update->data._length != update->width * update->height) Die("an update of another size than it says");
    /* Its map may have come meanwhile, or be under way on its own topic. Nav2 leaves the update out then. */
    if (!Fits(robot, update)) TakeMaps(robot);
    if (!Fits(robot, update)) ++robot->early_updates;
    ++robot->update_count;
  })
  /* The endpoints of the server have the user data of Iron and later. */
  TAKE_ALL(robot->publications, dds_builtintopic_endpoint_t, endpoint, {
    void* data = NULL;
    size_t size = 0;
    if (strstr(endpoint->topic_name, "/map") == NULL || !dds_qget_userdata(endpoint->qos, &data, &size)) continue;
    if (data != NULL && strstr((const char*)data, kMapHash) != NULL) ++robot->hashes;
    dds_free(data);
  })
}

/* A program that begins to listen when the map has long been published, as a costmap of Nav2 does. */
static bool LateMap(struct Robot* robot, dds_domainid_t domain, const char* site) {
  char name[256];
  snprintf(name, sizeof(name), "rt/%s/map", site);
  const dds_entity_t participant = dds_create_participant(domain, NULL, NULL);
  const dds_entity_t reader =
      Reader(participant, &nav_msgs_msg_dds__OccupancyGrid__desc, name, MakeQos(robot, true, true, 1, kMapHash));
  int maps = 0;
  for (const dds_time_t end = dds_time() + DDS_SECS(10); maps == 0 && dds_time() < end; dds_sleepfor(DDS_MSECS(5)))
    TAKE_ALL(reader, OccupancyGrid, map, { maps += map->data._length > 0; })
  dds_delete(participant);
  return maps > 0;
}

static bool Has(int argc, char** argv, const char* word) {
  for (int i = 5; i < argc; ++i)
    if (strcmp(argv[i], word) == 0) return true;
  return false;
}

int main(int argc, char** argv) {
  if (argc < 5) {
    fprintf(stderr, "usage: %s DOMAIN NAMESPACE SITE SECONDS [WORD...]\n", argv[0]);
    return 2;
  }
  const dds_domainid_t domain = (dds_domainid_t)atoi(argv[1]);
  const double seconds = atof(argv[4]);
  struct Robot robot;
  memset(&robot, 0, sizeof(robot));
  robot.options.jazzy = Has(argc, argv, "jazzy");
  robot.options.no_tf = Has(argc, argv, "no-tf");
  robot.options.tf_odom = Has(argc, argv, "tf-odom");
  robot.options.nonsense = Has(argc, argv, "nonsense");
  robot.options.only_scan = Has(argc, argv, "only-scan");
  Join(&robot, domain, argv[2], argv[3]);
  robot.began = dds_time();
  PublishStatic(&robot);
  dds_time_t next = robot.began;
  for (int step = 0; Seconds(&robot, next) < seconds; ++step) {
    while (dds_time() < next) {
      TakeAll(&robot);
      dds_sleepfor(DDS_MSECS(1));
    }
    PublishOdometry(&robot, next);
    if (step > 0 && step % kScansEvery == 0) PublishScan(&robot, next);
    next += DDS_MSECS(kOdometryMs);
  }
  /* The last map may be under way. */
  const bool silent = robot.options.no_tf || robot.options.nonsense || robot.options.only_scan;
  const dds_time_t end = dds_time() + DDS_SECS(10);
  for (; !silent && (robot.maps == 0 || robot.hashes == 0) && dds_time() < end; dds_sleepfor(DDS_MSECS(5)))
    TakeAll(&robot);
  const bool late = !silent && LateMap(&robot, domain, argv[3]);
  const bool ok = silent ? robot.poses == 0 && robot.transforms == 0
                         : robot.poses > 5 * seconds && robot.transforms > 5 * seconds && robot.maps > 0 && late &&
                               robot.occupied_cells > 100 && robot.hashes > 0 && robot.worst_m < 0.08 &&
                               robot.worst_rad < 0.03 && robot.early_updates <= robot.maps;
  printf(
      "{\"ok\":%s,\"poses\":%d,\"transforms\":%d,\"maps\":%d,\"updates\":%d,\"late_map\":%s,\"occupied\":%d,"
      "\"hashes\":%d,\"worst_m\":%.3f,\"worst_rad\":%.4f}\n",
      ok ? "true" : "false", robot.poses, robot.transforms, robot.maps, robot.update_count, late ? "true" : "false",
      robot.occupied_cells, robot.hashes, robot.worst_m, robot.worst_rad);
  dds_delete(robot.participant);
  return ok ? 0 : 1;
}
