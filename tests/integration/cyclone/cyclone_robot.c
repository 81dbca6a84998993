/* A robot and a client of Cairn on Eclipse Cyclone DDS, written from idl/README.md alone: opens a session, streams
 * scans of a CARMEN log within the window of 32 that the ledger opens, receives poses and tiles, asks for its pose and
 * for the tiles around it, ends the session. Prints one line of JSON; exits 0 only where everything came back.
 *   cyclone_robot DOMAIN LOG SITE ROBOT [SCANS [MIN_POSES]]
 * CYCLONEDDS_URI chooses the network interface. */
#include <dds/dds.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "odometry.h"
#include "query.h"
#include "scan.h"
#include "tests/integration/cyclone/flaser_log.h"

enum { kWindow = 32, kBatch = 16 };
static const double kPi = 3.14159265358979323846;
static const dds_duration_t kPatience = DDS_SECS(20); /* Of each step. */

struct Robot {
  dds_entity_t participant;
  dds_entity_t session, scan, odometry, request;                              /* Writers. */
  dds_entity_t session_state, refusal_reader, pose, ledger, map, tile, reply; /* Readers. */
  const char *site, *name;
  uint64_t robot_id, sensor_id, client, opened_session;
  bool started;
  /* What came back. */
  bool answered;
  cairn_v1_SessionPhase phase;
  char refusal[256];
  uint64_t settled_through;
  int poses, tiles, maps;
  cairn_v1_Pose2 T_map_robot;
  /* Of the request under way. */
  int64_t sequence;
  bool reply_last;
  int32_t reply_code;
  int reply_poses, reply_tiles;
};

/* FNV-1a, 64 bits. */
static uint64_t HashName(const char* name) {
  uint64_t hash = 14695981039346656037ULL;
  for (; *name != '\0'; ++name) hash = (hash ^ (unsigned char)*name) * 1099511628211ULL;
  return hash;
}

static void Die(const char* what) {
  printf("{\"error\":\"%s\"}\n", what);
  exit(1);
}

static dds_qos_t* MakeQos(bool transient_local, int depth) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
  return qos;
}

static dds_entity_t MakeTopic(const struct Robot* robot, const dds_topic_descriptor_t* type, const char* name) {
  const dds_entity_t topic = dds_create_topic(robot->participant, type, name, NULL, NULL);
  if (topic < 0) Die("a topic");
  return topic;
}

static dds_entity_t MakeWriter(const struct Robot* robot, const dds_topic_descriptor_t* type, const char* name,
                               dds_qos_t* qos) {
  const dds_entity_t writer = dds_create_writer(robot->participant, MakeTopic(robot, type, name), qos, NULL);
  dds_delete_qos(qos);
  if (writer < 0) Die("a writer");
  return writer;
}

static dds_entity_t MakeReader(const struct Robot* robot, const dds_topic_descriptor_t* type, const char* name,
                               dds_qos_t* qos) {
  const dds_entity_t reader = dds_create_reader(robot->participant, MakeTopic(robot, type, name), qos, NULL);
  dds_delete_qos(qos);
  if (reader < 0) Die("a reader");
  return reader;
}

/* Replies come in one of 16 partitions: the client id modulo 16. */
static dds_entity_t MakeReplyReader(const struct Robot* robot) {
  char partition[16];
  snprintf(partition, sizeof(partition), "reply.%u", (unsigned)(robot->client % 16));
  dds_qos_t* qos = dds_create_qos();
  dds_qset_partition1(qos, partition);
  const dds_entity_t subscriber = dds_create_subscriber(robot->participant, qos, NULL);
  dds_delete_qos(qos);
  if (subscriber < 0) Die("a subscriber");
  qos = MakeQos(false, 256);
  const dds_entity_t topic = MakeTopic(robot, &cairn_v1_Reply_desc, "cairn/v1/reply");
  const dds_entity_t reader = dds_create_reader(subscriber, topic, qos, NULL);
  dds_delete_qos(qos);
  if (reader < 0) Die("a reader");
  return reader;
}

