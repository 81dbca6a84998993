/* A ROS 2 program that calls a service as rmw_cyclonedds does, without ROS: waits for the service, asks, waits for the
 * answer with its own two numbers in front, and prints it as one line of JSON. Exits 0 if it came.
 *   ros2_caller DOMAIN KIND SERVICE [TEXT] [jazzy] [flood] [impatient] [briefly]
 * KIND is get_map, load_map, save_map, serialize_map, pause or reset (TEXT "true": paused afterwards). Words: jazzy:
 * type hashes in the user data of endpoints (from Iron on); without it: as Humble. flood: asks 300 times at once, of
 * which one answer will do. impatient: asks as soon as its request can be read, without a look whether it knows who
 * answers, and again every second. briefly: looks for the service for 5 s, not 30. CYCLONEDDS_URI chooses the network
 * interface.
 */
#include <dds/dds.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "service_calls.h"

enum { kSeconds = 30, kBriefly = 5, kFlood = 300 };

struct Kind {
  const char *name, *type; /* Of the service, as types begin on the wire. */
  const dds_topic_descriptor_t *request, *answer;
  const char *request_hash, *answer_hash;
};

static const struct Kind kKinds[] = {
    {"get_map", "nav_msgs::srv::dds_::GetMap", &service_calls_EmptyRequest_desc, &service_calls_MapAnswer_desc,
     "b531e302f1bd6a81f8a5e03453266c378b1f711b4296000c1c0f53a40e00a7c4",
     "45246f7a2ff0cbfa46e13865d4b95929ebb6d2846d1b85a20ad51030f4690dc2"},
    {"load_map", "nav_msgs::srv::dds_::LoadMap", &service_calls_TextRequest_desc, &service_calls_LoadAnswer_desc,
     "0f8fe3aac433c977d7c2f8b57ab1c3a17677e24880d76919b69e4208e99f5132",
     "e7970ddf9f58e10d34b5eae6d2baca31b2b3e2f2fe6d082b3aae2a5f92777b2a"},
    {"save_map", "slam_toolbox::srv::dds_::SaveMap", &service_calls_TextRequest_desc, &service_calls_ResultAnswer_desc,
     "53030f29f705b5f868bf35ce8a5bdd5a9b17f670649396fdbbc4a8dbe7ad0973",
     "713758aaa982f631420bcd79707de16f6729ecd6ba855070267104bdcdee6b22"},
    {"serialize_map", "slam_toolbox::srv::dds_::SerializePoseGraph", &service_calls_TextRequest_desc,
     &service_calls_ResultAnswer_desc, "723d3bfb9150b866fcbb26e447c8c7af3fb1e77e14d684037dc2baa0dbe80bd6",
     "89b3b7194fed12911fd6e44bdfac000ad6a5b3ef1dda9b11f71481388cde49ec"},
    {"pause", "slam_toolbox::srv::dds_::Pause", &service_calls_EmptyRequest_desc, &service_calls_ResultAnswer_desc,
     "bd94128b2476065d43caa26f43334ad5b688186e82ca73366f11e6459b7562a6",
     "72bc942536d6fb903377dbf48c7c2e0c965cb2b04f508477d9c8aced687d6d94"},
    {"reset", "slam_toolbox::srv::dds_::Reset", &service_calls_FlagRequest_desc, &service_calls_ResultAnswer_desc,
     "e3eb332dcfed05e39e67aa244c229e5a4d1741969d26e0d8f9138425ee4f8856",
     "46ca8b03f861d70ebb5a9be4d4eab4cd00119d209ad9ee01e93f4690140dceae"},
};

struct Caller {
  const struct Kind* kind;
  bool jazzy;
  dds_entity_t participant, writer, reader;
  uint64_t client;
};

static void Die(const char* what) {
  printf("{\"error\":\"%s\"}\n", what);
  exit(1);
}

/* As rmw_cyclonedds makes the endpoints of services: reliable, keep all. */
static dds_qos_t* MakeQos(const struct Caller* caller, const char* hash) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_ALL, DDS_LENGTH_UNLIMITED);
  if (caller->jazzy) {
    char data[128];
    snprintf(data, sizeof(data), "typehash=RIHS01_%s;", hash);
    dds_qset_userdata(qos, data, strlen(data));
  }
  return qos;
}

/* `topic`: "rq" or "rr" and so on; the type gets the name that ROS gives it. The descriptor stays, as the topic does:
 * it is called twice. */
static dds_entity_t Topic(const struct Caller* caller, const dds_topic_descriptor_t* type, const char* suffix,
                          const char* topic) {
  static char names[2][128];
  static dds_topic_descriptor_t types[2];
  static int made = 0;
  if (made == 2) Die("too many topics");
  snprintf(names[made], sizeof(names[made]), "%s_%s_", caller->kind->type, suffix);
  memcpy(&types[made], type, sizeof(types[made]));
  *(const char**)&types[made].m_typename = names[made];
  const dds_entity_t entity = dds_create_topic(caller->participant, &types[made], topic, NULL, NULL);
  if (entity < 0) Die("a topic");
  ++made;
  return entity;
}

static void Join(struct Caller* caller, dds_domainid_t domain, const char* service) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_userdata(qos, "enclave=/;", strlen("enclave=/;"));
  caller->participant = dds_create_participant(domain, qos, NULL);
  dds_delete_qos(qos);
  if (caller->participant < 0) Die("the domain cannot be joined");
  char topic[256];
  snprintf(topic, sizeof(topic), "rq%sRequest", service);
  qos = MakeQos(caller, caller->kind->request_hash);
  caller->writer =
      dds_create_writer(caller->participant, Topic(caller, caller->kind->request, "Request", topic), qos, NULL);
  dds_delete_qos(qos);
  snprintf(topic, sizeof(topic), "rr%sReply", service);
  qos = MakeQos(caller, caller->kind->answer_hash);
  caller->reader =
      dds_create_reader(caller->participant, Topic(caller, caller->kind->answer, "Response", topic), qos, NULL);
  dds_delete_qos(qos);
  dds_instance_handle_t handle = 0;
  if (caller->writer < 0 || caller->reader < 0 || dds_get_instance_handle(caller->writer, &handle) < 0)
    Die("an endpoint");
  caller->client = handle;
}

