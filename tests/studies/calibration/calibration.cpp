#include "tests/studies/calibration/calibration.h"

namespace cairn::studies {
namespace {

bool RunCalibration(StudyContext& context) {
  bool plausible = true;
  for (const auto part : {StudyUmbmark, StudyMotionModels, StudyCloud}) plausible = part(context) && plausible;
  return plausible;
}

const Registration kRegistered{"calibration", "wheel errors, motion models and clouds: recovered beside injected",
                               RunCalibration};

}  // namespace
}  // namespace cairn::studies
