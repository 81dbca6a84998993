#include "common/wire/bounds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/wire/convert.h"
#include "common/wire/limits.h"
#include "tests/common/wire/sample_values.h"

namespace cairn::wire {
namespace {

using ::testing::HasSubstr;
using namespace std::string_literals;

template <typename Wire>
void ExpectRefused(const Wire& wire, const std::string& field) {
  const Result<void> result = CheckBounds(wire);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr(field));
}

TEST(Bounds, RefuseNamesOverTheLimit) {
  v1::SessionState state = ToWire(ExtremeSessionState());
  state.site() += 'x';
  ExpectRefused(state, "site");
  v1::SessionRequest request = ToWire(ExtremeSessionRequest());
  request.sensors()[15] += 'x';
  ExpectRefused(request, "sensors");
}

// Found by a fuzz target: Fast CDR delivers the whole text, and would send only what is before the zero.
TEST(Bounds, RefuseAZeroInsideAText) {
  v1::SessionState state = ToWire(ExtremeSessionState());
  state.site("lab\0oratory"s);
  ExpectRefused(state, "site");
  v1::Job job = ToWire(ExtremeJob());
  job.message("\0"s);
  ExpectRefused(job, "message");
}

TEST(Bounds, RefuseTooManySensors) {
  v1::SessionRequest request = ToWire(ExtremeSessionRequest());
  request.sensors().emplace_back("one-more");
  ExpectRefused(request, "sensors");
}

TEST(Bounds, RefuseASessionWhoseKeyIsNotTheHashOfItsName) {
  v1::SessionRequest request = ToWire(ExtremeSessionRequest());
  request.robot_id(request.robot_id() + 1);
  ExpectRefused(request, "robot_id");
}

TEST(Bounds, RefuseAbsurdScans) {
  v1::Scan scan = ToWire(ExtremeScan(kMaxRangesRead));
  scan.ranges_m().push_back(1.0F);
  ExpectRefused(scan, "ranges_m");
}

TEST(Bounds, RefuseEditsOfTooManyPointsAndTooManyEdits) {
  v1::Request request = ToWire(ExtremeRequest());
  request.edit().points().emplace_back();
  ExpectRefused(request, "edit");
  v1::Reply reply = ToWire(ExtremeReply());
  reply.edits().resize(kMaxReplyEdits + 1);
  ExpectRefused(reply, "edits");
  reply.edits().clear();
  reply.hypotheses().resize(kMostHypotheses + 1);
  ExpectRefused(reply, "hypotheses");
}

TEST(Bounds, RefuseAReportOnRos2ThatIsTooLong) {
  v1::Reply reply = ToWire(ExtremeReply());
  reply.ros2_namespaces().at(0).problems().resize(kMaxRos2Problems + 1);
  ExpectRefused(reply, "problems");
  reply = ToWire(ExtremeReply());
  reply.ros2_namespaces().at(0).topics().resize(kMaxRos2Topics + 1);
  ExpectRefused(reply, "topics");
  reply = ToWire(ExtremeReply());
  reply.ros2().at(0).problems().at(0).resize(kMaxTextBytes + 1, 'p');
  ExpectRefused(reply, "problems");
}

TEST(Bounds, RefuseUnknownEnumValues) {
  v1::SessionState state = ToWire(ExtremeSessionState());
  state.phase(static_cast<v1::SessionPhase>(4));
  ExpectRefused(state, "phase");
  v1::PoseReport pose = ToWire(ExtremePose());
  pose.reason(static_cast<v1::PoseReason>(0xffffffffU));
  ExpectRefused(pose, "reason");
  v1::Job job = ToWire(ExtremeJob());
  job.kind(static_cast<v1::JobKind>(3));
  ExpectRefused(job, "kind");
  job = ToWire(ExtremeJob());
  job.state(static_cast<v1::JobState>(5));
  ExpectRefused(job, "state");
  v1::Request request = ToWire(ExtremeRequest());
  request.kind(static_cast<v1::RequestKind>(kRequestKindCount));
  ExpectRefused(request, "kind");
  request = ToWire(ExtremeRequest());
  request.edit().kind(static_cast<v1::MapEditKind>(kMapEditKindCount));
  ExpectRefused(request, "edit");
  request = ToWire(ExtremeRequest());
  request.job_kind(static_cast<v1::JobKind>(77));
  ExpectRefused(request, "job_kind");
  v1::Tile tile = ToWire(ExtremeTile(10));
  tile.content().encoding(static_cast<v1::TileEncoding>(2));
  ExpectRefused(tile, "encoding");
}

TEST(Bounds, RefuseStatusCodesOutsideGrpcs) {
  v1::SessionState state = ToWire(ExtremeSessionState());
  state.status().code(-1);
  ExpectRefused(state, "status");
  state.status().code(16);
  ExpectRefused(state, "status");
}

TEST(Bounds, RefuseTextsOverTheLimit) {
  v1::Job job = ToWire(ExtremeJob());
  job.message() += 'x';
  ExpectRefused(job, "message");
  v1::MapInfo info = ToWire(ExtremeMapInfo());
  info.versions()[1].note() += 'x';
  ExpectRefused(info, "versions");
}

TEST(Bounds, RefuseTilesOver64KiBOrOfAbsurdLevels) {
  v1::Tile tile = ToWire(ExtremeTile(kMaxTileBytes));
  tile.content().bytes().push_back(0);
  ExpectRefused(tile, "bytes");
  tile = ToWire(ExtremeTile(1));
  tile.level(16);
  ExpectRefused(tile, "level");
}

TEST(Bounds, RefuseLedgersWithTooManyReasons) {
  v1::Ledger ledger = ToWire(ExtremeLedger());
  ledger.dropped().resize(kMaxDropReasons + 1);
  ExpectRefused(ledger, "dropped");
}

TEST(Bounds, RefuseRepliesByTheirInnermostViolation) {
  v1::Reply reply = ToWire(ExtremeReply());
  reply.robots()[0].pose().reason(static_cast<v1::PoseReason>(7));
  ExpectRefused(reply, "robots: pose: reason");
  reply = ToWire(ExtremeReply());
  reply.tiles()[0].level(-1);
  ExpectRefused(reply, "tiles: level");
  reply = ToWire(ExtremeReply());
  reply.robots()[0].ledgers().resize(kMaxSensors + 1);
  ExpectRefused(reply, "ledgers");
}

TEST(Bounds, RefuseListsOverTheLimitOfAReply) {
  const v1::Reply good = ToWire(ExtremeReply());
  v1::Reply reply = good;
  reply.path().resize(kMaxReplyPath + 1);
  ExpectRefused(reply, "path");
  reply = good;
  reply.poses().resize(kMaxReplyPoses + 1);
  ExpectRefused(reply, "poses");
  reply = good;
  reply.tiles().resize(kMaxReplyTiles + 1);
  ExpectRefused(reply, "tiles");
  reply = good;
  reply.landmarks().resize(kMaxReplyLandmarks + 1);
  ExpectRefused(reply, "landmarks");
  reply = good;
  reply.maps().resize(kMaxReplyMaps + 1);
  ExpectRefused(reply, "maps");
  reply = good;
  reply.robots().resize(kMaxReplyRobots + 1);
  ExpectRefused(reply, "robots");
  reply = good;
  reply.jobs().resize(kMaxReplyJobs + 1);
  ExpectRefused(reply, "jobs");
}

}  // namespace
}  // namespace cairn::wire
