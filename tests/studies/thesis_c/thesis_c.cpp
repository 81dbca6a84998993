#include "tests/studies/thesis_c/thesis_c.h"

namespace cairn::studies {
namespace {

bool RunThesisC(StudyContext& context) {
  context.report.Text(
      "Scan matching by NDT and differential evolution beside chapter 5 of thesis C. Its figures are curves without "
      "numbers: what it says of them in words stands in the column `thesis`. Its DP-SLAM (5.3) and 3D maps (5.4) are "
      "measured by the studies of those systems.");
  bool plausible = StudyEvolution(context);
  plausible = StudyRangeNoise(context) && plausible;
  plausible = StudyNewtonBasin(context) && plausible;
  return StudyFitness(context) && plausible;
}

const Registration kRegistered{"thesis-c", "NDT and differential evolution beside the figures of thesis C", RunThesisC};

}  // namespace
}  // namespace cairn::studies
