#include "server/slam/matching/line_match.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "server/slam/matching/line_least_squares.h"

namespace cairn::slam {
namespace {

struct Pair {
  int map = 0, scan = 0;
};

Eigen::Vector2d Along(const MapLine& line) {
  return (line.b - line.a).normalized();
}

class Search {
 public:
  Search(std::span<const MapLine> map, std::span<const LineFeature> scan, const LineMatchOptions& options)
      : map_(map), scan_(scan), options_(options) {
    for (std::size_t s = 0; s < scan.size(); ++s) {
      if (scan[s].length < options.min_line_m) continue;
      order_.push_back(static_cast<int>(s));
      all_ += scan[s].length;
    }
    // SelectScanline: the longest line that is left says most.
    std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) { return LengthOf(a) > LengthOf(b); });
  }

  LineMatchAnswer Run() {
    if (!order_.empty()) Extend(0, 0.0);
    std::stable_sort(answer_.hypotheses.begin(), answer_.hypotheses.end(),
                     [](const LineMatchHypothesis& a, const LineMatchHypothesis& b) { return a.share > b.share; });
    return std::move(answer_);
  }

 private:
  double LengthOf(int s) const { return scan_[static_cast<std::size_t>(s)].length; }
  void Extend(std::size_t next, double skipped_m);
  bool Verify(const Pair& added);
  LineAlignment Solve() const;
  bool Fits(const Pair& pair, const Pose2& T_map_robot, bool place_known) const;
  void Keep(double skipped_m);

  std::span<const MapLine> map_;
  std::span<const LineFeature> scan_;
  const LineMatchOptions& options_;
  std::vector<int> order_;
  double all_ = 0.0;
  std::vector<Pair> pairs_;
  LineMatchAnswer answer_;
  std::int64_t verifications_ = 0;
};

// LINEMATCH: the next scan line with every map line it can be, or with none.
void Search::Extend(std::size_t next, double skipped_m) {
  if (!answer_.complete) return;
  if (next == order_.size()) {
    Keep(skipped_m);
    return;
  }
  const int s = order_[next];
  for (std::size_t m = 0; m < map_.size(); ++m) {
    if (++verifications_ > options_.max_verifications) {
      answer_.complete = false;
      return;
    }
    const Pair pair{static_cast<int>(m), s};
    pairs_.push_back(pair);
    if (Verify(pair)) Extend(next + 1, skipped_m);
    pairs_.pop_back();
  }
  if (skipped_m + LengthOf(s) <= (1.0 - options_.min_share) * all_) Extend(next + 1, skipped_m + LengthOf(s));
}

LineAlignment Search::Solve() const {
  std::vector<WeighedPair> weighed;
  weighed.reserve(pairs_.size());
  for (const Pair& pair : pairs_) {
    const MapLine& wall = map_[static_cast<std::size_t>(pair.map)];
    const LineFeature& line = scan_[static_cast<std::size_t>(pair.scan)];
    const Eigen::Vector2d along = Along(wall);
    weighed.push_back({{0.5 * (wall.a + wall.b), {-along.y(), along.x()}}, MidpointAndNormal(line), line.length});
  }
  const MapLine& wall = map_[static_cast<std::size_t>(pairs_.front().map)];
  const LineFeature& line = scan_[static_cast<std::size_t>(pairs_.front().scan)];
  const Eigen::Vector2d along = Along(wall);
  const Pose2 turn{0.0, 0.0, AngleDiff(std::atan2(along.y(), along.x()), line.slope)};
  const Eigen::Vector2d t = 0.5 * (wall.a + wall.b) - turn * line.midpoint();
  LineLeastSquaresOptions solve;
  solve.along_weight = 1e-6;  // Midpoints of a whole wall and of its visible part have nothing in common.
  solve.max_iterations = 6;
  return AlignLinePairs(weighed, {t.x(), t.y(), turn.theta}, solve);
}

bool Search::Fits(const Pair& pair, const Pose2& T_map_robot, bool place_known) const {
  const MapLine& wall = map_[static_cast<std::size_t>(pair.map)];
  const LineFeature& line = scan_[static_cast<std::size_t>(pair.scan)];
  const Eigen::Vector2d along = Along(wall), normal(-along.y(), along.x());
  const double turn = AngleDiff(std::atan2(along.y(), along.x()), line.slope);
  if (std::abs(AngleDiff(turn, T_map_robot.theta)) > options_.slope_rad) return false;
  if (std::abs(normal.dot(T_map_robot * line.midpoint() - wall.a)) > options_.offset_m) return false;
  if (!place_known) return true;
  const double from = along.dot(T_map_robot * line.first - wall.a), to = along.dot(T_map_robot * line.last - wall.a);
  return from >= -options_.overhang_m && to <= (wall.b - wall.a).norm() + options_.overhang_m;
}

