/* A ROS 2 robot as rmw_cyclonedds puts it on the wire, without ROS: publishes a laser scan, odometry and tf_static of a
 * simulated robot in its namespace, and receives the pose, the transform from map to odom and the map that the server
 * publishes for it; at the end a second participant subscribes late to the map. Prints one line of JSON; exits 0 only
 * where everything came and the poses are right.
 *   ros2_robot DOMAIN NAMESPACE SITE SECONDS [WORD...]
 * NAMESPACE without a slash in front; "-" is the root. Words:
 *   jazzy        type hashes in the user data of endpoints (from Iron on), scans reliable, and a lidar that turns: its
 *                rays are measured one after the other. Without it: as Humble, best effort, all rays at once.
 *   no-tf        no tf_static: the server cannot know how the lidar is mounted.
 *   tf-odom      odometry as a transform on tf, not as a topic.
 *   nonsense     scans, odometry and transforms that no robot sends, instead of good ones.
 *   only-scan    neither odometry nor tf_static.
 *   volatile-tf  tf_static whose durability is volatile: who comes later does not get it.
 *   late-odom    odometry whose stamps are 5 s behind those of the scans.
 *   shared-tf    odometry also as a transform on /tf, under names that other robots have as well.
 *   other-slam   publishes map to odom and announces a map of the site, as slam_toolbox does.
 *   hint         publishes where it is, as RViz does, whenever it gets the signal SIGUSR1.
 * With no-tf, nonsense, only-scan, volatile-tf and late-odom it expects no pose. CYCLONEDDS_URI chooses the network
 * interface.
 */
#include "tests/integration/cyclone/ros2_robot.h"

#include <dds/dds.h>
#include <math.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "geometry_msgs.h"
#include "map_msgs.h"
#include "nav_msgs.h"
#include "tf2_msgs.h"

enum { kBatch = 16 };

typedef nav_msgs_msg_dds__OccupancyGrid_ OccupancyGrid;
typedef map_msgs_msg_dds__OccupancyGridUpdate_ OccupancyGridUpdate;
typedef tf2_msgs_msg_dds__TFMessage_ TFMessage;
typedef geometry_msgs_msg_dds__TransformStamped_ TransformStamped;
typedef geometry_msgs_msg_dds__PoseWithCovarianceStamped_ PoseStamped;

static const char kUpdateHash[] = "c4095b0be2e4363f8978a1570e0293ee093436f1e1c61d99b48502ac317025e8";

static volatile sig_atomic_t asked_where = 0;

static void OnSignal(int signal_number) {
  (void)signal_number;
  asked_where = 1;
}

static void MakeReaders(struct Robot* robot, const char* prefix, const char* site) {
  const dds_entity_t own = robot->participant;
  robot->tf = RosReader(own, &tf2_msgs_msg_dds__TFMessage__desc, prefix, "tf", Qos(robot, true, false, 100, kTfHash));
  robot->pose = RosReader(own, &geometry_msgs_msg_dds__PoseWithCovarianceStamped__desc, prefix, "cairn/pose",
                          Qos(robot, true, false, 10, kPoseHash));
  robot->map = RosReader(own, &nav_msgs_msg_dds__OccupancyGrid__desc, site, "map", Qos(robot, true, true, 1, kMapHash));
  robot->updates = RosReader(own, &map_msgs_msg_dds__OccupancyGridUpdate__desc, site, "map_updates",
                             Qos(robot, true, false, 10, kUpdateHash));
  robot->publications = dds_create_reader(own, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, NULL, NULL);
}

static void Join(struct Robot* robot, dds_domainid_t domain, const char* name_space, const char* site) {
  robot->participant = RosParticipant(domain);
  char prefix[128], of_site[128];
  if (strcmp(name_space, "-") == 0) {
    snprintf(prefix, sizeof(prefix), "rt");
  } else {
    snprintf(prefix, sizeof(prefix), "rt/%s", name_space);
  }
  snprintf(of_site, sizeof(of_site), "rt/%s", site);
  MakeWriters(robot, prefix, of_site);
  MakeReaders(robot, prefix, of_site);
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
  char of_site[128];
  snprintf(of_site, sizeof(of_site), "rt/%s", site);
  const dds_entity_t participant = RosParticipant(domain);
  const dds_entity_t reader = RosReader(participant, &nav_msgs_msg_dds__OccupancyGrid__desc, of_site, "map",
                                        Qos(robot, true, true, 1, kMapHash));
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

static struct Options OptionsOf(int argc, char** argv) {
  const struct Options options = {.jazzy = Has(argc, argv, "jazzy"),
                                  .no_tf = Has(argc, argv, "no-tf"),
                                  .tf_odom = Has(argc, argv, "tf-odom"),
                                  .nonsense = Has(argc, argv, "nonsense"),
                                  .only_scan = Has(argc, argv, "only-scan"),
                                  .volatile_tf = Has(argc, argv, "volatile-tf"),
                                  .late_odom = Has(argc, argv, "late-odom"),
                                  .shared_tf = Has(argc, argv, "shared-tf"),
                                  .other_slam = Has(argc, argv, "other-slam"),
                                  .hint = Has(argc, argv, "hint")};
  return options;
}

static bool IsGood(const struct Robot* robot, double seconds, bool late) {
  return robot->poses > 5 * seconds && robot->transforms > 5 * seconds && robot->maps > 0 && late &&
         robot->occupied_cells > 100 && robot->hashes > 0 && robot->worst_m < 0.08 && robot->worst_rad < 0.03 &&
         robot->early_updates <= robot->maps;
}

int main(int argc, char** argv) {
  if (argc < 5) {
    fprintf(stderr, "usage: %s DOMAIN NAMESPACE SITE SECONDS [WORD...]\n", argv[0]);
    return 2;
  }
  const dds_domainid_t domain = (dds_domainid_t)atoi(argv[1]);
  const double seconds = atof(argv[4]);
  signal(SIGUSR1, OnSignal);
  struct Robot robot;
  memset(&robot, 0, sizeof(robot));
  robot.options = OptionsOf(argc, argv);
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
    if (asked_where && PublishStart(&robot, next)) asked_where = 0;
    if (step > 0 && step % kScansEvery == 0) PublishScan(&robot, next);
    next += DDS_MSECS(kOdometryMs);
  }
  /* The last map may be under way. */
  const struct Options* options = &robot.options;
  const bool silent =
      options->no_tf || options->nonsense || options->only_scan || options->volatile_tf || options->late_odom;
  const dds_time_t end = dds_time() + DDS_SECS(10);
  for (; !silent && (robot.maps == 0 || robot.hashes == 0) && dds_time() < end; dds_sleepfor(DDS_MSECS(5)))
    TakeAll(&robot);
  const bool late = !silent && LateMap(&robot, domain, argv[3]);
  const bool ok = silent ? robot.poses == 0 && robot.transforms == 0 : IsGood(&robot, seconds, late);
  printf(
      "{\"ok\":%s,\"poses\":%d,\"transforms\":%d,\"maps\":%d,\"updates\":%d,\"late_map\":%s,\"occupied\":%d,"
      "\"hashes\":%d,\"worst_m\":%.3f,\"worst_rad\":%.4f}\n",
      ok ? "true" : "false", robot.poses, robot.transforms, robot.maps, robot.update_count, late ? "true" : "false",
      robot.occupied_cells, robot.hashes, robot.worst_m, robot.worst_rad);
  dds_delete(robot.participant);
  return ok ? 0 : 1;
}
