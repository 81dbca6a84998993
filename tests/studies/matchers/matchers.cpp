#include "tests/studies/matchers/matchers.h"

#include <string>

#include "tests/studies/matchers/match_trial.h"

namespace cairn::studies {
namespace {

void RunMatchers(StudyContext& context) {
  std::vector<std::string> missing;
  std::vector<slam::MatcherKind> kinds = BuiltMatchers(missing);
  std::erase_if(kinds, [&](slam::MatcherKind kind) { return !context.Wants(std::string(slam::MatcherName(kind))); });
  for (const std::string& name : missing)
    context.report.Fault("the matcher `" + name + "` is not in this build (it does not align two equal scans)");
  StudyExactness(context, kinds);
  StudySpecialCases(context, kinds);
  StudyBasins(context, kinds);
}

const Registration kRegistered{"matchers", "every scan matcher: time, bias, spread, special cases, convergence basin",
                               RunMatchers};

}  // namespace
}  // namespace cairn::studies
