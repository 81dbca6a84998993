#include "tests/common/wire/sample_values.h"

#include <limits>

namespace cairn::wire {
namespace {

constexpr double kMax = std::numeric_limits<double>::max();
constexpr double kTiny = std::numeric_limits<double>::denorm_min();
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kMax64 = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint32_t kMax32 = std::numeric_limits<std::uint32_t>::max();
constexpr std::int64_t kMin64 = std::numeric_limits<std::int64_t>::min();

std::string Name(char c) {
  return std::string(64, c);
}
std::string Text(char c) {
  return std::string(1024, c);
}

Tile ExtremeTileContent(std::size_t bytes) {
  Tile tile;
  tile.epoch = kMax32;
  tile.version = kMax64;
  tile.encoding = TileEncoding::kRaw;
  for (std::size_t i = 0; i < bytes; ++i) tile.bytes.push_back(static_cast<std::uint8_t>(i * 7));
  return tile;
}

}  // namespace

SessionRequest ExtremeSessionRequest() {
  SessionRequest value;
  value.robot = Name('r');
  value.site = Name('s');
  for (char c = 'a'; c < 'a' + 16; ++c) value.sensors.push_back(Name(c));
  value.client = kMax64;
  value.has_start = true;
  value.T_map_robot_start = {kMax, -kTiny, -kMax};
  value.session = kMax64 - 4;
  value.started = true;
  value.end = true;
  value.map_frame = kMax64 - 5;
  return value;
}

SessionState ExtremeSessionState() {
  return {.robot_id = kMax64,
          .client = kMax64 - 1,
          .robot = Name('r'),
          .site = Name('s'),
          .phase = SessionPhase::kSuspended,
          .status = {StatusCode::kDataLoss, Text('m')},
          .session = kMax64 - 2,
          .durable = true,
          .localise_only = true,
          .fragment = true,
          .stale = true,
          .generation = kMax64 - 3,
          .map_frame = kMax64 - 4};
}

SessionRefusal ExtremeSessionRefusal() {
  return {ExtremeSessionState()};
}

ScanSample ExtremeScan(std::size_t beams) {
  ScanSample value;
  value.stream = {kMax64, kMax64 - 1, kMax64 - 2};
  value.scan = {.sequence = kMax64 - 3,
                .stamp = kMin64,
                .angle_first_rad = -kMax,
                .angle_step_rad = kTiny,
                .range_min_m = -0.0,
                .range_max_m = kInf,
                .beam_period_s = std::numeric_limits<double>::quiet_NaN(),
                .tilt_rad = -1.25,
                .T_robot_laser = {1, -2, 3},
                .ranges_m = {}};
  const float specials[] = {0.0F,
                            -0.0F,
                            std::numeric_limits<float>::infinity(),
                            std::numeric_limits<float>::quiet_NaN(),
                            std::numeric_limits<float>::max(),
                            1.5F};
  for (std::size_t i = 0; i < beams; ++i) value.scan.ranges_m.push_back(specials[i % std::size(specials)]);
  return value;
}

OdometrySample ExtremeOdometry() {
  return {{1, kMax64, 3}, {.sequence = kMax64, .stamp = kMin64, .T_odom_robot = {-kMax, kMax, kTiny}}};
}

PoseReport ExtremePose() {
  PoseReport value;
  value.robot_id = kMax64;
  value.robot = Name('r');
  value.site = Name('s');
  value.stamp = kMin64;
  value.session = kMax64 - 3;
  value.scan_sequence = kMax64;
  value.T_map_robot = {kMax, kTiny, -3};
  value.covariance << 1, 2, 3, 4, 5, 6, 7, 8, kInf;
  value.T_map_odom = {-1, -2, -3};
  value.localized = true;
  value.score = 1.0;
  value.reason = PoseReason::kWaiting;
  value.map_epoch = kMax32;
  value.generation = kMax64;
  return value;
}

Ledger ExtremeLedger() {
  Ledger value;
  value.robot_id = kMax64;
  value.sensor_id = 1;
  value.robot = Name('r');
  value.sensor = Name('l');
  value.site = Name('s');
  std::uint64_t next = kMax64;
  for (std::uint64_t* field : {&value.received, &value.used, &value.keyframes, &value.waiting, &value.odometry_received,
                               &value.odometry_dropped, &value.odometry_merged, &value.last_sequence,
                               &value.settled_through, &value.durable_through, &value.session, &value.generation}) {
    *field = next--;
  }
  for (std::uint64_t& count : value.dropped) count = next--;
  value.last_stamp = kMin64;
  value.latency_p50_ms = kTiny;
  value.latency_p99_ms = kMax;
  return value;
}

MapInfo ExtremeMapInfo() {
  MapInfo value;
  value.site_id = kMax64;
  value.site = Name('s');
  value.resolution_m = kTiny;
  value.epoch = kMax32;
  value.version = kMax64;
  value.levels = kMax32 - 1;
  value.tile_count = kMax32 - 2;
  value.x_min_m = -kMax;
  value.y_min_m = -1;
  value.x_max_m = kMax;
  value.y_max_m = 2;
  value.robots = 7;
  value.enabled_version = kMax32 - 3;
  value.generation = kMax64;
  value.versions = {{1, true, 0, ""}, {kMax32, false, kMax64, Text('n')}};
  value.edits_version = kMax64 - 4;
  value.memory_bytes = kMax64 - 5;
  value.memory_note = Text('g');
  return value;
}

TileSample ExtremeTile(std::size_t bytes) {
  TileSample value{kMax64, ExtremeTileContent(bytes), true, kMax64 - 1};
  value.tile.key = {15, -32768, 32767};
  return value;
}

Job ExtremeJob() {
  return {.id = kMax64,
          .site = Name('s'),
          .kind = JobKind::kSmooth,
          .state = JobState::kCancelled,
          .progress = 1.0,
          .cost_before = kMax,
          .cost_after = -0.0,
          .map_version = kMax32,
          .submitted = kMin64,
          .started = -1,
          .ended = -2,
          .message = Text('m'),
          .robot = Name('r'),
          .places = {{kMin64, {kMax, -kMax, kTiny}, kMax}, PoseHypothesis{}},
          .generation = kMax64 - 1};
}

MapEdit ExtremeEdit() {
  return {.id = kMax64,
          .kind = MapEditKind::kKeepOut,
          .points_map = std::vector<Eigen::Vector2d>(kMostEditPoints, {kMax, -kTiny}),
          .width_m = -kMax,
          .note = Text('e'),
          .made = kMin64};
}

Request ExtremeRequest() {
  Request value;
  value.client = kMax64;
  value.sequence = kMin64;
  value.kind = RequestKind::kMapEditRemove;
  value.site = Name('s');
  value.robot = Name('r');
  value.latest = false;
  value.stamp = kMin64;
  value.smoothed = true;
  value.area = {-kMax, -1, kMax, 2};
  value.level = 15;
  value.since_epoch = kMax32;
  value.since_version = kMax64;
  value.since_generation = kMax64 - 2;
  value.job = kMax64 - 1;
  value.job_kind = JobKind::kSmooth;
  value.enable = false;
  value.map_version = kMax32;
  value.saved = Name('f');
  value.T_map_robot = Pose2{kMax, -1.5, 2.5};
  value.edit = ExtremeEdit();
  value.disagreement = true;
  return value;
}

Reply ExtremeReply() {
  Reply value;
  value.client = kMax64;
  value.sequence = kMin64;
  value.part = kMax32;
  value.last = false;
  value.status = {StatusCode::kDataLoss, Text('m')};
  value.map_epoch = kMax32;
  value.map_version = kMax64;
  value.generation = kMax64;
  value.poses = {ExtremePose(), PoseReport{}};
  value.path = {{kMin64, {kMax, -kMax, kTiny}}, {1, {}}};
  value.tiles = {ExtremeTileContent(16384), ExtremeTileContent(0)};
  value.tiles[0].key = {3, std::numeric_limits<int>::min(), std::numeric_limits<int>::max()};
  LandmarkReport landmark;
  landmark.id = kMax64;
  landmark.robot = Name('r');
  landmark.corner = true;
  landmark.p_map = {kMax, kTiny};
  landmark.direction_rad = -3;
  landmark.covariance << 1, 2, 3, 4;
  landmark.sightings = kMax32;
  value.landmarks = {landmark, LandmarkReport{}};
  value.maps = {ExtremeMapInfo()};
  value.robots = {{ExtremeSessionState(),
                   true,
                   ExtremePose(),
                   {ExtremeLedger(), Ledger{}},
                   {{Name('n'), Name('u'), kMax, kTiny, true}, LearnedValue{}}}};
  value.jobs = {ExtremeJob(), Job{}};
  value.load = {{.up_s = kMax,
                 .processor_s = -kMax,
                 .memory_bytes = kMax64,
                 .inbound_waiting = kMax64 - 1,
                 .outbound_waiting = kMax64 - 2,
                 .strand_wait_p50_ms = 3.5,
                 .strand_wait_p99_ms = 4.5,
                 .stores = true,
                 .commits = kMax64 - 3,
                 .failed_commits = kMax64 - 4,
                 .store_bytes = kMax64 - 5,
                 .stored_after_p50_ms = 1.5,
                 .stored_after_p99_ms = 2.5}};
  value.refused = {{true, kMax64, kMax64 - 1, kMax64 - 2, kMax64 - 3, kMax64 - 4, kMax64 - 5}};
  value.server_version = Text('v');
  value.saved = {{Name('f'), Name('s'), kMax64, kMin64}, SavedSite{}};
  value.ros2 = {{true, kMin64, kMax64, kMax64 - 1, kMax64 - 2, {Text('d'), ""}}};
  Ros2Namespace name_space{Text('n'), Name('r'), Name('s'), true, {Text('p')}, {}};
  name_space.topics = {{Text('t'), Text('y'), kMax32, true, true, kTiny, kMax64, kMax64}, Ros2Topic{}};
  value.ros2_namespaces = {name_space, Ros2Namespace{}};
  value.edits = {ExtremeEdit(), MapEdit{}};
  value.hypotheses = {{kMin64, {kMax, -kMax, kTiny}, kMax}, PoseHypothesis{}};
  return value;
}

}  // namespace cairn::wire
