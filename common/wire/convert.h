// Cairn's values as IDL types and back, every field. FromWire expects a value that passed CheckBounds; it cannot fail.
// ToWire cannot fail either: what does not fit the wire is caught by CheckBounds before it is sent. The exception is a
// tile beyond the key's 16 bits, so ToWire of a TileSample needs FitsTileKey.
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
[[nodiscard]] v1::Scan ToWire(const ScanSample& value);
[[nodiscard]] v1::Odometry ToWire(const OdometrySample& value);
[[nodiscard]] v1::PoseReport ToWire(const PoseReport& value);
[[nodiscard]] v1::Ledger ToWire(const Ledger& value);
[[nodiscard]] v1::MapInfo ToWire(const MapInfo& value);
[[nodiscard]] v1::Tile ToWire(const TileSample& value);
[[nodiscard]] v1::Job ToWire(const Job& value);
[[nodiscard]] v1::Request ToWire(const Request& value);
[[nodiscard]] v1::Reply ToWire(const Reply& value);

// Reads move what is large (ranges, bytes) out of the argument.
[[nodiscard]] SessionRequest FromWire(v1::SessionRequest&& wire);
[[nodiscard]] SessionState FromWire(v1::SessionState&& wire);
[[nodiscard]] ScanSample FromWire(v1::Scan&& wire);
[[nodiscard]] OdometrySample FromWire(v1::Odometry&& wire);
[[nodiscard]] PoseReport FromWire(v1::PoseReport&& wire);
[[nodiscard]] Ledger FromWire(v1::Ledger&& wire);
[[nodiscard]] MapInfo FromWire(v1::MapInfo&& wire);
[[nodiscard]] TileSample FromWire(v1::Tile&& wire);
[[nodiscard]] Job FromWire(v1::Job&& wire);
[[nodiscard]] Request FromWire(v1::Request&& wire);
[[nodiscard]] Reply FromWire(v1::Reply&& wire);

// The parts several values share.
[[nodiscard]] v1::Pose2 ToWire(const Pose2& value);
[[nodiscard]] Pose2 FromWire(const v1::Pose2& wire);
[[nodiscard]] v1::Status ToWire(const Status& value);
[[nodiscard]] Status FromWire(v1::Status&& wire);
[[nodiscard]] v1::TileContent ContentToWire(const Tile& value);
void ContentFromWire(v1::TileContent&& wire, Tile& value);

// Tile coordinates are 16 bits in the key (with an 8-byte site it must stay within 16 bytes): +-209 km at 5 cm.
[[nodiscard]] bool FitsTileKey(const TileKey& key);

}  // namespace cairn::wire
