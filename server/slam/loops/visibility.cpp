#include "server/slam/loops/visibility.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

constexpr int kMinReach = 1;   // Least number of beams to either side, because a point may lie between two.
constexpr int kMaxReach = 16;  // Largest number: near a close point the middle beams are sufficient.

enum class Visibility : std::uint8_t { kUnknown, kConfirmed, kContradicted };

// A scan, prepared for the comparison with many points.
class PreparedScan {
 public:
  PreparedScan(const Scan& scan, double near_m)
      : scan_(scan), near_m_(near_m), step_rad_(std::abs(scan.angle_step_rad)), full_turn_(IsFullTurn(scan)) {
    for (std::size_t k = 0; k < cosines_.size(); ++k) cosines_[k] = std::cos(static_cast<double>(k) * step_rad_);
  }

  [[nodiscard]] Visibility VisibilityOf(const Eigen::Vector2d& p_laser) const {
    const double range_m = p_laser.norm();
    // Angle from the first beam in the direction of the scan, in [0, 2 pi).
    double turn = std::atan2(p_laser.y(), p_laser.x()) - scan_.angle_first_rad;
    if (scan_.angle_step_rad < 0.0) turn = -turn;
    turn -= 2.0 * kPi * std::floor(turn / (2.0 * kPi));
    const double beam = std::round(turn / step_rad_);
    if (!full_turn_ && beam >= static_cast<double>(scan_.ranges_m.size())) return Visibility::kUnknown;
    const double beams_near = std::ceil(near_m_ / (range_m * step_rad_));
    const int reach = beams_near < kMaxReach ? std::max(kMinReach, static_cast<int>(beams_near)) : kMaxReach;
    return VisibilityOf(static_cast<int>(beam), reach, range_m);
  }

 private:
  // `beam` is the beam towards the point, `range_m` the point's distance, and `reach` the number of beams to
  // either side that pass near it.
  [[nodiscard]] Visibility VisibilityOf(int beam, int reach, double range_m) const {
    const int beams = static_cast<int>(scan_.ranges_m.size());
    if (beams <= 2 * reach) return Visibility::kUnknown;
    if (!full_turn_ && (beam - reach < 0 || beam + reach >= beams)) return Visibility::kUnknown;
    bool all_beyond = true;
    for (int k = -reach; k <= reach; ++k) {
      const float seen = scan_.ranges_m[static_cast<std::size_t>((beam + k + beams) % beams)];
      // A beam without a return may have met a dark surface or glass as well as free space.
      if (ClassifyRange(seen, scan_.range_min_m, scan_.range_max_m) != BeamClass::kHit) {
        all_beyond = false;
        continue;
      }
      const double seen_m = seen;
      const double cosine = cosines_[static_cast<std::size_t>(std::abs(k))];
      const double apart_m2 = seen_m * seen_m + range_m * range_m - 2.0 * seen_m * range_m * cosine;
      if (apart_m2 < near_m_ * near_m_) return Visibility::kConfirmed;
      all_beyond = all_beyond && seen_m > range_m;
    }
    return all_beyond ? Visibility::kContradicted : Visibility::kUnknown;
  }

  const Scan& scan_;
  const double near_m_;
  const double step_rad_;
  const bool full_turn_;
  std::array<double, kMaxReach + 1> cosines_{};
};

}  // namespace

VisibilityCounts CompareVisibility(const Scan& scan, const Pose2& T_scan_points, std::span<const SurfacePoint> points,
                                   double near_m, double max_range_m) {
  if (scan.tilt_rad != 0.0) return {};  // The ranges of a tilted scan are not distances on the ground.
  const Pose2 T_laser_points = scan.T_robot_laser.Inverse() * T_scan_points;
  const Eigen::Matrix2d R = T_laser_points.rotation();
  const Eigen::Vector2d t = T_laser_points.translation();
  const PreparedScan prepared(scan, near_m);
  VisibilityCounts counts;
  for (const SurfacePoint& point : points) {
    const Eigen::Vector2d p_laser = R * point.p + t;
    if (p_laser.squaredNorm() > max_range_m * max_range_m || p_laser.squaredNorm() < near_m * near_m) continue;
    const Visibility visibility = prepared.VisibilityOf(p_laser);
    counts.confirmed += visibility == Visibility::kConfirmed ? 1 : 0;
    counts.contradicted += visibility == Visibility::kContradicted ? 1 : 0;
  }
  return counts;
}

VisibilityCounts CompareBothWays(const Scan& scan_a, std::span<const SurfacePoint> points_a, const Scan& scan_b,
                                 std::span<const SurfacePoint> points_b, const Pose2& T_a_b, double near_m) {
  constexpr double kMaxRangeM = 10.0;
  VisibilityCounts counts = CompareVisibility(scan_a, T_a_b, points_b, near_m, kMaxRangeM);
  counts += CompareVisibility(scan_b, T_a_b.Inverse(), points_a, near_m, kMaxRangeM);
  return counts;
}

}  // namespace cairn::slam
