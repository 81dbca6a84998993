#include "tests/studies/thesis_c/thesis_c.h"

namespace cairn::studies {
namespace {

void RunThesisC(StudyContext& context) {
  context.report.Text(
      "This study repeats chapter 5 of thesis C (L. E. Ynoquio Herrera, Mobile Robot Simultaneous "
      "Localization and Mapping Using DP-SLAM with a Single Laser Range Finder, PUC-Rio 2011): scan "
      "matching with NDT and differential evolution. The thesis prints curves without numbers; the "
      "column `thesis` contains what it states about them in words. DP-SLAM's memory and loops (3.2.3, "
      "4.5) ");
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
