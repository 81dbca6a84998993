#include "server/slam/match_result.h"

namespace cairn::slam {

std::string_view MatchFailureName(MatchFailure failure) {
  switch (failure) {
    case MatchFailure::kNone:
      return "none";
    case MatchFailure::kTooFewFeatures:
      return "too_few_features";
    case MatchFailure::kNoPairs:
      return "no_pairs";
    case MatchFailure::kInconsistent:
      return "inconsistent";
    case MatchFailure::kNotConverged:
      return "not_converged";
    case MatchFailure::kFault:
      return "fault";
  }
  return "unknown";
}

}  // namespace cairn::slam
