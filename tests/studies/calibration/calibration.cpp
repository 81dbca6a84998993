#include "tests/studies/calibration/calibration.h"

namespace cairn::studies {
namespace {

void RunCalibration(StudyContext& context) {
  for (const auto part : {StudyUmbmark, StudyMotionModels, StudyCloud}) part(context);
}

const Registration kRegistered{
    "calibration", "wheel errors, motion models and clouds: recovered values compared with the injected ones",
    RunCalibration};

}  // namespace
}  // namespace cairn::studies
