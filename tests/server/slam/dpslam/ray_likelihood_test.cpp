#include "server/slam/dpslam/ray_likelihood.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "server/slam/dpslam/laser_rays.h"
#include "server/slam/dpslam/map_changes.h"
#include "tests/server/slam/dpslam/textbook_opacity.h"

namespace cairn::slam {
namespace {

constexpr double kCell = 0.05;

// A wall at x = 3, 4 m long, seen from the origin; free space before it.
class RayInAMap : public testing::Test {
 protected:
  RayInAMap() {
    ChangePainter painter(kCell);
    for (int scan = 0; scan < 3; ++scan) {
      LaserRays rays;
      for (int i = -60; i <= 60; ++i) {
        const double bearing = 0.009 * i + 0.001 * scan;
        rays.rays.push_back({{std::cos(bearing), std::sin(bearing)}, 3.02 / std::cos(bearing), true});
      }
      painter.Draw(rays, {});
    }
    std::vector<Ancestry::Child> children;
    children.push_back({0, painter.Take()});
    ancestry_.NextGeneration(std::move(children));
  }

  [[nodiscard]] OpacityWindow Window(TileBox box = {-2, -2, 4, 4}) const {
    OpacityWindow window(ancestry_, box, rate_);
    window.Show(ancestry_.living()[0]);
    return window;
  }
  [[nodiscard]] double At(const OpacityWindow& window, int x, int y) const {
    const int column = x - window.low_x(), row = y - window.low_y();
    return static_cast<double>(window.rates()[row * window.width() + column]);
  }

  // (3.39) written out over the seen cells. From unseen cells, rays return with the same density everywhere.
  [[nodiscard]] double Textbook(const OpacityWindow& window, const Pose2& pose, const LaserRay& ray) const {
    std::vector<RaySpan> spans;
    double unseen = 0.0;
    const double far = (ray.length_m + (ray.hit ? 6.0 * model_.sigma_m : 0.0)) / kCell;
    WalkRay(pose.translation() / kCell, pose.rotation() * ray.direction, far,
            [&](int x, int y, double from, double to) {
              const double delta = 0.5 * (from + to) * kCell - ray.length_m;
              if (At(window, x, y) > 0.0) {
                spans.push_back({(to - from) * kCell, kCell / At(window, x, y), delta});
              } else if (ray.hit) {
                unseen += (1.0 - StoppedProbability(spans)) * model_.unseen_per_m * (to - from) * kCell *
                          MeasurementDensity(delta, model_.sigma_m);
              }
            });
    const double says = ray.hit ? RayDensity(spans, model_.sigma_m) + unseen : 1.0 - StoppedProbability(spans);
    return (1.0 - model_.outlier_share) * says + model_.outlier_share * (ray.hit ? 1.0 / model_.outlier_m : 1.0);
  }

  OpacityOptions options_;
  StopRate rate_{options_};
  Ancestry ancestry_;
  RayModel model_{0.05, 0.05, 20.0, kCell};
};

TEST_F(RayInAMap, EqualsTheTextbook) {
  const OpacityWindow window = Window();
  std::mt19937_64 rng(6);
  std::uniform_real_distribution<double> place(-0.4, 0.4), turn(-0.4, 0.4), range(0.3, 3.4);
  for (int i = 0; i < 500; ++i) {
    const Pose2 pose{place(rng), place(rng), turn(rng)};
    const double bearing = turn(rng);
    const LaserRay ray{{std::cos(bearing), std::sin(bearing)}, range(rng), i % 4 != 0};
    const double fast = RayLikelihood(window, pose, Eigen::Vector2d::Zero(), ray, model_);
    // With 4 sigma in place of 6, the density is below 1e-4 of the peak's 8 per metre. A cell across the
    // limit is left out as a whole.
    EXPECT_NEAR(fast, Textbook(window, pose, ray), 4e-3 + 1e-4 * fast);
  }
}

TEST_F(RayInAMap, IsBestWhereTheWallIs) {
  const OpacityWindow window = Window();
  const auto at = [&](double range) {
    return RayLikelihood(window, {}, {0.0, 0.0}, {{1.0, 0.0}, range, true}, model_);
  };
  EXPECT_GT(at(3.02), 30.0 * at(2.5));  // Where the map says that the space is free.
  EXPECT_GT(at(3.02), 5.0 * at(3.2));
  // Passing through the wall is unlikely; up to the wall it is certain.
  const auto passes = [&](double range) {
    return RayLikelihood(window, {}, {0.0, 0.0}, {{1.0, 0.0}, range, false}, model_);
  };
  EXPECT_GT(passes(2.5), 0.9);
  EXPECT_LT(passes(3.3), 0.25);
}

TEST_F(RayInAMap, OutsideTheWindowIsUnseenSpace) {
  const OpacityWindow small = Window({0, 0, 1, 1});  // 3.2 m of it.
  const LaserRay ray{{0.6, 0.8}, 10.0, true};
  const double seen = RayLikelihood(small, {100.0, -70.0, 1.0}, {0.0, 0.0}, ray, model_);
  LaserRays one;
  one.rays.push_back(ray);
  EXPECT_NEAR(std::log(seen), UnseenLogLikelihood(one, 1, model_), 0.05);
  // One ray leaves the window, and one starts outside it.
  EXPECT_TRUE(std::isfinite(RayLikelihood(small, {1.0, 1.0, 0.0}, {0.0, 0.0}, ray, model_)));
  EXPECT_TRUE(std::isfinite(RayLikelihood(small, {-5.0, -6.0, 0.0}, {0.0, 0.0}, ray, model_)));
}

TEST_F(RayInAMap, RaysMultiply) {
  const OpacityWindow window = Window();
  LaserRays rays;
  double sum = 0.0;
  for (int i = 0; i < 700; ++i) {
    const double bearing = 0.001 * i - 0.35;
    rays.rays.push_back({{std::cos(bearing), std::sin(bearing)}, 1.0 + 0.003 * i, i % 3 != 0});
    sum += std::log(RayLikelihood(window, {0.1, 0.05, 0.02}, {0.2, 0.0}, rays.rays.back(), model_));
  }
  rays.origin_robot = {0.2, 0.0};
  EXPECT_NEAR(LogLikelihood(window, {0.1, 0.05, 0.02}, rays, 0, 1, model_), sum, 1e-6 * std::abs(sum));
  double parts = 0.0;
  for (std::size_t first = 0; first < 4; ++first)
    parts += LogLikelihood(window, {0.1, 0.05, 0.02}, rays, first, 4, model_);
  EXPECT_NEAR(parts, sum, 1e-6 * std::abs(sum));
}

}  // namespace
}  // namespace cairn::slam
