#include "server/slam/matching/line_match.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "server/slam/matching/line_least_squares.h"

namespace cairn::slam {
namespace {

struct Wall {
  MapLine line;
  Eigen::Vector2d along, normal;
  double direction = 0.0, length = 0.0;

  explicit Wall(const MapLine& map_line)
      : line(map_line),
        along((map_line.b - map_line.a).normalized()),
        normal(-along.y(), along.x()),
        direction(std::atan2(along.y(), along.x())),
        length((map_line.b - map_line.a).norm()) {}
  [[nodiscard]] double OffsetOf(const Eigen::Vector2d& p_map) const { return normal.dot(p_map - line.a); }
};

struct Pair {
  const Wall* wall = nullptr;
  const LineFeature* line = nullptr;
};

// Lines whose crossing is a place.
bool CrossAt(const LineFeature& a, const LineFeature& b) {
  return std::abs(std::sin(a.slope - b.slope)) > std::sin(Radians(20.0));
}

// What a set of pairs says of the pose.
struct Placing {
  Pose2 T_map_robot;
  bool placed = false;  // False: from one pair, which gives the heading only.
};

class Search {
 public:
  Search(std::span<const MapLine> map, std::span<const LineFeature> scan, const LineMatchOptions& options,
         const std::optional<LineMatchWindow>& window)
      : options_(options), window_(window) {
    for (const LineFeature& line : scan) {
      if (line.length < options.min_line_m) continue;
      order_.push_back(&line);
      all_m_ += line.length;
    }
    std::ranges::stable_sort(order_, [](const auto* a, const auto* b) { return a->length > b->length; });
    for (const MapLine& line : map) {
      const Wall wall(line);
      if (wall.length + options.overhang_m >= options.min_line_m) walls_.push_back(wall);
    }
    std::ranges::stable_sort(walls_, [](const Wall& a, const Wall& b) { return a.direction < b.direction; });
  }

  LineMatchAnswer Run() {
    done_.assign(order_.size(), 0);
    Extend(0.0, {});
    answer_.complete = WithinBounds();
    std::ranges::stable_sort(answer_.hypotheses, [](const auto& a, const auto& b) { return a.share > b.share; });
    return std::move(answer_);
  }

 private:
  void Extend(double skipped_m, const Placing& placing);
  [[nodiscard]] std::optional<std::size_t> SelectScanline(const Placing& placing) const;
  bool Take(const Pair& pair, double skipped_m);  // False: it cannot be.
  [[nodiscard]] const Wall* BestWall(const LineFeature& line, const Pose2& T_map_robot) const;
  [[nodiscard]] std::optional<Placing> Verify() const;
  [[nodiscard]] LineAlignment Solve() const;
  [[nodiscard]] bool Fits(const Pair& pair, const Placing& placing, double slack) const;
  [[nodiscard]] bool InWindow(const Pair& first) const;
  [[nodiscard]] bool InWindow(const Placing& placing) const;
  void Keep(double skipped_m);
  [[nodiscard]] bool WithinBounds() const {
    return comparisons_ <= options_.max_comparisons &&
           answer_.hypotheses.size() <= static_cast<std::size_t>(options_.max_hypotheses);
  }
  // Walls that run like this, +-slope_rad; all where nothing is known.
  template <typename Do>
  void ForWallsAlong(std::optional<double> direction, double tolerance_rad, const Do& act) const;

