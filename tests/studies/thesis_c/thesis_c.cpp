#include "tests/studies/thesis_c/thesis_c.h"

namespace cairn::studies {
namespace {

void RunThesisC(StudyContext& context) {
  context.report.Text(
      "Scan matching by NDT and differential evolution beside chapter 5 of thesis C. Its figures are curves without "
      "numbers: what it says of them in words stands in the column `thesis`. DP-SLAM's memory and loops (3.2.3, 4.5) "
      "and "
      "the 3D maps (5.4) are measured by the studies of those systems.");
  struct Part {
    const char* name;
    void (*run)(StudyContext&);
  };
  constexpr Part kParts[] = {{"evolution", StudyEvolution},
                             {"noise", StudyRangeNoise},
                             {"basin", StudyNewtonBasin},
                             {"fitness", StudyFitness},
                             {"dpslam", StudyDpSlamWithoutOdometry}};
  for (const Part& part : kParts)
    if (context.Wants(part.name)) part.run(context);
}

const Registration kRegistered{"thesis-c", "NDT and differential evolution beside the figures of thesis C", RunThesisC};

}  // namespace
}  // namespace cairn::studies
