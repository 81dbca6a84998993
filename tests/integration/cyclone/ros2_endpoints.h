/* Endpoints as rmw_cyclonedds makes them: names, QoS, and the user data of Iron and later. What cannot be made ends the
 * program. */
#pragma once

#include <dds/dds.h>
#include <stdbool.h>

struct RosQos {
  bool reliable, transient_local;
  int depth;
  const char* hash; /* Of the type, from Iron on. NULL: none, as before. */
};

/* Prints the reason as JSON and exits with 1. */
void Die(const char* what);
dds_entity_t RosParticipant(dds_domainid_t domain);
/* The topic is `prefix`/`stream`. */
dds_entity_t RosWriter(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* prefix,
                       const char* stream, struct RosQos qos);
dds_entity_t RosReader(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* prefix,
                       const char* stream, struct RosQos qos);
