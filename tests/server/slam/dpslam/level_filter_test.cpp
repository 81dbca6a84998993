#include "server/slam/dpslam/level_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "server/slam/dpslam/map_changes.h"
#include "tests/server/slam/dpslam/drive.h"

namespace cairn::slam {
namespace {

LevelOptions SmallLevel() {
  LevelOptions options;
  options.particles = 30;
  options.give_up_behind = 0.0;
  return options;
}

Eigen::Matrix3d Noise() {
  return Eigen::Vector3d(1e-4, 1e-4, 1e-4).asDiagonal();
}

Evidence One(const Scan& scan) {
  return {{std::make_shared<LaserRays>(RaysOf(scan, {})), Pose2{}}};
}

// A reference filter without a family tree: every particle has a whole map of its own, which is copied on
// resampling.
class CopyTheMap {
 public:
  CopyTheMap(const LevelOptions& options, const Pose2& start) : options_(options) {
    particles_.resize(static_cast<std::size_t>(options.particles));
    for (Owner& particle : particles_) particle.pose = start;
  }

  struct Owner {
    Pose2 pose;
    MapChanges map;
    double log_weight = 0.0;
  };

  void Move(const Pose2& step, const Eigen::Matrix3d& covariance, Rng& rng) {
    const Eigen::Vector3d sigma = covariance.diagonal().cwiseSqrt();  // Diagonal, and its eigenvectors come in order.
    for (Owner& particle : particles_) {
      const Eigen::Vector3d draw = ThreeNormalDraws(rng);
      const Eigen::Vector3d noisy = step.vector() + sigma.cwiseProduct(draw);
      particle.pose = particle.pose * Pose2{noisy.x(), noisy.y(), WrapAngle(noisy.z())};
    }
  }

  std::vector<double> Observe(const LaserRays& rays, Rng& rng) {
    const OpacityOptions opacity;
    const RayModel model{options_.sigma_m, options_.outlier_share, opacity.max_ray_m, opacity.resolution_m};
    std::vector<double> log_weights;
    const bool blank = particles_[0].map.empty();
    for (Owner& particle : particles_) {
      Ancestry alone;
      std::vector<Ancestry::Child> children;
      children.push_back({0, particle.map});
      alone.NextGeneration(std::move(children));
      OpacityWindow window(alone, {-10, -10, 20, 20}, StopRate(opacity));
      window.Show(alone.living()[0]);
      if (!blank)
        particle.log_weight += options_.evidence_share * LogLikelihood(window, particle.pose, rays, 0, 1, model);
      log_weights.push_back(particle.log_weight);
      ChangePainter painter(opacity.resolution_m);
      painter.Draw(rays, particle.pose);
      particle.map.Add(painter.Take());
    }
    std::vector<Owner> next;
    for (const int parent : StratifiedSurvivors(NormalisedWeights(log_weights), rng)) {
      next.push_back(particles_[static_cast<std::size_t>(parent)]);
      next.back().log_weight = 0.0;
    }
    particles_ = std::move(next);
    return log_weights;
  }

  [[nodiscard]] const std::vector<Owner>& particles() const { return particles_; }