static void Join(struct Robot* robot, dds_domainid_t domain) {
  robot->participant = dds_create_participant(domain, NULL, NULL);
  if (robot->participant < 0) Die("the domain cannot be joined");
  robot->session_state = MakeReader(robot, &cairn_v1_SessionState_desc, "cairn/v1/session_state", MakeQos(true, 16));
  robot->refusal_reader =
      MakeReader(robot, &cairn_v1_SessionRefusal_desc, "cairn/v1/session_refusal", MakeQos(false, 16));
  robot->pose = MakeReader(robot, &cairn_v1_PoseReport_desc, "cairn/v1/pose", MakeQos(false, 64));
  robot->ledger = MakeReader(robot, &cairn_v1_Ledger_desc, "cairn/v1/ledger", MakeQos(true, 1));
  robot->map = MakeReader(robot, &cairn_v1_MapInfo_desc, "cairn/v1/map", MakeQos(true, 1));
  robot->tile = MakeReader(robot, &cairn_v1_Tile_desc, "cairn/v1/tile", MakeQos(true, 1));
  robot->reply = MakeReplyReader(robot);
  robot->scan = MakeWriter(robot, &cairn_v1_Scan_desc, "cairn/v1/scan", MakeQos(false, 64));
  robot->odometry = MakeWriter(robot, &cairn_v1_Odometry_desc, "cairn/v1/odometry", MakeQos(false, 256));
  robot->request = MakeWriter(robot, &cairn_v1_Request_desc, "cairn/v1/request", MakeQos(false, 16));
  dds_qos_t* leased = MakeQos(true, 1);
  dds_qset_liveliness(leased, DDS_LIVELINESS_AUTOMATIC, DDS_SECS(1));
  robot->session = MakeWriter(robot, &cairn_v1_SessionRequest_desc, "cairn/v1/session", leased);
}

