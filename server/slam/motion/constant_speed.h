// The speed of the robot's last step, and the motion that this speed forecasts for the next step. Not a
// filter: only the last step counts. Frame: T_prev_curr in the robot frame, x forward; the sideways speed is
// taken as zero. Not thread-safe.
// Source: thesis C 5.2 (lambda = |dt V|, there from the displacement between the previous scans).
#pragma once

#include <optional>

#include "common/geometry/pose2.h"

namespace cairn::slam {

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
    }
  };
  std::optional<Speed> speed_;
};

}  // namespace cairn::slam
