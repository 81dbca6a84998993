// Writes the learnt models as options, in YAML.
#include "common/options/config.h"
#include "server/slam/dpslam/dpslam_options.h"
#include "server/slam/motion_models/motion_sampling.h"
#include "server/tools/calibrate/motion_run.h"

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
  // Check that cairn-offline and cairnd would accept the file.
  if (const auto applied = ApplyYaml(yaml, "what was learnt", visit); !applied) return tl::unexpected(applied.error());
  return yaml;
}

}  // namespace cairn::server
