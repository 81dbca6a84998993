#include "server/slam/matching/scan_matching.h"

#include <array>

namespace cairn::slam {
namespace {

constexpr std::array<std::string_view, 7> kNames = {"voting", "line_lsq", "hough",      "ndt",
                                                    "ndt_de", "icp",      "correlative"};

// The answer of a matcher this build does not have.
MatchResult Unmatched(const MatchPrior& prior) {
  MatchResult result;
  result.T_prev_curr = prior.T_prev_curr;
  result.covariance = prior.covariance;
  result.failure = MatchFailure::kNotConverged;
  return result;
}

}  // namespace

std::span<const std::string_view> MatcherNames() {
  return kNames;
}

std::string_view MatcherName(MatcherKind kind) {
  return kNames[static_cast<std::size_t>(kind)];
}

void Visit(OptionVisitor& visitor, MatcherOptions& options) {
  visitor.Section("voting", "Seven criteria vote for pairs of lines.", [&] { Visit(visitor, options.voting); });
  visitor.Section("icp", "Points on surfaces, scan to scan.", [&] { Visit(visitor, options.icp); });
}

MatchResult MatchScans(const ScanView& prev, const ScanView& curr, const MatchPrior& prior, MatcherKind kind,
                       const MatcherOptions& options, const ParallelFor& /*parallel_for*/) {
  switch (kind) {
    case MatcherKind::kVoting:
      return MatchByVoting(prev.features, curr.features, prior.T_prev_curr, options.voting);
    case MatcherKind::kLineLsq:
      return Unmatched(prior);
    case MatcherKind::kHough:
      return Unmatched(prior);
    case MatcherKind::kNdt:
      return Unmatched(prior);
    case MatcherKind::kNdtDe:
      return Unmatched(prior);
    case MatcherKind::kIcp:
      return MatchByIcp(prev, curr, prior, options.icp);
    case MatcherKind::kCorrelative:
      return Unmatched(prior);
  }
  return Unmatched(prior);
}

}  // namespace cairn::slam
