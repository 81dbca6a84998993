// What was learnt as options, in YAML.
#include "common/options/config.h"
#include "server/calibrate/motion_run.h"
#include "server/slam/dpslam/dpslam_options.h"
#include "server/slam/motion/motion_sampling.h"

namespace cairn::server {

Result<std::string> ReportConfig(const MotionReport& report, bool with_odometry) {
  if (!report.matcher) return Fail(StatusCode::kInvalidArgument, "the scan matcher's model was not learnt");
  slam::LearntMotion learnt{report.eliazar.model, report.matcher->model};
  auto model = with_odometry ? slam::MotionModel::kEliazar : slam::MotionModel::kScanMatching;
  auto low = with_odometry ? slam::LowMotion::kEliazar : slam::LowMotion::kScanMatching;
  const VisitOptions visit = [&](OptionVisitor& visitor) {
    visitor.Section("slam", "Learnt by cairn-calibrate motion.", [&] {
      visitor.Section("motion", "", [&] { slam::Visit(visitor, learnt); });
      visitor.Section("fastslam", "", [&] { visitor.Section("motion", "", [&] { slam::Visit(visitor, model); }); });
      visitor.Section("dpslam", "", [&] { slam::Visit(visitor, low); });
    });
  };
  std::string yaml = PrintYaml(visit);
  // What the programs would refuse is not worth writing.
  if (const auto applied = ApplyYaml(yaml, "what was learnt", visit); !applied) return tl::unexpected(applied.error());
  return yaml;
}

}  // namespace cairn::server