  const LineMatchOptions& options_;
  const std::optional<LineMatchWindow>& window_;
  std::vector<Wall> walls_;                // By direction.
  std::vector<const LineFeature*> order_;  // The longest first.
  std::vector<char> done_;                 // Of them: paired or skipped.
  double all_m_ = 0.0;
  std::vector<Pair> pairs_;
  LineMatchAnswer answer_;
  mutable std::int64_t comparisons_ = 0;  // The clock of the search: counts in questions, too.
};

template <typename Do>
void Search::ForWallsAlong(std::optional<double> direction, double tolerance_rad, const Do& act) const {
  std::size_t at = 0;
  if (direction) {
    const double from = WrapAngle(*direction - tolerance_rad);
    const auto first = std::ranges::lower_bound(walls_, from, {}, &Wall::direction);
    at = static_cast<std::size_t>(first - walls_.begin()) % std::max<std::size_t>(walls_.size(), 1);
  }
  for (std::size_t k = 0; k < walls_.size() && WithinBounds(); ++k) {
    const Wall& wall = walls_[at];
    if (++at == walls_.size()) at = 0;
    ++comparisons_;
    if (direction && std::abs(AngleDiff(wall.direction, *direction)) > tolerance_rad) {
      if (k == 0) continue;  // On the very edge, by rounding.
      return;
    }
    act(wall);
  }
}

// The longest line that is left says most; but the second pair has to leave one place.
std::optional<std::size_t> Search::SelectScanline(const Placing& placing) const {
  for (std::size_t s = 0; s < order_.size(); ++s) {
    if (done_[s] != 0) continue;
    if (pairs_.empty() || placing.placed || CrossAt(*order_[s], *pairs_.front().line)) return s;
  }
  return std::nullopt;
}

// LINEMATCH: the next scan line with every wall it can be, or with none. Once the pairs leave one place, the rest of
// the scan is no choice any more: each line is the wall it lies on, if it lies on one.
void Search::Extend(double skipped_m, const Placing& placing) {
  if (!WithinBounds()) return;
  const auto next = SelectScanline(placing);
  if (!next) {
    if (placing.placed) Keep(skipped_m);
    return;
  }
  const LineFeature& line = *order_[*next];
  done_[*next] = 1;
  bool taken = false;
  if (placing.placed) {
    if (const Wall* wall = BestWall(line, placing.T_map_robot)) taken = Take({wall, &line}, skipped_m);
  } else {
    std::optional<double> direction;
    double tolerance = options_.slope_rad;
    if (!pairs_.empty()) {
      direction = WrapAngle(placing.T_map_robot.theta + line.slope);
    } else if (window_) {
      direction = WrapAngle(window_->T_map_robot.theta + line.slope);
      tolerance += window_->turn_rad;
    }
    ForWallsAlong(direction, tolerance, [&](const Wall& wall) {
      if (line.length > wall.length + options_.overhang_m) return;
      const Pair pair{&wall, &line};
      if (InWindow(pair)) Take(pair, skipped_m);
    });
  }
  const double skipped = skipped_m + line.length;
  if (!taken && skipped <= (1.0 - options_.min_share) * all_m_) Extend(skipped, placing);
  done_[*next] = 0;
}

bool Search::Take(const Pair& pair, double skipped_m) {
  pairs_.push_back(pair);
  const auto placing = Verify();
  if (placing) Extend(skipped_m, *placing);
  pairs_.pop_back();
  return placing.has_value();
}

const Wall* Search::BestWall(const LineFeature& line, const Pose2& T_map_robot) const {
  constexpr double kSlack = 1.5;  // The pose of two pairs is not yet that of all.
  const Wall* best = nullptr;
  double least = kSlack * options_.offset_m;
  const Eigen::Vector2d middle = T_map_robot * line.midpoint();
  ForWallsAlong(WrapAngle(T_map_robot.theta + line.slope), kSlack * options_.slope_rad, [&](const Wall& wall) {
    const double offset = std::abs(wall.OffsetOf(middle));
    if (offset >= least || !Fits({&wall, &line}, {T_map_robot, true}, kSlack)) return;
    least = offset;
    best = &wall;
  });
  return best;
}

LineAlignment Search::Solve() const {
  constexpr std::int64_t kWorth = 300;  // Comparisons that take as long.
  comparisons_ += kWorth;
  std::vector<WeighedPair> weighed;
  weighed.reserve(pairs_.size());
  for (const auto& [wall, line] : pairs_)
    weighed.push_back({{0.5 * (wall->line.a + wall->line.b), wall->normal}, MidpointAndNormal(*line), line->length});
  const auto& [wall, line] = pairs_.front();
  const Pose2 turn{0.0, 0.0, AngleDiff(wall->direction, line->slope)};
  const Eigen::Vector2d t = 0.5 * (wall->line.a + wall->line.b) - turn * line->midpoint();
  LineLeastSquaresOptions solve;
  solve.along_weight = 1e-6;  // Midpoints of a whole wall and of its visible part have nothing in common.
  solve.max_iterations = 6;
  solve.stop_step = 1e-4;
  return AlignLinePairs(weighed, {t.x(), t.y(), turn.theta}, solve);
}

bool Search::Fits(const Pair& pair, const Placing& placing, double slack) const {
  const auto& [wall, line] = pair;
  const Pose2& T = placing.T_map_robot;
  if (std::abs(AngleDiff(wall->direction, T.theta + line->slope)) > slack * options_.slope_rad) return false;
  if (std::abs(wall->OffsetOf(T * line->midpoint())) > slack * options_.offset_m) return false;
  if (!placing.placed) return true;
  const double from = wall->along.dot(T * line->first - wall->line.a);
  const double to = wall->along.dot(T * line->last - wall->line.a);
  return from >= -slack * options_.overhang_m && to <= wall->length + slack * options_.overhang_m;
}

bool Search::InWindow(const Pair& first) const {
  if (!window_) return true;
  const Eigen::Vector2d middle = first.line->midpoint();
  const double slack = window_->reach_m + window_->turn_rad * middle.norm() + options_.offset_m;
  return std::abs(first.wall->OffsetOf(window_->T_map_robot * middle)) <= slack;
}

bool Search::InWindow(const Placing& placing) const {
  if (!window_ || !placing.placed) return true;
  const Pose2 away = Between(window_->T_map_robot, placing.T_map_robot);
  return away.translation().norm() <= window_->reach_m && std::abs(away.theta) <= window_->turn_rad;
}

// VerifyMatch: can all pairs be right at once? Then where.
std::optional<Placing> Search::Verify() const {
  if (pairs_.size() == 1) {
    const auto& [wall, line] = pairs_.front();
    return Placing{{0.0, 0.0, AngleDiff(wall->direction, line->slope)}, false};
  }
  const Placing placing{Solve().T_prev_curr, true};  // SelectScanline saw to it.
  const bool fit = std::ranges::all_of(pairs_, [&](const Pair& pair) { return Fits(pair, placing, 1.0); });
  return fit && InWindow(placing) ? std::optional(placing) : std::nullopt;
}

// An assignment becomes a pose where its pairs cross; better than a neighbour, it replaces it.
void Search::Keep(double skipped_m) {
  const Pose2 T = Solve().T_prev_curr;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  const double place = 1.0 / (options_.line_sigma_m * options_.line_sigma_m);
  for (const auto& [wall, line] : pairs_) {
    const Eigen::Vector2d turned = T.rotation() * line->midpoint();
    const Eigen::Vector3d J(wall->normal.x(), wall->normal.y(),
                            wall->normal.dot(Eigen::Vector2d(-turned.y(), turned.x())));
    information += place * J * J.transpose();
    information(2, 2) += 1.0 / (options_.line_slope_sigma_rad * options_.line_slope_sigma_rad);
  }
  LineMatchHypothesis hypothesis{T, information.llt().solve(Eigen::Matrix3d::Identity()),
                                 all_m_ > 0.0 ? (all_m_ - skipped_m) / all_m_ : 0.0, static_cast<int>(pairs_.size())};
  hypothesis.covariance = 0.5 * (hypothesis.covariance + hypothesis.covariance.transpose()).eval();
  comparisons_ += static_cast<std::int64_t>(answer_.hypotheses.size());
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
  visitor.Integer("max_comparisons", options.max_comparisons, "1", 1, 1'000'000'000'000,
                  "Hard bound on the search's work: scan lines compared with map lines, or what takes as long.");
  visitor.Integer("max_hypotheses", options.max_hypotheses, "1", 1, 100000, "Hard bound on the answers of a search.");
}

LineMatchAnswer MatchLinesWithMap(std::span<const MapLine> map, std::span<const LineFeature> scan,
                                  const LineMatchOptions& options, const std::optional<LineMatchWindow>& window) {
  return Search(map, scan, options, window).Run();
}

}  // namespace cairn::slam
