#include "server/slam/matchers/correlative_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

constexpr double kPointReach = 3.0;  // Distance in sigmas beyond which a point has no influence.

std::vector<Eigen::Vector2d> Pick(std::span<const SurfacePoint> points, const CorrelativeOptions& options) {
  std::vector<Eigen::Vector2d> near;
  for (const SurfacePoint& point : points)
    if (point.p.squaredNorm() <= options.max_range_m * options.max_range_m) near.push_back(point.p);
  const auto most = static_cast<std::size_t>(options.max_points);
  if (near.size() <= most) return near;
  std::vector<Eigen::Vector2d> picked;
  picked.reserve(most);
  for (std::size_t i = 0; i < most; ++i) picked.push_back(near[i * near.size() / most]);
  return picked;
}

}  // namespace

CorrelativeSearch::CorrelativeSearch(std::span<const SurfacePoint> reference, std::span<const SurfacePoint> points,
                                     const MatchPrior& prior, const CorrelativeOptions& options)
    : options_(options),
      prior_(prior),
      prior_cholesky_(prior.covariance),
      points_(Pick(points, options)),
      table_(reference, options.cell_m, kPointReach * options.sigma_m, options.max_range_m,
             options.window_m + options.cell_m, static_cast<int>(options.block)) {
  double farthest = 1.0;
  for (const Eigen::Vector2d& p : points_) farthest = std::max(farthest, p.norm());
  turn_step_ = std::max(options.turn_step_rad, options.cell_m / farthest);
  turns_ = static_cast<int>(std::ceil(options.window_rad / turn_step_));
  shifts_ = static_cast<int>(std::ceil(options.window_m / options.cell_m));
}

// Converts the sum of the table values of all points to a log likelihood, which is 0 if every point lies on a
// surface.
double CorrelativeSearch::FromSum(std::int64_t sum) const {
  const double lost = static_cast<double>(points_.size()) - static_cast<double>(sum) / 255.0;
  return -0.5 * kPointReach * kPointReach * options_.effective_points * lost;
}

Pose2 CorrelativeSearch::PoseOf(const Turn& turn, int x, int y) const {
  return {prior_.T_ref_curr.x + x * options_.cell_m, prior_.T_ref_curr.y + y * options_.cell_m, turn.theta};
}

double CorrelativeSearch::LogPrior(const Pose2& T) const {
  const Eigen::Vector3d away = Minus(T, prior_.T_ref_curr);
  return -0.5 * prior_cholesky_.matrixL().solve(away).squaredNorm();
}

CorrelativeSearch::Turn CorrelativeSearch::Look(int turn) const {
  Turn look;
  look.theta = WrapAngle(prior_.T_ref_curr.theta + turn * turn_step_);
  const double c = std::cos(look.theta), s = std::sin(look.theta);
  const int block = static_cast<int>(options_.block), columns = table_.columns(), rows = table_.rows();
  for (const Eigen::Vector2d& p : points_) {
    const Eigen::Vector2i cell =
        table_.CellOf({c * p.x() - s * p.y() + prior_.T_ref_curr.x, s * p.x() + c * p.y() + prior_.T_ref_curr.y});
    // A point that some shift moves off the table is farther from every surface than the window is wide.
    if (cell.x() < shifts_ || cell.y() < shifts_ || cell.x() + shifts_ + block >= columns ||
        cell.y() + shifts_ + block >= rows)
      continue;
    look.cells.push_back(cell.y() * columns + cell.x());
  }
  const std::uint8_t* const coarse = table_.coarse().data();
  for (int y = -shifts_; y <= shifts_; y += block) {
    for (int x = -shifts_; x <= shifts_; x += block) {
      std::int64_t sum = 0;
      const std::uint8_t* const at = coarse + static_cast<std::ptrdiff_t>(y) * columns + x;
      for (const std::int32_t cell : look.cells) sum += at[cell];
      look.blocks.push_back({x, y, FromSum(sum)});
    }
  }
  return look;
}