/* As rmw_service_server_is_available looks: both endpoints of the server are known. Cyclone DDS never
 * delivers what a writer sent before it had found that writer, so an impatient caller may get no first answer. */
static bool IsThere(const struct Caller* caller, bool impatient) {
  dds_instance_handle_t peer = 0;
  return dds_get_matched_subscriptions(caller->writer, &peer, 1) > 0 &&
         (impatient || dds_get_matched_publications(caller->reader, &peer, 1) > 0);
}

static void Ask(const struct Caller* caller, int64_t number, const char* text) {
  service_calls_EmptyRequest nothing = {caller->client, number, 0};
  service_calls_TextRequest with_text = {caller->client, number, (char*)text};
  service_calls_FlagRequest flag = {caller->client, number, strcmp(text, "true") == 0};
  const void* sample = &nothing;
  if (caller->kind->request == &service_calls_TextRequest_desc) sample = &with_text;
  if (caller->kind->request == &service_calls_FlagRequest_desc) sample = &flag;
  if (dds_write(caller->writer, sample) < 0) Die("the request was not written");
}

static void PrintGrid(const nav_msgs_msg_dds__OccupancyGrid_* grid) {
  unsigned occupied = 0;
  for (uint32_t i = 0; i < grid->data._length; ++i) occupied += grid->data._buffer[i] >= 65;
  const double cells = (double)grid->info.width * grid->info.height;
  printf(
      "\"frame\":\"%s\",\"width\":%u,\"height\":%u,\"resolution\":%.3f,\"origin_x\":%.3f,\"occupied\":%u,\"whole\":%s",
      grid->header.frame_id, grid->info.width, grid->info.height, grid->info.resolution, grid->info.origin.position.x,
      occupied, grid->data._length == cells ? "true" : "false");
}

/* Takes one sample; true if it answers one of `count` requests from `number` on. Then it is printed. */
static bool TakeAnswer(const struct Caller* caller, int64_t number, int64_t count) {
  void* samples[1] = {NULL};
  dds_sample_info_t info;
  if (dds_take(caller->reader, samples, &info, 1, 1) != 1) return false;
  /* All answers begin with these two numbers. */
  const service_calls_ResultAnswer* const head = samples[0];
  const bool mine =
      info.valid_data && head->client == caller->client && head->number >= number && head->number < number + count;
  if (mine) {
    printf("{");
    if (caller->kind->answer == &service_calls_MapAnswer_desc) {
      PrintGrid(&((const service_calls_MapAnswer*)samples[0])->grid);
    } else if (caller->kind->answer == &service_calls_LoadAnswer_desc) {
      PrintGrid(&((const service_calls_LoadAnswer*)samples[0])->grid);
      printf(",\"result\":%u", ((const service_calls_LoadAnswer*)samples[0])->result);
    } else {
      printf("\"result\":%u", head->result);
    }
    printf("}\n");
  }
  dds_return_loan(caller->reader, samples, 1);
  return mine;
}

static bool IsWord(const char* text) {
  return strcmp(text, "jazzy") == 0 || strcmp(text, "flood") == 0 || strcmp(text, "impatient") == 0 ||
         strcmp(text, "briefly") == 0;
}

static bool Has(int argc, char** argv, const char* word) {
  for (int i = 4; i < argc; ++i)
    if (strcmp(argv[i], word) == 0) return true;
  return false;
}

int main(int argc, char** argv) {
  if (argc < 4) Die("usage: ros2_caller DOMAIN KIND SERVICE [TEXT] [jazzy] [flood] [impatient] [briefly]");
  struct Caller caller = {.kind = NULL, .jazzy = Has(argc, argv, "jazzy")};
  for (size_t i = 0; i < sizeof(kKinds) / sizeof(kKinds[0]); ++i)
    if (strcmp(kKinds[i].name, argv[2]) == 0) caller.kind = &kKinds[i];
  if (caller.kind == NULL) Die("no such kind");
  const char* const text = argc > 4 && !IsWord(argv[4]) ? argv[4] : "";
  Join(&caller, (dds_domainid_t)strtoul(argv[1], NULL, 10), argv[3]);
  const dds_time_t end = dds_time() + DDS_SECS(Has(argc, argv, "briefly") ? kBriefly : kSeconds);
  const bool impatient = Has(argc, argv, "impatient");
  while (!IsThere(&caller, impatient)) {
    if (dds_time() > end) Die("the service is not there");
    dds_sleepfor(DDS_MSECS(impatient ? 1 : 20));
  }
  const int64_t first = 4000000001; /* More than 32 bits. */
  int64_t count = Has(argc, argv, "flood") ? kFlood : 1;
  for (int64_t i = 0; i < count; ++i) Ask(&caller, first + i, text);
  dds_time_t asked = dds_time();
  bool answered = false;
  while (!answered && dds_time() < end) {
    answered = TakeAnswer(&caller, first, count);
    if (!answered) dds_sleepfor(DDS_MSECS(5));
    if (impatient && !answered && dds_time() > asked + DDS_SECS(1)) {
      Ask(&caller, first + count++, text);
      asked = dds_time();
    }
  }
  if (!answered) printf("{\"error\":\"no answer\"}\n");
  dds_delete(caller.participant);
  return answered ? 0 : 1;
}
