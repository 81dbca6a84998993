// The constants whose influence the study measures: options and fields that are not options, each with a name
// and a way to change it. The comment of each field says what it is for. Stateless.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/slam/mapper_options.h"

namespace cairn::studies {

// The runs that are made with a constant.
enum class Runs : std::uint8_t {
  kUsual = 0,  // The defaults on every log but the longest.
  kLoops,      // ... and on the longest, whose large loops only these constants concern.
  kDpSlam,     // The filter dpslam instead.
  kNdtAlone,   // The matcher ndt, without odometry and without the refinement.
  kRolling,    // Lidars that measure one beam after the other, with the timing that is known of them.
  kMoved,      // Robots that nobody watched for a while: the study `moved` runs them.
  kSelfCheck,  // Only the verdicts of the self check, along paths made once.
};

struct Constant {
  std::string name;
  Runs runs = Runs::kUsual;
  // Halves the constant (-1), keeps it (0) or doubles it (+1), and returns its value. A share stays below 1:
  // its distance to 1 is halved if twice the share would be more than halfway there.
  std::function<double(slam::MapperOptions& options, int direction)> change;
};

[[nodiscard]] std::vector<Constant> AllConstants();
// Those of the study `moved`, which are not among AllConstants.
[[nodiscard]] std::vector<Constant> RecoveryConstants();

}  // namespace cairn::studies
