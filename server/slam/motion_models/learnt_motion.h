// The two models that `cairn-calibrate motion` learns for a robot: one of its odometry and one of its scan
// matcher.
#pragma once

#include "common/options/option_visitor.h"
#include "server/slam/motion_models/eliazar_model.h"
#include "server/slam/motion_models/scan_matching_model.h"

namespace cairn::slam {

struct LearntMotion {
  EliazarModel eliazar;
  ScanMatchingModel scan_matching;
};

inline void Visit(OptionVisitor& visitor, LearntMotion& models) {
  visitor.Section("eliazar",
                  "Model of the odometry: the distribution of the true step given the odometry (thesis C (4.46)).",
                  [&] { Visit(visitor, models.eliazar); });
  visitor.Section("scan_matching",
                  "Model of the scan matcher: the distribution of the true step given the matched one (thesis C 5.2).",
                  [&] { Visit(visitor, models.scan_matching); });
}

}  // namespace cairn::slam
