#include "server/slam/scan/surface_points.h"

#include <algorithm>
#include <cmath>

#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

// Bounds on the work that one scan can cause. The scans of usual scanners among walls stay far below them.
constexpr std::size_t kMaxPoints = 2048;
constexpr std::size_t kMaxNeighbours = 512;  // Neighbours on either side of a point.

// Largest distance between the hits of two neighbouring beams on one surface: so many distances between neighbouring
// beams at that range, within two bounds. Half or twice of these changes the errors no more than another seed (study
// `sensitivity`).
constexpr double kGapSteps = 6.0;
constexpr double kLeastGapM = 0.175;
constexpr double kLargestGapM = 0.7;

// The moments of the consecutive hits that lie on the surface of a hit: near to it, and without a jump in between. They
// are relative to the hit, where the numbers are small.
class Neighbourhood {
 public:
  Neighbourhood(const std::vector<BeamPoint>& hits, std::size_t centre, double step, const SurfaceOptions& options)
      : hits_(hits), centre_(hits[centre].p_robot), skipped_beams_(options.skipped_beams) {
    // Distant points lie far apart, so they need a wider span to have neighbours at all.
    const double span = std::max(options.neighbour_span_m, options.span_steps * hits[centre].range_m * step);
    const double gap = std::clamp(kGapSteps * hits[centre].range_m * step, kLeastGapM, kLargestGapM);
    span_m2_ = span * span;
    gap_m2_ = gap * gap;
    for (std::size_t i = centre; i > 0 && centre - i < kMaxNeighbours && Reaches(i, i - 1); --i) {
    }
    for (std::size_t i = centre; i + 1 < hits.size() && i - centre < kMaxNeighbours && Reaches(i, i + 1); ++i) {
    }
  }

  // Unit vector across the surface, towards the sensor; zero if the surface is not flat.
  [[nodiscard]] Eigen::Vector2d Normal(const Eigen::Vector2d& p_sensor, double max_flatness) const {
    if (count_ < 3.0) return Eigen::Vector2d::Zero();
    const Eigen::Vector2d mean = sum_ / count_;
    const double xx = xx_ - sum_.x() * mean.x(), xy = xy_ - sum_.x() * mean.y(), yy = yy_ - sum_.y() * mean.y();
    // The eigenvalues of the scatter matrix, and the eigenvector of the smaller one without a difference of like
    // numbers.
    const double half_sum = 0.5 * (xx + yy), half_difference = 0.5 * (xx - yy);
    const double radius = std::sqrt(half_difference * half_difference + xy * xy);
    if (!(half_sum - radius < max_flatness * (half_sum + radius))) return Eigen::Vector2d::Zero();
    Eigen::Vector2d normal = half_difference >= 0.0 ? Eigen::Vector2d(-xy, half_difference + radius)
                                                    : Eigen::Vector2d(radius - half_difference, -xy);
    normal.normalize();
    return normal.dot(p_sensor - centre_ - mean) < 0 ? Eigen::Vector2d(-normal) : normal;
  }

 private:
  // Takes up the hit `next`, if it belongs to the surface on which its neighbour `at` lies.
  bool Reaches(std::size_t at, std::size_t next) {
    const Eigen::Vector2d d = hits_[next].p_robot - centre_;
    if ((hits_[next].p_robot - hits_[at].p_robot).squaredNorm() >= gap_m2_ || d.squaredNorm() >= span_m2_ ||
        std::abs(hits_[next].beam - hits_[at].beam) > skipped_beams_)
      return false;
    count_ += 1.0;
    sum_ += d;
    xx_ += d.x() * d.x();
    xy_ += d.x() * d.y();
    yy_ += d.y() * d.y();
    return true;
  }

  const std::vector<BeamPoint>& hits_;
  const Eigen::Vector2d centre_;
  const std::int64_t skipped_beams_;
  double span_m2_ = 0.0, gap_m2_ = 0.0;
  double count_ = 1.0;  // With the hit itself.
  Eigen::Vector2d sum_ = Eigen::Vector2d::Zero();
  double xx_ = 0.0, xy_ = 0.0, yy_ = 0.0;
};

