// What `cairn-calibrate motion` learns of a robot: a model of its odometry and one of its scan matcher.
#pragma once

#include "common/options/option_visitor.h"
#include "server/slam/motion/eliazar_model.h"
#include "server/slam/motion/scan_matching_model.h"

namespace cairn::slam {

struct LearntMotion {
  EliazarModel eliazar;
  ScanMatchingModel scan_matching;
};

inline void Visit(OptionVisitor& visitor, LearntMotion& models) {
  visitor.Section("eliazar", "The true step given odometry's (thesis C (4.46)).",
                  [&] { Visit(visitor, models.eliazar); });
  visitor.Section("scan_matching", "The true step given the scan matcher's (thesis C 5.2).",
                  [&] { Visit(visitor, models.scan_matching); });
}

}  // namespace cairn::slam