void CorrelativeSearch::Try(const Turn& turn, int index, const Block& block, double& best, std::vector<Motion>& likely,
                            int& tried) const {
  const std::uint8_t* const fine = table_.fine().data();
  const int columns = table_.columns(), side = static_cast<int>(options_.block);
  for (int y = block.y; y < std::min(block.y + side, shifts_ + 1); ++y) {
    for (int x = block.x; x < std::min(block.x + side, shifts_ + 1); ++x) {
      std::int64_t sum = 0;
      const std::uint8_t* const at = fine + static_cast<std::ptrdiff_t>(y) * columns + x;
      for (const std::int32_t cell : turn.cells) sum += at[cell];
      ++tried;
      double log_likelihood = FromSum(sum);
      if (log_likelihood < best - options_.likely) continue;
      log_likelihood += LogPrior(PoseOf(turn, x, y));
      if (log_likelihood < best - options_.likely) continue;
      best = std::max(best, log_likelihood);
      likely.push_back({index, x, y, log_likelihood});
    }
  }
}

CorrelativeSearch::Answer CorrelativeSearch::Run(const ParallelFor& parallel_for) const {
  const int count = 2 * turns_ + 1;
  std::vector<Turn> turns(static_cast<std::size_t>(count));
  parallel_for(count, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) turns[static_cast<std::size_t>(i)] = Look(i - turns_);
  });

  // The most promising block gives a first result, which is good enough to discard most of the others. Each
  // turn is then searched by itself with that result as the bound, so that its result does not depend on when
  // other turns are finished.
  int first_turn = 0;
  Block first_block{0, 0, -std::numeric_limits<double>::infinity()};
  for (int i = 0; i < count; ++i) {
    for (const Block& block : turns[static_cast<std::size_t>(i)].blocks) {
      if (block.bound > first_block.bound) {
        first_block = block;
        first_turn = i;
      }
    }
  }
  double mark = -std::numeric_limits<double>::infinity();
  Answer answer;
  std::vector<Motion> ignored;
  Try(turns[static_cast<std::size_t>(first_turn)], first_turn, first_block, mark, ignored, answer.tried);

  std::vector<std::vector<Motion>> found(static_cast<std::size_t>(count));
  std::vector<int> tried(static_cast<std::size_t>(count), 0);
  parallel_for(count, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      std::stable_sort(turns[k].blocks.begin(), turns[k].blocks.end(),
                       [](const Block& a, const Block& b) { return a.bound > b.bound; });
      double best = mark;
      for (const Block& block : turns[k].blocks) {
        if (block.bound < best - options_.likely) break;
        Try(turns[k], i, block, best, found[k], tried[k]);
      }
    }
  });

  double best = -std::numeric_limits<double>::infinity();
  Motion at;
  for (int i = 0; i < count; ++i) {
    answer.tried += tried[static_cast<std::size_t>(i)];
    for (const Motion& motion : found[static_cast<std::size_t>(i)]) {
      if (motion.log_likelihood <= best) continue;
      best = motion.log_likelihood;
      at = motion;
    }
  }
  answer.best = PoseOf(turns[static_cast<std::size_t>(at.turn)], at.x, at.y);
  answer.on_border = std::max(std::abs(at.x), std::abs(at.y)) >= shifts_ || std::abs(at.turn - turns_) >= turns_;

  // Olson's (5), relative to the best motion, so that the moments do not cancel and the heading does not
  // wrap.
  double s = 0.0;
  Eigen::Vector3d u = Eigen::Vector3d::Zero();
  Eigen::Matrix3d K = Eigen::Matrix3d::Zero();
  for (const std::vector<Motion>& motions : found) {
    for (const Motion& motion : motions) {
      if (motion.log_likelihood < best - options_.likely) continue;
      const double weight = std::exp(motion.log_likelihood - best);
      const Eigen::Vector3d away((motion.x - at.x) * options_.cell_m, (motion.y - at.y) * options_.cell_m,
                                 (motion.turn - at.turn) * turn_step_);
      s += weight;
      u += weight * away;
      K += weight * away * away.transpose();
    }
  }
  if (s > 0.0) {
    u /= s;
    answer.covariance = K / s - u * u.transpose();
  }
  answer.mean = {answer.best.x + u.x(), answer.best.y + u.y(), WrapAngle(answer.best.theta + u.z())};
  const double cell = options_.cell_m * options_.cell_m / 12.0;
  answer.covariance.diagonal() += Eigen::Vector3d(cell, cell, turn_step_ * turn_step_ / 12.0);
  return answer;
}

}  // namespace cairn::slam