// The normal of a wall that is seen at a grazing angle: the hits of neighbouring beams lie far apart, but on
// one line.
Eigen::Vector2d GrazingNormalOf(const std::vector<BeamPoint>& hits, std::size_t centre, const Eigen::Vector2d& p_sensor,
                                const SurfaceOptions& options) {
  const auto each_side = static_cast<std::size_t>(options.grazing_beams);
  std::size_t first = centre, last = centre;
  while (first > 0 && centre - first < each_side && hits[first].beam - hits[first - 1].beam == 1) --first;
  while (last + 1 < hits.size() && last - centre < each_side && hits[last + 1].beam - hits[last].beam == 1) ++last;
  if (last - first < 3) return Eigen::Vector2d::Zero();
  const Eigen::Vector2d along = (hits[last].p_robot - hits[first].p_robot).normalized();
  const Eigen::Vector2d across(-along.y(), along.x());
  for (std::size_t i = first; i < last; ++i) {
    const Eigen::Vector2d step = hits[i + 1].p_robot - hits[i].p_robot;
    if (step.norm() > options.grazing_gap_m || step.dot(along) < 0.0) return Eigen::Vector2d::Zero();
    if (std::abs(across.dot(hits[i].p_robot - hits[first].p_robot)) > options.grazing_flat_m)
      return Eigen::Vector2d::Zero();
  }
  return across.dot(p_sensor - hits[centre].p_robot) < 0 ? Eigen::Vector2d(-across) : across;
}

}  // namespace

void Visit(OptionVisitor& visitor, SurfaceOptions& options) {
  visitor.Real("max_range_m", options.max_range_m, "m", 1.0, 200.0,
               ForOperators("Points farther away than this are not matched. Larger values help in wide halls, if the "
                            "laser is accurate so far."));
  visitor.Real("min_spacing_m", options.min_spacing_m, "m", 0.0, 1.0,
               "Smallest distance between two points that are used. A larger value is faster and coarser.");
  visitor.Real("neighbour_span_m", options.neighbour_span_m, "m", 0.02, 2.0,
               "Points within this distance determine the direction of a surface. A larger value is smoother, and "
               "rounds corners.");
  visitor.Real("max_flatness", options.max_flatness, "1", 0.001, 1.0,
               "A point has a direction only if the variance of its neighbours across the surface is below this share "
               "of that along it.");
  visitor.Real("grazing_gap_m", options.grazing_gap_m, "m", 0.0, 20.0,
               "Points of neighbouring beams that are farther apart do not lie on one wall.");
  visitor.Real("grazing_flat_m", options.grazing_flat_m, "m", 0.0, 1.0,
               "Points of a wall that is seen at a small angle deviate at most by this from a line.");
  visitor.Real(
      "span_steps", options.span_steps, "1", 0.0, 100.0,
      "The span is at least so many distances between neighbouring beams at the range of the point. With twice "
      "the value the error in a simulated corridor is half as large, and the map of neato is 1.1 times as "
      "blurred.");
  visitor.Integer(
      "skipped_beams", options.skipped_beams, "beams", 1, 100,
      "Beams from one hit of a surface to the next, those without a hit included. With 2 the path in the "
      "corridor of the log furo is 0.7 times as far from the odometry, and the walls of the map of neato are "
      "1.1 times as thick.");
  visitor.Integer(
      "grazing_beams", options.grazing_beams, "beams", 1, 100,
      "Points to either side from which the direction of a wall that is seen at a small angle is taken. With "
      "4 the error in a simulated corridor is half as large, and the online error on mit-csail is 1.3 times "
      "as large.");
}

std::vector<SurfacePoint> SurfacePointsOf(std::span<const BeamPoint> points, const Scan& scan,
                                          const SurfaceOptions& options) {
  std::vector<BeamPoint> hits(points.begin(), points.end());
  std::erase_if(hits, [&](const BeamPoint& hit) { return hit.range_m > options.max_range_m; });
  const double step = std::abs(scan.angle_step_rad);
  const Eigen::Vector2d p_sensor = scan.T_robot_laser.translation();
  std::vector<SurfacePoint> surface;
  const std::size_t stride = hits.size() / kMaxPoints + 1;
  surface.reserve(hits.size() / stride + 1);
  for (std::size_t i = 0; i < hits.size(); i += stride) {
    if (!surface.empty() && (hits[i].p_robot - surface.back().p).norm() < options.min_spacing_m) continue;
    Eigen::Vector2d normal = Neighbourhood(hits, i, step, options).Normal(p_sensor, options.max_flatness);
    if (normal.isZero()) normal = GrazingNormalOf(hits, i, p_sensor, options);
    surface.push_back({hits[i].p_robot, normal});
  }
  return surface;
}

}  // namespace cairn::slam
