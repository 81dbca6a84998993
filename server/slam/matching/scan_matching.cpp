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
  visitor.Section("ndt", "Normal distributions, Newton's algorithm.", [&] { Visit(visitor, options.ndt); });
  visitor.Section("ndt_de", "Normal distributions, searched by differential evolution.",
                  [&] { Visit(visitor, options.ndt_de); });
  visitor.Section("line_lsq", "Least squares over pairs of lines.", [&] { Visit(visitor, options.line_lsq); });
  visitor.Section("hough", "Correlation in the Hough domain.", [&] { Visit(visitor, options.hough); });
  visitor.Section("icp", "Points on surfaces, scan to scan.", [&] { Visit(visitor, options.icp); });
  visitor.Section("correlative", "Every motion in a window.", [&] { Visit(visitor, options.correlative); });
}

MatchResult MatchScans(const ScanView& prev, const ScanView& curr, const MatchPrior& prior, MatcherKind kind,
                       const MatcherOptions& options, const ParallelFor& parallel_for) {
  switch (kind) {
    case MatcherKind::kVoting:
      return MatchByVoting(prev.features, curr.features, prior.T_prev_curr, options.voting);
    case MatcherKind::kLineLsq:
      return MatchByLineLsq(prev.features, curr.features, prior, options.line_lsq);
    case MatcherKind::kHough:
      return MatchByHough(prev, curr, prior, options.hough, parallel_for);
    case MatcherKind::kNdt:
      return MatchByNdt(prev, curr, prior, options.ndt, parallel_for);
    case MatcherKind::kNdtDe:
      return MatchByDifferentialEvolution(prev, curr, prior, options.ndt_de, parallel_for);
    case MatcherKind::kIcp:
      return MatchByIcp(prev, curr, prior, options.icp);
    case MatcherKind::kCorrelative:
      return MatchByCorrelation(prev, curr, prior, options.correlative, parallel_for);
  }
  return Unmatched(prior);
}

}  // namespace cairn::slam
