#include "tests/integration/cyclone/ros2_endpoints.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void Die(const char* what) {
  printf("{\"error\":\"%s\"}\n", what);
  exit(1);
}

dds_entity_t RosParticipant(dds_domainid_t domain) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_userdata(qos, "enclave=/;", strlen("enclave=/;"));
  const dds_entity_t participant = dds_create_participant(domain, qos, NULL);
  dds_delete_qos(qos);
  if (participant < 0) Die("the domain cannot be joined");
  return participant;
}

/* Keep last; from Iron on with the type's hash. */
static dds_qos_t* MakeQos(struct RosQos wanted) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, wanted.reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, DDS_INFINITY);
  dds_qset_durability(qos, wanted.transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, wanted.depth);
  if (wanted.transient_local)
    dds_qset_durability_service(qos, 0, DDS_HISTORY_KEEP_LAST, wanted.depth, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED);
  if (wanted.hash != NULL) {
    char data[128];
    snprintf(data, sizeof(data), "typehash=RIHS01_%s;", wanted.hash);
    dds_qset_userdata(qos, data, strlen(data));
  }
  return qos;
}

static dds_entity_t Topic(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* prefix,
                          const char* stream) {
  char name[256];
  snprintf(name, sizeof(name), "%s/%s", prefix, stream);
  const dds_entity_t topic = dds_create_topic(participant, type, name, NULL, NULL);
  if (topic < 0) Die("a topic");
  return topic;
}

dds_entity_t RosWriter(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* prefix,
                       const char* stream, struct RosQos qos) {
  dds_qos_t* made = MakeQos(qos);
  const dds_entity_t writer = dds_create_writer(participant, Topic(participant, type, prefix, stream), made, NULL);
  dds_delete_qos(made);
  if (writer < 0) Die("a writer");
  return writer;
}

dds_entity_t RosReader(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* prefix,
                       const char* stream, struct RosQos qos) {
  dds_qos_t* made = MakeQos(qos);
  const dds_entity_t reader = dds_create_reader(participant, Topic(participant, type, prefix, stream), made, NULL);
  dds_delete_qos(made);
  if (reader < 0) Die("a reader");
  return reader;
}
