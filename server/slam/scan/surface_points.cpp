#include "server/slam/scan/surface_points.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "server/slam/scan/beam_points.h"

namespace cairn::slam {
namespace {

// Bounds on the work that one scan can cause. The scans of usual scanners among walls stay far below them.
constexpr std::size_t kMaxPoints = 2048;
constexpr std::size_t kMaxNeighbours = 512;  // Neighbours on either side of a point.

constexpr double kMostOfOnePoint = 64.0;  // Hits.

// Largest distance between the hits of two neighbouring beams on one surface: so many distances between neighbouring
// beams at that range, within two bounds. Half or twice of these changes the errors no more than another seed (study
// `sensitivity`).
constexpr double kGapSteps = 6.0;
constexpr double kLeastGapM = 0.175;
constexpr double kLargestGapM = 0.7;

// The same as `std::sqrt(squared) < limit`. The root is drawn only where the squares do not decide.
bool IsShorter(double squared, double limit) {
  constexpr double kRounding = 1e-14;  // More than the rounding of a square and of a root.
  const double limit2 = limit * limit;
  if (squared < limit2 * (1.0 - kRounding)) return true;
  return squared <= limit2 * (1.0 + kRounding) && std::sqrt(squared) < limit;
}

// The consecutive hits around `centre` that lie on its surface: near to it, and without a jump in between.
std::pair<std::size_t, std::size_t> Neighbourhood(const std::vector<BeamPoint>& hits, std::size_t centre, double step,
                                                  const SurfaceOptions& options) {
  // Distant points lie far apart, so they need a wider span to have neighbours at all.
  const double span = std::max(options.neighbour_span_m, options.span_steps * hits[centre].range_m * step);
  const double gap = std::clamp(kGapSteps * hits[centre].range_m * step, kLeastGapM, kLargestGapM);
  const auto connected = [&](std::size_t a, std::size_t b) {
    return IsShorter((hits[a].p_robot - hits[b].p_robot).squaredNorm(), gap) &&
           std::abs(hits[a].beam - hits[b].beam) <= options.skipped_beams;
  };
  const auto within_span = [&](std::size_t other) {
    return IsShorter((hits[other].p_robot - hits[centre].p_robot).squaredNorm(), span);
  };
  std::size_t first = centre, last = centre;
  while (first > 0 && centre - first < kMaxNeighbours && connected(first, first - 1) && within_span(first - 1)) --first;
  while (last + 1 < hits.size() && last - centre < kMaxNeighbours && connected(last, last + 1) && within_span(last + 1))
    ++last;
  return {first, last};
}

Eigen::Vector2d MeanOf(const std::vector<BeamPoint>& hits, std::size_t begin, std::size_t end) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (std::size_t i = begin; i < end; ++i) sum += hits[i].p_robot;
  return sum / static_cast<double>(end - begin);
}

// The number of consecutive hits that one point stands for, so that points have at least this spacing. It follows from
// the mean distance between the hits around, and not from the hits themselves: to take the next hit that is far enough
// from the last one prefers hits whose noise leads away from it, which moves walls that recede from the sensor outwards
// and others inwards.
std::size_t HitsOfOnePoint(const std::vector<BeamPoint>& hits, std::pair<std::size_t, std::size_t> around,
                           double spacing_m) {
  const auto [first, last] = around;
  if (first == last) return 1;
  const double each_m = (hits[last].p_robot - hits[first].p_robot).norm() / static_cast<double>(last - first);
  return spacing_m <= each_m ? 1 : static_cast<std::size_t>(std::ceil(std::min(spacing_m / each_m, kMostOfOnePoint)));
}

Eigen::Vector2d NormalOf(const std::vector<BeamPoint>& hits, std::size_t first, std::size_t last,
                         const Eigen::Vector2d& p_sensor, double max_flatness) {
  if (last - first + 1 < 3) return Eigen::Vector2d::Zero();
  const Eigen::Vector2d mean = MeanOf(hits, first, last + 1);
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (std::size_t i = first; i <= last; ++i) {
    const Eigen::Vector2d d = hits[i].p_robot - mean;
    scatter += d * d.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(scatter);
  if (!(solver.eigenvalues()(0) < max_flatness * solver.eigenvalues()(1))) return Eigen::Vector2d::Zero();
  Eigen::Vector2d normal = solver.eigenvectors().col(0).normalized();
  if (normal.dot(p_sensor - mean) < 0) normal = -normal;
  return normal;
}

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
  for (std::size_t begin = 0, next = 0; begin < hits.size(); begin = next) {
    auto around = Neighbourhood(hits, begin, step, options);
    const std::size_t end = std::min(begin + HitsOfOnePoint(hits, around, options.min_spacing_m), around.second + 1);
    next = std::max(end, begin + stride);
    const std::size_t middle = (begin + end - 1) / 2;
    if (middle != begin) around = Neighbourhood(hits, middle, step, options);
    Eigen::Vector2d normal = NormalOf(hits, around.first, around.second, p_sensor, options.max_flatness);
    if (normal.isZero()) normal = GrazingNormalOf(hits, middle, p_sensor, options);
    // Hits on a rough surface are not averaged, because the mean of a corner or of two surfaces lies on neither.
    surface.push_back({normal.isZero() ? hits[middle].p_robot : MeanOf(hits, begin, end), normal});
  }
  return surface;
}

}  // namespace cairn::slam
