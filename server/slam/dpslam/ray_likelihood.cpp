#include "server/slam/dpslam/ray_likelihood.h"

#include <algorithm>
#include <cmath>

#include "server/slam/dpslam/laser_rays.h"

namespace cairn::slam {
namespace {

constexpr double kBeamReach = 4.0;  // In units of sigma.

// Access to the rates of a window by cell, without and with bounds checks.
struct Inside {
  const float* rates;
  std::ptrdiff_t stride;
  [[nodiscard]] float operator()(int x, int y) const { return rates[y * stride + x]; }
};
struct Anywhere {
  const OpacityWindow& window;
  [[nodiscard]] float operator()(int x, int y) const {
    if (x < 0 || y < 0 || x >= window.width() || y >= window.height()) return 0.0F;
    return window.rates()[static_cast<std::ptrdiff_t>(y) * window.width() + x];
  }
};

// Lengths are in cells. Returns the density of the hit per cell, or the probability to pass.
template <typename Rates>
float Walk(const Rates& rates, const Eigen::Vector2d& origin, const Eigen::Vector2d& along, double length, bool hit,
           float sigma, float unseen) {
  RayWalk walk(origin, along);
  const auto reach = static_cast<float>(kBeamReach) * sigma;
  const auto end = static_cast<float>(length);
  const float near = hit ? end - reach : end;
  auto next_x = static_cast<float>(walk.next_x), next_y = static_cast<float>(walk.next_y);
  const auto per_x = static_cast<float>(walk.per_x), per_y = static_cast<float>(walk.per_y);
  float from = 0.0F, depth = 0.0F;
  // The part before the end needs the optical depth only. It has no branches, because the processor could not
  // predict them along a ray.
  float to = std::min(next_x, next_y);
  const auto enter_next_cell = [&] {
    from = to;
    const bool across = next_x < next_y;
    walk.x += across ? walk.step_x : 0;
    walk.y += across ? 0 : walk.step_y;
    next_x += across ? per_x : 0.0F;
    next_y += across ? 0.0F : per_y;
    to = std::min(next_x, next_y);
  };
  while (to < near) {
    depth += (to - from) * rates(walk.x, walk.y);
    enter_next_cell();
  }
  if (!hit) return std::exp(-depth - (near - from) * rates(walk.x, walk.y));
  // Around the end any of the cells may have stopped the ray.
  const float far = end + reach, inverse = 1.0F / sigma;
  float passed = std::exp(-depth), density = 0.0F;
  for (;;) {
    const float until = std::min(to, far), rate = rates(walk.x, walk.y);
    const float on = passed * std::exp(-(until - from) * rate);
    const float stopped = rate > 0.0F ? passed - on : passed * (until - from) * unseen;
    const float z = (0.5F * (from + until) - end) * inverse;
    if (std::abs(z) < static_cast<float>(kBeamReach)) density += stopped * std::exp(-0.5F * z * z);
    passed = on;
    if (!(to < far)) break;
    enter_next_cell();
  }
  return density * inverse * static_cast<float>(1.0 / std::sqrt(2.0 * kPi));
}

double WithOutliers(const LaserRay& ray, double in_cells, const RayModel& model) {
  const double model_says = ray.hit ? in_cells / model.resolution_m : in_cells;
  const double outlier = ray.hit ? 1.0 / model.outlier_m : 1.0;
  return (1.0 - model.outlier_share) * model_says + model.outlier_share * outlier;
}

double LikelihoodAt(const OpacityWindow& window, const Eigen::Vector2d& origin, const Eigen::Vector2d& along,
                    const LaserRay& ray, const RayModel& model) {
  const double length = ray.length_m / model.resolution_m;
  const double sigma = model.sigma_m / model.resolution_m;
  const double last = length + (ray.hit ? kBeamReach * sigma : 0.0) + 1.0;
  const Eigen::Vector2d end = origin + last * along;
  const auto holds = [&](const Eigen::Vector2d& p) {
    return p.x() >= 1.0 && p.y() >= 1.0 && p.x() < window.width() - 1.0 && p.y() < window.height() - 1.0;
  };
  const auto unseen = static_cast<float>(model.unseen_per_m * model.resolution_m);
  const float walked = holds(origin) && holds(end)
                           ? Walk(Inside{window.rates(), window.width()}, origin, along, length, ray.hit,
                                  static_cast<float>(sigma), unseen)
                           : Walk(Anywhere{window}, origin, along, length, ray.hit, static_cast<float>(sigma), unseen);
  return WithOutliers(ray, walked, model);
}

// Multiplies likelihoods, keeps the product in range and needs few logarithms.
class LogProduct {
 public:
  void Multiply(double factor) {
    product_ *= factor;
    if (product_ < 1e-200 || product_ > 1e200) Fold();
  }
  [[nodiscard]] double log() const { return sum_ + std::log(product_); }

 private:
  void Fold() {
    sum_ += std::log(std::max(product_, 1e-300));
    product_ = 1.0;
  }
  double product_ = 1.0, sum_ = 0.0;
};

}  // namespace

double RayLikelihood(const OpacityWindow& window, const Pose2& T_map_robot, const Eigen::Vector2d& origin_robot,
                     const LaserRay& ray, const RayModel& model) {
  const Eigen::Vector2d low(window.low_x(), window.low_y());
  const Eigen::Vector2d origin = (T_map_robot * origin_robot) / model.resolution_m - low;
  return LikelihoodAt(window, origin, T_map_robot.rotation() * ray.direction, ray, model);
}

double LogLikelihood(const OpacityWindow& window, const Pose2& T_map_robot, const LaserRays& rays, std::size_t first,
                     std::size_t stride, const RayModel& model) {
  const Eigen::Vector2d low(window.low_x(), window.low_y());
  const Eigen::Vector2d origin = (T_map_robot * rays.origin_robot) / model.resolution_m - low;
  const double c = std::cos(T_map_robot.theta), s = std::sin(T_map_robot.theta);
  LogProduct product;
  for (std::size_t i = first; i < rays.rays.size(); i += stride) {
    const LaserRay& ray = rays.rays[i];
    const Eigen::Vector2d along(c * ray.direction.x() - s * ray.direction.y(),
                                s * ray.direction.x() + c * ray.direction.y());
    product.Multiply(LikelihoodAt(window, origin, along, ray, model));
  }
  return product.log();
}

double UnseenLogLikelihood(const LaserRays& rays, std::size_t stride, const RayModel& model) {
  double sum = 0.0;
  for (std::size_t i = 0; i < rays.rays.size(); i += stride) {
    const LaserRay& ray = rays.rays[i];
    sum += std::log(WithOutliers(ray, ray.hit ? model.unseen_per_m * model.resolution_m : 1.0, model));
  }
  return sum;
}

}  // namespace cairn::slam
