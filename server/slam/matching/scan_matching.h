// Every scan matcher behind one call: which one is a choice of the configuration, what it answers is always a
// MatchResult. Not a hierarchy: a switch over functions that know nothing of each other.
// Frames: `prev` and `curr` in the robot frames of their scans; the prior and the answer are T_prev_curr.
// A matcher that does not converge answers the prior with its covariance and says why. Stateless, thread-safe; the
// result does not depend on how `parallel_for` splits the work.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "common/options/option_visitor.h"
#include "server/slam/match_result.h"
#include "server/slam/matching/correlative.h"
#include "server/slam/matching/hough.h"
#include "server/slam/matching/icp.h"
#include "server/slam/matching/line_lsq.h"
#include "server/slam/matching/match_prior.h"
#include "server/slam/matching/ndt.h"
#include "server/slam/matching/ndt_de.h"
#include "server/slam/matching/scan_view.h"
#include "server/slam/matching/voting.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

enum class MatcherKind : std::uint8_t { kVoting = 0, kLineLsq, kHough, kNdt, kNdtDe, kIcp, kCorrelative };
// In the order of the enum.
[[nodiscard]] std::span<const std::string_view> MatcherNames();
[[nodiscard]] std::string_view MatcherName(MatcherKind kind);

// Whether a matcher looks so far around the prior that starting it elsewhere finds nothing new.
[[nodiscard]] constexpr bool SearchesWide(MatcherKind kind) {
  return kind == MatcherKind::kHough || kind == MatcherKind::kNdtDe;
}

// Whether a matcher is as exact from a metre away as from nearby, so that a reference that still explains the scan is
// better kept: each change of the reference adds an error. Lines and cells change too much with the place they are
// seen from.
[[nodiscard]] constexpr bool KeepsReference(MatcherKind kind) {
  return kind == MatcherKind::kIcp || kind == MatcherKind::kCorrelative;
}

struct MatcherOptions {
  VotingOptions voting;
  NdtOptions ndt;
  NdtDeOptions ndt_de;
  LineLsqOptions line_lsq;
  HoughOptions hough;
  PointToLineOptions icp;
  CorrelativeOptions correlative;
};
void Visit(OptionVisitor& visitor, MatcherOptions& options);

[[nodiscard]] MatchResult MatchScans(const ScanView& prev, const ScanView& curr, const MatchPrior& prior,
                                     MatcherKind kind, const MatcherOptions& options, const ParallelFor& parallel_for);

}  // namespace cairn::slam
