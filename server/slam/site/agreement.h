// How well what two sessions have seen fits together where they lie on top of each other: the scans along one are
// compared with those of the other that are near, at the poses in `site`. It is the last check of a join: a session at
// a wrong place sees walls where the other one drove. Stateless, deterministic. Source: visibility.h.
#pragma once

#include <cstddef>

#include "server/slam/loops/visibility.h"
#include "server/slam/site/relation_search.h"

namespace cairn::slam {

struct SessionAgreement {
  VisibilityCounts counts;        // Points that were compared.
  std::size_t places = 0;         // Keyframes of `b`, a metre of way apart, that were compared.
  std::size_t contradicting = 0;  // Those of them where more than a third contradicts.
};

// Whether two sessions cannot lie so.
[[nodiscard]] bool Contradicts(const SessionAgreement& agreement);

[[nodiscard]] SessionAgreement AgreementOf(const PlacedSession& a, const PlacedSession& b, const SiteOptions& options);

}  // namespace cairn::slam