static void SendSession(struct Robot* robot, bool end) {
  char sensor[] = "laser";
  char* sensors[] = {sensor};
  cairn_v1_SessionRequest request;
  memset(&request, 0, sizeof(request));
  request.robot_id = robot->robot_id;
  request.client = robot->client;
  request.session = robot->opened_session;
  request.started = robot->started;
  request.robot = (char*)robot->name;
  request.site = (char*)robot->site;
  request.sensors._length = request.sensors._maximum = 1;
  request.sensors._buffer = sensors;
  request.end = end;
  if (dds_write(robot->session, &request) < 0) Die("the session was not written");
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

static void TakeReplies(struct Robot* robot) {
  TAKE_ALL(robot->reply, cairn_v1_Reply, reply, {
    if (reply->client != robot->client || reply->seq != robot->sequence) continue;
    robot->reply_poses += (int)reply->poses._length;
    robot->reply_tiles += (int)reply->tiles._length;
    if (reply->last) {
      robot->reply_last = true;
      robot->reply_code = reply->status.code;
    }
  })
}

static void TakeAll(struct Robot* robot) {
  TAKE_ALL(robot->session_state, cairn_v1_SessionState, state, {
    if (state->robot_id != robot->robot_id || state->session != robot->opened_session) continue;
    robot->answered = true;
    robot->phase = state->phase;
  })
  TAKE_ALL(robot->refusal_reader, cairn_v1_SessionRefusal, refusal, {
    if (refusal->state.client != robot->client || refusal->state.session != robot->opened_session) continue;
    robot->answered = true;
    robot->phase = refusal->state.phase;
    snprintf(robot->refusal, sizeof(robot->refusal), "%s", refusal->state.status.message);
  })
  TAKE_ALL(robot->ledger, cairn_v1_Ledger, ledger, {
    if (ledger->robot_id == robot->robot_id && ledger->sensor_id == robot->sensor_id &&
        ledger->session == robot->opened_session) {
      robot->settled_through = ledger->settled_through;
    }
  })
  TAKE_ALL(robot->pose, cairn_v1_PoseReport, pose, {
    if (pose->robot_id != robot->robot_id) continue;
    ++robot->poses;
    robot->T_map_robot = pose->T_map_robot;
  })
  TAKE_ALL(robot->map, cairn_v1_MapInfo, map, {
    if (map->site_id == HashName(robot->site)) ++robot->maps;
  })
  TAKE_ALL(robot->tile, cairn_v1_Tile, tile, {
    if (tile->site_id == HashName(robot->site) && !tile->deleted && tile->content.bytes._length > 0) ++robot->tiles;
  })
  TakeReplies(robot);
}

/* Waits until the condition holds; takes meanwhile. */
#define WAIT_FOR(robot, condition, what)                  \
  for (const dds_time_t end = dds_time() + kPatience;;) { \
    TakeAll(robot);                                       \
    if (condition) break;                                 \
    if (dds_time() > end) Die(what);                      \
    dds_sleepfor(DDS_MSECS(1));                           \
  }

static bool Matched(dds_entity_t writer) {
  dds_publication_matched_status_t status;
  return dds_get_publication_matched_status(writer, &status) == DDS_RETCODE_OK && status.current_count > 0;
}

/* Repeats the request every second until it is answered. */
static void Request(struct Robot* robot, bool end, cairn_v1_SessionPhase wanted) {
  robot->answered = false;
  dds_time_t asked = 0;
  for (const dds_time_t deadline = dds_time() + kPatience; !robot->answered || robot->phase != wanted;) {
    if (dds_time() - asked > DDS_SECS(1)) {
      SendSession(robot, end);
      asked = dds_time();
    }
    TakeAll(robot);
    if (robot->answered && robot->phase == cairn_v1_SESSION_REFUSED) Die(robot->refusal);
    if (dds_time() > deadline) Die("no server answers the session");
    dds_sleepfor(DDS_MSECS(1));
  }
}

static void Open(struct Robot* robot) {
  Request(robot, false, cairn_v1_SESSION_ACTIVE);
  WAIT_FOR(robot, Matched(robot->scan) && Matched(robot->odometry) && Matched(robot->request),
           "the server's readers are not there")
}

static void SendScan(struct Robot* robot, struct FlaserScan* from, uint64_t number) {
  cairn_v1_Odometry odometry;
  memset(&odometry, 0, sizeof(odometry));
  odometry.robot_id = robot->robot_id;
  odometry.sensor_id = HashName("odometry");
  odometry.session = robot->opened_session;
  odometry.seq = number;
  odometry.stamp_ns = from->stamp_ns;
  odometry.T_odom_robot.x = from->T_odom_robot.x;
  odometry.T_odom_robot.y = from->T_odom_robot.y;
  odometry.T_odom_robot.theta = from->T_odom_robot.theta;
  if (dds_write(robot->odometry, &odometry) < 0) Die("odometry was not written");

  cairn_v1_Scan scan;
  memset(&scan, 0, sizeof(scan));
  scan.robot_id = robot->robot_id;
  scan.sensor_id = robot->sensor_id;
  scan.session = robot->opened_session;
  scan.seq = number;
  scan.stamp_ns = from->stamp_ns;
  scan.angle_first_rad = -kPi / 2;
  scan.angle_step_rad = kPi / (from->beams % 2 == 0 ? from->beams : from->beams - 1);
  scan.range_max_m = 80.0;
  const double dx = from->T_odom_laser.x - from->T_odom_robot.x;
  const double dy = from->T_odom_laser.y - from->T_odom_robot.y;
  scan.T_robot_laser.x = cos(from->T_odom_robot.theta) * dx + sin(from->T_odom_robot.theta) * dy;
  scan.T_robot_laser.y = -sin(from->T_odom_robot.theta) * dx + cos(from->T_odom_robot.theta) * dy;
  scan.ranges_m._length = scan.ranges_m._maximum = (uint32_t)from->beams;
  scan.ranges_m._buffer = from->ranges_m;
  if (dds_write(robot->scan, &scan) < 0) Die("a scan was not written");
}

static uint64_t Stream(struct Robot* robot, const char* path, uint64_t scans) {
  static struct FlaserScan scan;
  FILE* log = fopen(path, "r");
  if (log == NULL) Die("the log cannot be read");
  /* A server that comes later and does not know the session must not open it where it began. */
  robot->started = true;
  SendSession(robot, false);
  uint64_t sent = 0;
  while (sent < scans && ReadFlaser(log, &scan)) {
    WAIT_FOR(robot, sent < robot->settled_through + kWindow, "the server settles no scan")
    SendScan(robot, &scan, ++sent);
  }
  fclose(log);
  WAIT_FOR(robot, robot->settled_through >= sent, "the server did not settle every scan")
  return sent;
}

/* Returns false where no whole answer came in time. */
static bool Ask(struct Robot* robot, cairn_v1_Request request, dds_duration_t patience) {
  request.client = robot->client;
  request.seq = ++robot->sequence;
  request.robot = (char*)robot->name;
  request.site = (char*)robot->site;
  robot->reply_last = false;
  robot->reply_code = -1;
  robot->reply_poses = robot->reply_tiles = 0;
  if (dds_write(robot->request, &request) < 0) Die("a request was not written");
  for (const dds_time_t end = dds_time() + patience; dds_time() < end; dds_sleepfor(DDS_MSECS(1))) {
    TakeAll(robot);
    if (robot->reply_last) return true;
  }
  return false;
}

/* A reply to the first request may find our reader not discovered yet: ping until one comes. */
static void Greet(struct Robot* robot) {
  cairn_v1_Request ping;
  memset(&ping, 0, sizeof(ping));
  ping.kind = cairn_v1_REQUEST_PING;
  for (const dds_time_t end = dds_time() + kPatience; !Ask(robot, ping, DDS_MSECS(100));) {
    if (dds_time() > end) Die("no server answers a ping");
  }
}

int main(int argc, char** argv) {
  if (argc < 5) {
    fprintf(stderr, "usage: %s DOMAIN LOG SITE ROBOT [SCANS [MIN_POSES]]\n", argv[0]);
    return 2;
  }
  const uint64_t scans = argc > 5 ? strtoull(argv[5], NULL, 10) : 200;
  const int min_poses = argc > 6 ? atoi(argv[6]) : (int)(scans / 2);
  struct Robot robot;
  memset(&robot, 0, sizeof(robot));
  robot.site = argv[3];
  robot.name = argv[4];
  robot.robot_id = HashName(robot.name);
  robot.sensor_id = HashName("laser");
  robot.client = ((uint64_t)getpid() << 32) ^ (uint64_t)dds_time();
  robot.opened_session = robot.client ^ HashName(robot.name);
  Join(&robot, (dds_domainid_t)atoi(argv[1]));
  Open(&robot);
  const uint64_t sent = Stream(&robot, argv[2], scans);
  WAIT_FOR(&robot, robot.poses >= min_poses, "too few poses")
  WAIT_FOR(&robot, robot.tiles >= 1 && robot.maps >= 1, "no tile of the map")

  Greet(&robot);
  cairn_v1_Request request;
  memset(&request, 0, sizeof(request));
  request.kind = cairn_v1_REQUEST_POSE;
  request.latest = true;
  const bool pose_ok = Ask(&robot, request, kPatience) && robot.reply_code == 0 && robot.reply_poses == 1;
  request.kind = cairn_v1_REQUEST_TILES;
  request.area.x_min_m = robot.T_map_robot.x - 10;
  request.area.x_max_m = robot.T_map_robot.x + 10;
  request.area.y_min_m = robot.T_map_robot.y - 10;
  request.area.y_max_m = robot.T_map_robot.y + 10;
  const bool tiles_ok = Ask(&robot, request, kPatience) && robot.reply_code == 0 && robot.reply_tiles >= 1;
  const int reply_tiles = robot.reply_tiles;

  Request(&robot, true, cairn_v1_SESSION_ENDED);
  const bool ok = sent == scans && pose_ok && tiles_ok;
  printf(
      "{\"ok\":%s,\"scans_sent\":%llu,\"settled\":%llu,\"poses\":%d,\"tiles\":%d,\"pose_reply_ok\":%s,"
      "\"tiles_reply_ok\":%s,\"tiles_in_reply\":%d,\"x\":%.3f,\"y\":%.3f,\"theta\":%.4f}\n",
      ok ? "true" : "false", (unsigned long long)sent, (unsigned long long)robot.settled_through, robot.poses,
      robot.tiles, pose_ok ? "true" : "false", tiles_ok ? "true" : "false", reply_tiles, robot.T_map_robot.x,
      robot.T_map_robot.y, robot.T_map_robot.theta);
  dds_delete(robot.participant);
  return ok ? 0 : 1;
}
