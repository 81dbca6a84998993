#include "server/tools/calibrate/log_steps.h"

#include <cmath>
#include <memory>
#include <optional>

#include "common/bag/recording.h"
#include "server/slam/matching/point_index.h"
#include "server/slam/motion/step_motion.h"
#include "server/slam/scan/beam_points.h"
#include "server/slam/scan/odometry_pairing.h"
#include "server/slam/scan_pipeline.h"
#include "server/slam/tracking/front_end.h"

namespace cairn::server {
namespace {

class StepTaker {
 public:
  StepTaker(const LogStepOptions& options, const slam::ParallelFor& parallel_for)
      : options_(options),
        matcher_(slam::MakeMatcher(options.slam.matcher, options.slam.matching)),
        parallel_for_(parallel_for) {}

  void Take(const Scan& scan, const Pose2& T_odom_robot) {
    if (!last_) {
      last_ = Sight{scan.stamp, T_odom_robot, slam::Look(scan, options_.slam.front_end)};
      return;
    }
    const Pose2 odometry = Between(last_->T_odom_robot, T_odom_robot);
    if (!slam::MovedEnough(odometry, options_.slam.gate)) return;
    Sight now{scan.stamp, T_odom_robot, slam::Look(scan, options_.slam.front_end)};
    if (odometry.translation().norm() <= options_.max_step_m) {
      Measure(now, odometry);
    } else {
      speed_.Forget();
    }
    last_ = std::move(now);
  }

  [[nodiscard]] bool full() const {
    return options_.max_steps > 0 && result_.steps.size() >= static_cast<std::size_t>(options_.max_steps);
  }
  [[nodiscard]] LogSteps& result() { return result_; }

 private:
  struct Sight {
    Stamp stamp = 0;
    Pose2 T_odom_robot;
    slam::ScanView view;
  };

  void Measure(const Sight& now, const Pose2& odometry) {
    LogStep step{last_->stamp, now.stamp, odometry, {}, {}, 0.0};
    const Eigen::Matrix3d wide =
        Eigen::Vector3d(options_.wide_m, options_.wide_m, options_.wide_rad).cwiseAbs2().asDiagonal();
    const slam::PointIndex reference(last_->view.points_robot);
    step.match = slam::AlignPointsToSurfaces(now.view.points_robot, reference, {odometry, odometry, wide},
                                             options_.slam.front_end.refine);

    const double seconds = SecondsFromStamp(now.stamp - last_->stamp);
    const Pose2 forecast = speed_.Forecast(seconds);
    step.lambda_m = std::abs(forecast.x);
    step.blind = matcher_.match(last_->view, now.view, {forecast, wide}, parallel_for_);
    // The forecast is updated from scan matching only, never from odometry.
    if (step.match.converged || step.blind.converged) {
      speed_.Moved(step.match.converged ? step.match.T_ref_curr : step.blind.T_ref_curr, seconds);
    } else {
      speed_.Forget();
    }
    result_.steps.push_back(step);
  }

  const LogStepOptions& options_;
  const slam::ScanMatcher matcher_;
  const slam::ParallelFor& parallel_for_;
  std::optional<Sight> last_;
  slam::ConstantSpeed speed_;
  LogSteps result_;
};

}  // namespace

bool IsMeasured(const LogStep& step) {
  return step.match.converged && !step.match.degenerate && IsCovariance(step.match.covariance);
}

Result<LogSteps> MeasureSteps(const std::filesystem::path& log, const LogStepOptions& options,
                              const slam::ParallelFor& parallel_for) {
  StepTaker taker(options, parallel_for);
  int unusable = 0;
  slam::OdometryPairing pairing(options.slam.pairing, {.paired =
                                                           [&](slam::PairedScan&& pair) {
                                                             if (!pair.has_odometry) {
                                                               ++unusable;
                                                               return;
                                                             }
                                                             taker.Take(*pair.at_stamp, pair.T_odom_robot);
                                                           },
                                                       .dropped = [&](const Scan&, DropReason) { ++unusable; }});
  auto summary = ReadRecording(log, options.reader, [&](LogRecord&& record) {
    if (const auto* odometry = std::get_if<Odometry>(&record)) {
      if (ValidateOdometry(*odometry)) pairing.Add(*odometry);
    } else if (auto scan = std::make_shared<const Scan>(std::move(std::get<Scan>(record)));
               !ValidateScan(*scan) || slam::IsTilted(*scan, options.slam.max_tilt_rad)) {
      ++unusable;
    } else {
      pairing.Add(std::move(scan));
    }
    return !taker.full();
  });
  if (!summary) return tl::unexpected(summary.error());
  pairing.Finish();
  LogSteps result = std::move(taker.result());
  result.scans = summary->scans;
  result.unusable_scans = unusable;
  return result;
}

}  // namespace cairn::server