// VerifyMatch: can all pairs be right at once?
bool Search::Verify(const Pair& added) {
  const MapLine& wall = map_[static_cast<std::size_t>(added.map)];
  if (LengthOf(added.scan) > (wall.b - wall.a).norm() + options_.overhang_m) return false;
  if (pairs_.size() == 1) return true;
  // The turn, without solving anything.
  const auto turn_of = [&](const Pair& pair) {
    const Eigen::Vector2d along = Along(map_[static_cast<std::size_t>(pair.map)]);
    return AngleDiff(std::atan2(along.y(), along.x()), scan_[static_cast<std::size_t>(pair.scan)].slope);
  };
  if (std::abs(AngleDiff(turn_of(added), turn_of(pairs_.front()))) > options_.slope_rad) return false;
  const LineAlignment alignment = Solve();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(alignment.H.topLeftCorner<2, 2>());
  const bool place_known = solver.eigenvalues()(0) > 0.02 * solver.eigenvalues()(1);
  return std::all_of(pairs_.begin(), pairs_.end(),
                     [&](const Pair& pair) { return Fits(pair, alignment.T_prev_curr, place_known); });
}

// An assignment becomes a pose where its pairs cross; better than a neighbour, it replaces it.
void Search::Keep(double skipped_m) {
  if (pairs_.size() < 2) return;
  const LineAlignment alignment = Solve();
  const Pose2 T = alignment.T_prev_curr;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  const double place = 1.0 / (options_.line_sigma_m * options_.line_sigma_m);
  for (const Pair& pair : pairs_) {
    const Eigen::Vector2d along = Along(map_[static_cast<std::size_t>(pair.map)]), normal(-along.y(), along.x());
    const Eigen::Vector2d turned = T.rotation() * scan_[static_cast<std::size_t>(pair.scan)].midpoint();
    const Eigen::Vector3d J(normal.x(), normal.y(), normal.dot(Eigen::Vector2d(-turned.y(), turned.x())));
    information += place * J * J.transpose();
    information(2, 2) += 1.0 / (options_.line_slope_sigma_rad * options_.line_slope_sigma_rad);
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(information);
  if (solver.eigenvalues()(0) < 1e-3 * place) return;  // A corridor is no place.
  LineMatchHypothesis hypothesis{T, information.llt().solve(Eigen::Matrix3d::Identity()),
                                 all_ > 0.0 ? (all_ - skipped_m) / all_ : 0.0, static_cast<int>(pairs_.size())};
  hypothesis.covariance = 0.5 * (hypothesis.covariance + hypothesis.covariance.transpose()).eval();
  for (LineMatchHypothesis& other : answer_.hypotheses) {
    if ((other.T_map_robot.translation() - T.translation()).norm() > options_.same_m ||
        std::abs(AngleDiff(other.T_map_robot.theta, T.theta)) > options_.same_rad)
      continue;
    if (hypothesis.share > other.share) other = hypothesis;
    return;
  }
  answer_.hypotheses.push_back(hypothesis);
}

}  // namespace

void Visit(OptionVisitor& visitor, LineMatchOptions& options) {
  visitor.Real("offset_m", options.offset_m, "m", 0.001, 2.0, "A scan line lies this near its map line.");
  visitor.Real("slope_rad", options.slope_rad, "rad", 0.001, 1.0, "... and is turned by less against it.");
  visitor.Real("overhang_m", options.overhang_m, "m", 0.0, 5.0, "How far it may stick out beyond the map line's ends.");
  visitor.Real("min_line_m", options.min_line_m, "m", 0.0, 10.0, "Shorter scan lines are not paired.");
  visitor.Real("min_share", options.min_share, "1", 0.0, 1.0, "Of the scan lines' length that must be paired.");
  visitor.Real("same_m", options.same_m, "m", 0.0, 10.0, "Hypotheses this near each other are one.");
  visitor.Real("same_rad", options.same_rad, "rad", 0.0, kPi, "See same_m.");
  visitor.Real("line_sigma_m", options.line_sigma_m, "m", 1e-4, 1.0, "Of a scan line's place.");
  visitor.Real("line_slope_sigma_rad", options.line_slope_sigma_rad, "rad", 1e-5, 1.0, "Of a scan line's slope.");
  visitor.Integer("max_verifications", options.max_verifications, "1", 1, 1'000'000'000, "Hard bound on the search.");
}

LineMatchAnswer MatchLinesWithMap(std::span<const MapLine> map, std::span<const LineFeature> scan,
                                  const LineMatchOptions& options) {
  return Search(map, scan, options).Run();
}

}  // namespace cairn::slam
