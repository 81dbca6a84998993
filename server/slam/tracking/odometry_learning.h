// Learns, while the robot drives, what its odometry gets wrong and what changes slowly: the scale of the way and of the
// turn, the turn per metre that odometry does not notice, and by how much the stamps of scans are later than those of
// odometry. Every metre, or every radian of turn, the motion that the front-end has matched is compared with what
// odometry says of the same motion; an extended Kalman filter with slowly walking parameters takes the difference.
//
// - The direction that the scans leave open counts nothing: there the match is odometry itself. Elsewhere the matched
//   motion depends on odometry only through a generous prior, so that what was learned does not confirm itself.
// - The noise of odometry is learned with the parameters, and a difference that is large beside it (a wheel that slips,
//   a robot that is pushed) counts little (Cauchy weights).
// - A parameter is used once it is more than five standard deviations away from zero, and until it is less than three,
//   as long as the parameters explain odometry well; and never beyond the bounds in the options. Errors of turns below
//   1.5 % or 0.015 rad/m are only shown: scans correct them better.
// - The lag is learned only where there is dense odometry between the scans (PairedScan::rate). Where it is not known,
//   nothing is used, because it looks like a turn scale.
//
// Corrected() gives the odometry as it is used: the steps as reported until something is used, and from then on with
// what was learned. Not thread-safe. Deterministic.
// Source: Censi, Franchi, Marchionni, Oriolo 2013 (what matches of scans show of wheels; here one after the other);
// Larsen, Hansen, Andersen, Ravn 1998 (scales of odometry in the state of a Kalman filter).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/service/learned_value.h"
#include "server/slam/scan/scan_motion.h"
#include "server/slam/scan/wheel_correction.h"
#include "server/slam/tracking/front_end.h"

namespace cairn::slam {

struct LearningOptions {
  bool enabled = true;
  double largest_scale_error = 0.1;
  double largest_turn_per_m = 0.1;
  double largest_lag_s = 0.3;
};
void Visit(OptionVisitor& visitor, LearningOptions& options);

class OdometryLearning {
 public:
  enum Parameter : std::uint8_t { kWheelScale = 0, kTurnScale, kTurnPerM, kLag };
  static constexpr std::size_t kCount = 4;

  // Without `use_odometry` nothing is learned.
  OdometryLearning(const LearningOptions& options, bool use_odometry)
      : options_(options), on_(options.enabled && use_odometry) {}

  // The odometry of the next scan as it is used; `T_odom_robot` is as it came. `driven`: the robot has driven this step
  // since the scan before. `rate`: its speed at the scan as odometry shows it, (x, y, theta) per second in its frame.
  Pose2 Corrected(const Pose2& T_odom_robot, bool driven, const Pose2& rate);
  // What the front-end has found for the scan of the last call of Corrected.
  void Learn(const TrackStep& step);
  // The frame `track` begins anew, or the robot has to be found.
  void Interrupt() { stretch_.reset(); }
  void LearnUnless(bool interrupted, const TrackStep& step) {
    if (interrupted) return Interrupt();
    Learn(step);
  }

  // The motion within a scan, as it is used.
  [[nodiscard]] std::vector<Odometry> Corrected(const std::vector<Odometry>& during) const;
  // Whether Corrected changes anything.
  [[nodiscard]] bool corrects() const { return corrected_.has_value(); }
  // By how much scans have to be paired with earlier odometry than their stamps say.
  [[nodiscard]] double lag_s() const { return lag_s_; }
  // Beyond what the options of the pairing correct. Empty if nothing is learned.
  [[nodiscard]] std::vector<LearnedValue> values() const;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.mean_, self.covariance_, self.noise_, self.used_, self.lag_s_, self.last_, self.rate_, self.corrected_,
            self.stretch_);
    archive.Require(self.noise_ > 0.0 && std::abs(self.lag_s_) <= 10.0, "what was learned of odometry");
  }

 private:
  // The motion since the last comparison.
  struct Stretch {
    Pose2 T_track_start;
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();  // TrackStep::surface_information at the start.
    Pose2 rate;
    // By odometry as it came, and with each parameter of the wheels changed a little.
    Pose2 reported{};
    std::array<Pose2, kLag> changed{};
    double way_m = 0.0;
    double turn_rad = 0.0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.T_track_start, self.information, self.rate, self.reported, self.changed, self.way_m, self.turn_rad);
    }
  };

  using Vector = Eigen::Matrix<double, kCount, 1>;
  using Matrix = Eigen::Matrix<double, kCount, kCount>;

  [[nodiscard]] WheelCorrection wheels() const;
  [[nodiscard]] double Bounded(std::size_t parameter) const;
  void Compare(const Stretch& stretch, const TrackStep& step);
  void ChooseUsed();

  LearningOptions options_;
  bool on_;
  Vector mean_ = Vector::Zero();  // Beyond 1 where it is a scale.
  Matrix covariance_ = FirstCovariance();
  static Matrix FirstCovariance();
  double noise_ = 1.0;  // Variance of odometry's noise over what is assumed of it.
  std::array<bool, kCount> used_{};
  double lag_s_ = 0.0;         // That is in use.
  std::optional<Pose2> last_;  // Odometry at the last scan, as it came, and its speed.
  Pose2 rate_;
  std::optional<Pose2> corrected_;  // As it is used; empty as long as it is as it came.
  std::optional<Stretch> stretch_;
};

}  // namespace cairn::slam
