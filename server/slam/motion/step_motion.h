// The measured motion of a robot from one keyframe to the next, from which a filter predicts, and the noise of
// such a step. Metres and radians.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <string_view>

#include "common/geometry/pose2.h"
#include "common/options/option_visitor.h"

namespace cairn::slam {

// The uncertainty of a matched or dead-reckoned step: noise of (x, y, theta) that grows with the distance and
// the turn.
// Source: the proportional model of thesis A (4-3), in the manner of Thrun et al. 2005, 5.4.
struct MotionNoise {
  double trans_base_m = 0.0;
  double trans_per_m = 0.0;
  double trans_per_rad = 0.0;
  double rot_base_rad = 0.0;
  double rot_per_m = 0.0;
  double rot_per_rad = 0.0;

  // Diagonal covariance of (x, y, theta) of a step, in the frame in which the step starts.
  [[nodiscard]] Eigen::Matrix3d Covariance(const Pose2& T_prev_curr) const;
};
void Visit(OptionVisitor& visitor, MotionNoise& options);

// The uncertainty of steps that only odometry shows: a random walk. Its variances grow in proportion to the distance
// and to the turn, so that their sum does not depend on how many scans or steps a motion is cut into. An error of the
// scale of odometry grows faster; where a whole motion is known, MotionNoise says it.
// The default values of distances are what the odometry of intel and mit-csail shows against their smoothed paths, over
// straight stretches of 1 to 5 m: 0.04 to 0.07 m/sqrt(m) and 0.05 to 0.09 rad/sqrt(m). Those of turns are estimates.
// Source: Chong, Kleeman, ICRA 1997.
struct OdometryNoise {
  double trans_m_per_sqrt_m = 0.06;
  double trans_m_per_sqrt_rad = 0.02;
  double rot_rad_per_sqrt_m = 0.07;
  double rot_rad_per_sqrt_rad = 0.1;

  // Diagonal covariance of (x, y, theta) of a motion, in the frame in which it starts.
  [[nodiscard]] Eigen::Matrix3d Covariance(double distance_m, double turn_rad) const;
  [[nodiscard]] Eigen::Matrix3d Covariance(const Pose2& T_prev_curr) const {
    return Covariance(T_prev_curr.translation().norm(), std::abs(T_prev_curr.theta));
  }
};
void Visit(OptionVisitor& visitor, OdometryNoise& options);

struct StepMotion {
  Pose2 T_prev_curr;  // Result of the front-end: matched, or odometry or a forecast if nothing matched.
  // Covariance of (x, y, theta) of T_prev_curr, in the frame in which the step starts. The noise of the
  // filter's own motion model is not included.
  Eigen::Matrix3d covariance_prev = Eigen::Matrix3d::Zero();
  std::optional<Pose2> T_prev_curr_odom{};  // From odometry alone; empty if odometry is withheld.
  double lambda_m = 0.0;  // Distance forward at the speed of the previous step; 0 if that is not known.

  // The same step as odometry alone measured it, for motion models of odometry; the covariance of the match
  // is left out. Without odometry the step is returned unchanged.
  [[nodiscard]] StepMotion ByOdometry() const {
    return T_prev_curr_odom ? StepMotion{*T_prev_curr_odom, Eigen::Matrix3d::Zero(), T_prev_curr_odom, lambda_m}
                            : *this;
  }
};

// The speed of the robot's last step, and the motion that this speed forecasts for the next step. Not a
// filter: only the last step counts. Frame: T_prev_curr in the robot frame, x forward; the sideways speed is
// taken as zero. Not thread-safe.
// Source: thesis C 5.2 (lambda = |dt V|, there from the displacement between the previous scans).
class ConstantSpeed {
 public:
  void Moved(const Pose2& T_prev_curr, double seconds) {
    speed_.reset();
    if (seconds > 0.0) speed_ = Speed{T_prev_curr.x / seconds, T_prev_curr.theta / seconds};
  }
  void Forget() { speed_.reset(); }
  // The identity if the speed is not known, or if `seconds` is too long for the speed to mean anything.
  [[nodiscard]] Pose2 Forecast(double seconds) const {
    if (!speed_ || seconds >= kLongest_s) return {};
    return {speed_->forward_m_s * seconds, 0.0, WrapAngle(speed_->turn_rad_s * seconds)};
  }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.speed_);
  }

 private:
  static constexpr double kLongest_s = 10.0;
  struct Speed {
    double forward_m_s = 0.0;
    double turn_rad_s = 0.0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.forward_m_s, self.turn_rad_s);
      archive.Require(std::abs(self.forward_m_s) <= 1e4 && std::abs(self.turn_rad_s) <= 1e4, "a speed");
    }
  };
  std::optional<Speed> speed_;
};

}  // namespace cairn::slam