 private:
  LevelOptions options_;
  std::vector<Owner> particles_;
};

TEST(LevelFilter, IsTheFilterThatCopiesMaps) {
  const auto drive = DriveRing(8.0, 6.0, 0.3, 45, 1);
  const LevelOptions options = SmallLevel();
  LevelFilter filter(options, {}, drive[0].T_map_robot);
  CopyTheMap naive(options, drive[0].T_map_robot);
  Rng rng(7), naive_rng(7);
  std::size_t compared = 0;
  for (std::size_t i = 0; i < drive.size(); ++i) {
    if (i > 0) {
      filter.Move(drive[i].T_prev_curr, Noise(), rng);
      naive.Move(drive[i].T_prev_curr, Noise(), naive_rng);
    }
    const Evidence seen = One(drive[i].scan);
    filter.Observe(seen, rng, InBlocks(3));
    naive.Observe(*seen[0].rays, naive_rng);
    for (std::size_t p = 0; p < filter.particles().size(); ++p) {
      ASSERT_EQ(filter.particles()[p].T_map_robot, naive.particles()[p].pose) << "step " << i;
      // The whole map, as the rays read it.
      if (i % 8 != 7 || p % 5 != 0) continue;
      const Ancestry& ancestry = filter.maps().ancestry();
      OpacityWindow tree(ancestry, {-5, -5, 10, 10}, filter.maps().rate());
      tree.Show(ancestry.living()[filter.particles()[p].map]);
      Ancestry alone;
      std::vector<Ancestry::Child> children;
      children.push_back({0, naive.particles()[p].map});
      alone.NextGeneration(std::move(children));
      OpacityWindow copy(alone, {-5, -5, 10, 10}, filter.maps().rate());
      copy.Show(alone.living()[0]);
      ASSERT_EQ(tree.counts(), copy.counts());
      ++compared;
    }
  }
  EXPECT_GT(compared, 20u);
}

TEST(LevelFilter, SameBytesOnAnyNumberOfThreads) {
  const auto drive = DriveRing(8.0, 6.0, 0.2, 61, 2);
  LevelOptions options = SmallLevel();
  options.give_up_behind = 5.0;
  std::vector<LevelFilter> filters;
  std::vector<Rng> rngs(3, Rng(3));
  const int blocks[] = {1, 2, 7};
  for (int k = 0; k < 3; ++k) filters.emplace_back(options, OpacityOptions{}, drive[0].T_map_robot);
  for (const DriveStep& step : drive) {
    const Evidence seen = One(step.scan);
    for (std::size_t k = 0; k < 3; ++k) {
      filters[k].Move(step.T_prev_curr, Noise(), rngs[k]);
      filters[k].Observe(seen, rngs[k], InBlocks(blocks[k]));
    }
    for (std::size_t k = 1; k < 3; ++k) {
      ASSERT_EQ(filters[k].mean(), filters[0].mean());
      ASSERT_EQ(filters[k].effective_sample_size(), filters[0].effective_sample_size());
      for (std::size_t p = 0; p < filters[0].particles().size(); ++p) {
        ASSERT_EQ(filters[k].particles()[p].T_map_robot, filters[0].particles()[p].T_map_robot);
        ASSERT_EQ(filters[k].particles()[p].log_likelihood, filters[0].particles()[p].log_likelihood);
      }
    }
  }
}

// Giving up particles does not change the result: their weight was zero.
TEST(LevelFilter, GivingUpEarlySparesTheSurvivors) {
  const auto drive = DriveRing(8.0, 6.0, 0.2, 91, 4);
  LevelOptions options = SmallLevel();
  options.particles = 100;
  LevelFilter patient(options, {}, drive[0].T_map_robot);
  options.give_up_behind = 12.0;
  LevelFilter brisk(options, {}, drive[0].T_map_robot);
  Rng a(5), b(5);
  for (const DriveStep& step : drive) {
    const Evidence seen = One(step.scan);
    patient.Move(step.T_prev_curr, 10.0 * Noise(), a);
    brisk.Move(step.T_prev_curr, 10.0 * Noise(), b);
    patient.Observe(seen, a, SerialFor);
    brisk.Observe(seen, b, SerialFor);
  }
  EXPECT_LT((patient.mean().translation() - brisk.mean().translation()).norm(), 0.05);
  const Eigen::Vector2d truth = drive.back().T_map_robot.translation();
  EXPECT_LT((brisk.mean().translation() - truth).norm(), (patient.mean().translation() - truth).norm() + 0.05);
}

TEST(LevelFilter, ParticlesCostWhatTheyChange) {
  const auto drive = DriveRing(8.0, 6.0, 1.2, 45, 6);
  LevelOptions options = SmallLevel();
  options.particles = 60;
  LevelFilter filter(options, {}, drive[0].T_map_robot);
  Rng rng(8);
  for (const DriveStep& step : drive) {
    const Evidence seen = One(step.scan);
    filter.Move(step.T_prev_curr, Noise(), rng);
    filter.Observe(seen, rng, SerialFor);
    const Ancestry& ancestry = filter.maps().ancestry();
    ASSERT_LE(ancestry.size(), 2 * ancestry.living().size() - 1);
    ASSERT_LE(ancestry.living().size(), 60u);
    ASSERT_LE(ancestry.depth(), ancestry.living().size());
    // One whole map, and for every other node at most what a few scans touch (45 rays of at most 8 m: 45 *
    // 230 cells).
    const std::size_t map_bytes = 40 * kChangeTileArea * sizeof(ChangeTile::Counts);
    ASSERT_LE(ancestry.bytes(), map_bytes + ancestry.size() * 3 * 45 * 230 * sizeof(CellChange));
  }
}

TEST(LevelFilter, AScanThatSaysNothingOnlyLengthensPaths) {
  const auto drive = DriveRing(8.0, 6.0, 0.1, 31, 7);
  LevelFilter filter(SmallLevel(), {}, {});
  Rng rng(9);
  Evidence nothing{{std::make_shared<LaserRays>(), Pose2{}}};
  filter.Observe(nothing, rng, SerialFor);
  EXPECT_TRUE(filter.maps().blank());
  const Evidence first = One(drive[0].scan);
  filter.Observe(first, rng, SerialFor);
  EXPECT_FALSE(filter.maps().blank());
  EXPECT_EQ(filter.maps().count(), 1u);  // All particles are alike, so there is only one map.
  filter.Move({0.2, 0.0, 0.0}, Noise(), rng);
  filter.Observe(nothing, rng, SerialFor);
  EXPECT_EQ(filter.maps().count(), 1u);
  EXPECT_EQ(filter.best().path.size(), 3u);
  EXPECT_NEAR(filter.mean().x, 0.2, 0.02);
}

TEST(LevelFilter, SurvivesScatteredParticlesAndFarPlaces) {
  const auto drive = DriveRing(8.0, 6.0, 0.1, 31, 8);
  LevelFilter filter(SmallLevel(), {}, {});
  Rng rng(10);
  const Eigen::Matrix3d wild = Eigen::Vector3d(1e6, 1e6, 9.0).asDiagonal();
  for (std::size_t i = 0; i < 6; ++i) {
    const Evidence seen = One(drive[i].scan);
    filter.Move({i == 4 ? 1e7 : 0.2, 0.0, 0.1}, i >= 2 ? wild : Noise(), rng);
    filter.Observe(seen, rng, InBlocks(2));
    EXPECT_TRUE(filter.mean().IsFinite());
    EXPECT_TRUE(filter.covariance().allFinite());
  }
  EXPECT_EQ(filter.maps().Image(0).width, 0);  // The map is too wide for a picture.
}

}  // namespace
}  // namespace cairn::slam
