// One value of each kind on the wire with every field set, at the edges of its range where it has any.
#pragma once

#include "common/service/request.h"
#include "common/service/stream.h"

namespace cairn::wire {

[[nodiscard]] SessionRequest ExtremeSessionRequest();
[[nodiscard]] SessionState ExtremeSessionState();
[[nodiscard]] SessionRefusal ExtremeSessionRefusal();
[[nodiscard]] ScanSample ExtremeScan(std::size_t beams);
[[nodiscard]] OdometrySample ExtremeOdometry();
[[nodiscard]] PoseReport ExtremePose();
[[nodiscard]] Ledger ExtremeLedger();
[[nodiscard]] MapInfo ExtremeMapInfo();
[[nodiscard]] TileSample ExtremeTile(std::size_t bytes);
[[nodiscard]] Job ExtremeJob();
[[nodiscard]] Request ExtremeRequest();
[[nodiscard]] Reply ExtremeReply();

// Field by field, bit by bit (NaN equals itself).
[[nodiscard]] bool Same(const SessionRequest& a, const SessionRequest& b);
[[nodiscard]] bool Same(const SessionState& a, const SessionState& b);
[[nodiscard]] bool Same(const SessionRefusal& a, const SessionRefusal& b);
[[nodiscard]] bool Same(const ScanSample& a, const ScanSample& b);
[[nodiscard]] bool Same(const OdometrySample& a, const OdometrySample& b);
[[nodiscard]] bool Same(const PoseReport& a, const PoseReport& b);
[[nodiscard]] bool Same(const Ledger& a, const Ledger& b);
[[nodiscard]] bool Same(const MapInfo& a, const MapInfo& b);
[[nodiscard]] bool Same(const TileSample& a, const TileSample& b);
[[nodiscard]] bool Same(const Job& a, const Job& b);
[[nodiscard]] bool Same(const Request& a, const Request& b);
[[nodiscard]] bool Same(const Reply& a, const Reply& b);

}  // namespace cairn::wire
