// All topics of Cairn's wire, with their names, their types and their QoS. idl/README.md describes the same
// table in words.
#pragma once

#include "cairn/jobPubSubTypes.h"
#include "cairn/ledgerPubSubTypes.h"
#include "cairn/mapPubSubTypes.h"
#include "cairn/odometryPubSubTypes.h"
#include "cairn/posePubSubTypes.h"
#include "cairn/queryPubSubTypes.h"
#include "cairn/scanPubSubTypes.h"
#include "cairn/sessionPubSubTypes.h"
#include "cairn/tilePubSubTypes.h"
#include "common/service/request.h"
#include "common/service/stream.h"
#include "common/wire/partitions.h"
#include "common/wire/sample_type.h"

namespace cairn::wire {

// The QoS of a topic. All topics are reliable and have bounded histories; the members hold what differs.
struct TopicProfile {
  const char* name;
  bool transient_local;       // Late joiners get the last samples of each instance.
  int writer_depth;           // Samples kept per instance until acknowledged; a new one replaces the oldest.
  int reader_depth;           // Samples per instance waiting for the callback; a new one replaces the oldest.
  int max_instances;          // At one time, for a writer. 1: the topic has no key.
  double deadline_s;          // Offered by writers, not requested by readers. 0: none.
  bool leased;                // Whether both ends use the liveliness lease.
  std::uint8_t heartbeat_ms;  // Period of heartbeats while a sample is unacknowledged.
  Partitions partitions = Partitions::kDefault;
};

// Samples of streams, sessions, requests and replies that have been acknowledged must not be lost while a
// callback is busy. Therefore the reader's queue is longer than the writer's.
template <typename Value>
struct Topic;

template <>
struct Topic<SessionRequest> {
  using Wire = v1::SessionRequest;
  using Type = SampleType<Wire, v1::SessionRequestPubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/session", true, 1, 16, 4096, 0.0, true, 20, Partitions::kRobots};
};
template <>
struct Topic<SessionState> {
  using Wire = v1::SessionState;
  using Type = SampleType<Wire, v1::SessionStatePubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/session_state", true, 1, 4, 4096, 0.0, false, 20};
};
template <>
struct Topic<SessionRefusal> {
  using Wire = v1::SessionRefusal;
  using Type = SampleType<Wire, v1::SessionRefusalPubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/session_refusal", false, 64, 256, 1, 0.0, false, 20};
};
template <>
struct Topic<ScanSample> {
  using Wire = v1::Scan;
  using Type = SampleType<Wire, v1::ScanPubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/scan", false, 64, 128, 4096, 0.0, false, 20, Partitions::kRobots};
};
template <>
struct Topic<OdometrySample> {
  using Wire = v1::Odometry;
  using Type = SampleType<Wire, v1::OdometryPubSubType>;
  // A sample is always on its way, so each period costs the server a heartbeat and an acknowledgement of each robot.
  static constexpr TopicProfile kProfile{"cairn/v1/odometry", false, 256, 512, 4096, 0.0, false, 50,
                                         Partitions::kRobots};
};
template <>
struct Topic<PoseReport> {
  using Wire = v1::PoseReport;
  using Type = SampleType<Wire, v1::PoseReportPubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/pose", false, 1, 16, 4096, 1.0, false, 20, Partitions::kShares};
};
template <>
struct Topic<Ledger> {
  using Wire = v1::Ledger;
  using Type = SampleType<Wire, v1::LedgerPubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/ledger", true, 1, 1, 4096, 0.0, false, 20, Partitions::kShares};
};
template <>
struct Topic<MapInfo> {
  using Wire = v1::MapInfo;
  using Type = SampleType<Wire, v1::MapInfoPubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/map", true, 1, 1, 4096, 0.0, false, 20};
};
template <>
struct Topic<TileSample> {
  using Wire = v1::Tile;
  using Type = SampleType<Wire, v1::TilePubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/tile", true, 1, 1, 262144, 0.0, false, 20};
};
template <>
struct Topic<Job> {
  using Wire = v1::Job;
  using Type = SampleType<Wire, v1::JobPubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/job", true, 1, 1, 16384, 0.0, false, 20};
};
template <>
struct Topic<Request> {
  using Wire = v1::Request;
  using Type = SampleType<Wire, v1::RequestPubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/request", false, 64, 1024, 1, 0.0, false, 20};
};
template <>
struct Topic<Command> {
  using Wire = v1::Request;
  using Type = SampleType<Wire, v1::RequestPubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/command", false, 64, 1024, 1, 0.0, false, 20};
};
template <>
struct Topic<Reply> {
  using Wire = v1::Reply;
  using Type = SampleType<Wire, v1::ReplyPubSubType>;
  static constexpr TopicProfile kProfile{"cairn/v1/reply", false, 512, 1024, 1, 0.0, false, 20, Partitions::kReplies};
};

}  // namespace cairn::wire
