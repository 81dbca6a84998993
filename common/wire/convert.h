// Converts Cairn's values to IDL types and back, every field. FromWire requires a value that passed
// CheckBounds, and cannot fail. ToWire cannot fail either: CheckBounds finds values that do not fit the wire
// before they are sent. Only the coordinates of a tile must be checked before: ToWire of a TileSample
// requires FitsTileKey.
#pragma once

#include "cairn/job.h"
#include "cairn/ledger.h"
#include "cairn/map.h"
#include "cairn/odometry.h"
#include "cairn/pose.h"
#include "cairn/query.h"
#include "cairn/scan.h"
#include "cairn/session.h"
#include "cairn/tile.h"
#include "common/service/request.h"
#include "common/service/stream.h"

namespace cairn::wire {

[[nodiscard]] v1::SessionRequest ToWire(const SessionRequest& value);
[[nodiscard]] v1::SessionState ToWire(const SessionState& value);
[[nodiscard]] v1::SessionRefusal ToWire(const SessionRefusal& value);
[[nodiscard]] v1::Scan ToWire(const ScanSample& value);
[[nodiscard]] v1::Odometry ToWire(const OdometrySample& value);
[[nodiscard]] v1::PoseReport ToWire(const PoseReport& value);
[[nodiscard]] v1::PoseHypothesis ToWire(const PoseHypothesis& value);
[[nodiscard]] v1::Ledger ToWire(const Ledger& value);
[[nodiscard]] v1::MapInfo ToWire(const MapInfo& value);
[[nodiscard]] v1::MapEdit ToWire(const MapEdit& value);
[[nodiscard]] v1::Tile ToWire(const TileSample& value);
[[nodiscard]] v1::Job ToWire(const Job& value);
[[nodiscard]] v1::Request ToWire(const Request& value);
[[nodiscard]] v1::Reply ToWire(const Reply& value);
[[nodiscard]] inline v1::Request ToWire(const Command& value) {
  return ToWire(value.request);
}

// FromWire moves the large members (ranges, bytes) out of its argument.
[[nodiscard]] SessionRequest FromWire(v1::SessionRequest&& wire);
[[nodiscard]] SessionState FromWire(v1::SessionState&& wire);
[[nodiscard]] SessionRefusal FromWire(v1::SessionRefusal&& wire);
[[nodiscard]] ScanSample FromWire(v1::Scan&& wire);
[[nodiscard]] OdometrySample FromWire(v1::Odometry&& wire);
[[nodiscard]] PoseReport FromWire(v1::PoseReport&& wire);
[[nodiscard]] PoseHypothesis FromWire(v1::PoseHypothesis&& wire);
[[nodiscard]] Ledger FromWire(v1::Ledger&& wire);
[[nodiscard]] MapInfo FromWire(v1::MapInfo&& wire);
[[nodiscard]] MapEdit FromWire(v1::MapEdit&& wire);
[[nodiscard]] TileSample FromWire(v1::Tile&& wire);
[[nodiscard]] Job FromWire(v1::Job&& wire);
[[nodiscard]] Request FromWire(v1::Request&& wire);
[[nodiscard]] Reply FromWire(v1::Reply&& wire);

// The parts that several values share.
[[nodiscard]] v1::Pose2 ToWire(const Pose2& value);
[[nodiscard]] Pose2 FromWire(const v1::Pose2& wire);
[[nodiscard]] v1::Status ToWire(const Status& value);
[[nodiscard]] Status FromWire(v1::Status&& wire);
[[nodiscard]] v1::TileContent ContentToWire(const Tile& value);
void ContentFromWire(v1::TileContent&& wire, Tile& value);

// Tile coordinates are 16 bits in the key (with an 8-byte site it must stay within 16 bytes): +-209 km at 5
// cm.
[[nodiscard]] bool FitsTileKey(const TileKey& key);

}  // namespace cairn::wire
