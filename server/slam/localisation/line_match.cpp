#include "server/slam/localisation/line_match.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "server/slam/matchers/line_least_squares.h"

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

constexpr double kSlack =
    1.5;  // Factor of the tolerances while the pose comes from a few pairs only and is not yet exact.

// Whether two lines cross at a large enough angle to determine the position.
bool CrossAt(const LineFeature& a, const LineFeature& b) {
  return std::abs(std::sin(a.slope - b.slope)) > std::sin(Radians(20.0));
}

// The pose from a set of pairs.
struct Placing {
  Pose2 T_map_robot;
  bool placed = false;  // False if the pairs give the heading only.
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
  bool Take(const Pair& pair, double skipped_m);  // Returns false if the pair is impossible.
  [[nodiscard]] const Wall* BestWall(const LineFeature& line, const Pose2& T_map_robot) const;
  [[nodiscard]] std::optional<Placing> Verify() const;
  [[nodiscard]] LineAlignment Solve() const;
  [[nodiscard]] bool Fits(const Pair& pair, const Placing& placing, double slack) const;
  [[nodiscard]] bool MayBe(const Pair& pair, const Placing& placing) const;
  [[nodiscard]] bool InWindow(const Pair& first) const;
  [[nodiscard]] bool InWindow(const Placing& placing) const;
  void Keep(double skipped_m);
  [[nodiscard]] bool WithinBounds() const {
    return comparisons_ <= options_.max_comparisons &&
           answer_.hypotheses.size() <= static_cast<std::size_t>(options_.max_hypotheses);
  }
  // Calls `act` for the walls in this direction within the tolerance, or for all walls if the direction is
  // not known.
  template <typename Do>
  void ForWallsAlong(std::optional<double> direction, double tolerance_rad, const Do& act) const;

  const LineMatchOptions& options_;
  const std::optional<LineMatchWindow>& window_;
  std::vector<Wall> walls_;                // The walls, ordered by direction.
  std::vector<const LineFeature*> order_;  // The scan's lines, the longest first.
  std::vector<char> done_;                 // For each line of `order_`: 1 if it is assigned or skipped.
  double all_m_ = 0.0;
  std::vector<Pair> pairs_;
  LineMatchAnswer answer_;
  // Counts the comparisons and bounds the search. Mutable, because const functions count as well.
  mutable std::int64_t comparisons_ = 0;
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
      if (k == 0) continue;  // Rounding may put the first wall exactly on the edge.
      return;
    }
    act(wall);
  }
}

// Selects the longest remaining line, which restricts the pose most. The second line must cross the first, so
// that the two determine the position.
std::optional<std::size_t> Search::SelectScanline(const Placing& placing) const {
  for (std::size_t s = 0; s < order_.size(); ++s) {
    if (done_[s] != 0) continue;
    if (pairs_.empty() || placing.placed || CrossAt(*order_[s], *pairs_.front().line)) return s;
  }
  return std::nullopt;
}

// LINEMATCH: tries the next scan line with every possible wall, or with none (as printed it must have one).
// With kFirstTwo the rest of the scan has only one assignment once the pairs determine the position: each
// line belongs to the wall on which it lies, if any.
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
  const bool as_printed = options_.pairing == LineMatchPairing::kRecursive;
  if (placing.placed && !as_printed) {
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
    if (placing.placed) tolerance *= kSlack;
    ForWallsAlong(direction, tolerance, [&](const Wall& wall) {
      if (MayBe({&wall, &line}, placing)) Take({&wall, &line}, skipped_m);
    });
  }
  const double skipped = skipped_m + line.length;
  if (!as_printed && !taken && skipped <= (1.0 - options_.min_share) * all_m_) Extend(skipped, placing);
  done_[*next] = 0;
}

bool Search::Take(const Pair& pair, double skipped_m) {
  pairs_.push_back(pair);
  const auto placing = Verify();
  if (placing) Extend(skipped_m, *placing);
  pairs_.pop_back();
  return placing.has_value();
}

// Checks of a pair that do not need the least squares.
bool Search::MayBe(const Pair& pair, const Placing& placing) const {
  if (placing.placed) return Fits(pair, placing, kSlack);
  return pair.line->length <= pair.wall->length + options_.overhang_m && InWindow(pair);
}

const Wall* Search::BestWall(const LineFeature& line, const Pose2& T_map_robot) const {
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
  constexpr std::int64_t kWorth = 300;  // Comparisons that take as long as one least squares.
  comparisons_ += kWorth;
  std::vector<WeightedPair> weighted;
  weighted.reserve(pairs_.size());
  for (const auto& [wall, line] : pairs_)
    weighted.push_back({{0.5 * (wall->line.a + wall->line.b), wall->normal}, MidpointAndNormal(*line), line->length});
  const auto& [wall, line] = pairs_.front();
  const Pose2 turn{0.0, 0.0, AngleDiff(wall->direction, line->slope)};
  const Eigen::Vector2d t = 0.5 * (wall->line.a + wall->line.b) - turn * line->midpoint();
  LineLeastSquaresOptions solve;
  // The midpoint of a whole wall and that of its visible part are not related.
  solve.along_weight = 1e-6;
  solve.max_iterations = 6;
  solve.stop_step = 1e-4;
  return AlignLinePairs(weighted, {t.x(), t.y(), turn.theta}, solve);
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

// VerifyMatch: returns the pose if all pairs can be right at once.
std::optional<Placing> Search::Verify() const {
  if (pairs_.size() == 1) {
    const auto& [wall, line] = pairs_.front();
    return Placing{{0.0, 0.0, AngleDiff(wall->direction, line->slope)}, false};
  }
  // SelectScanline ensures that the pairs determine the position.
  const Placing placing{Solve().T_ref_curr, true};
  const bool fit = std::ranges::all_of(pairs_, [&](const Pair& pair) { return Fits(pair, placing, 1.0); });
  return fit && InWindow(placing) ? std::optional(placing) : std::nullopt;
}

// An assignment whose lines cross becomes a hypothesis. It replaces a neighbouring one that is worse.
void Search::Keep(double skipped_m) {
  const Pose2 T = Solve().T_ref_curr;
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
  static constexpr std::string_view kPairings[] = {"first_two", "recursive"};
  VisitEnum(visitor, "pairing", options.pairing, kPairings,
            "How lines are paired. With first_two, two pairs give the place and each further line is the wall it lies "
            "on, or none; with recursive, every line is tried with every wall that fits and none may stay unpaired, as "
            "thesis B prints it.");
  visitor.Real("offset_m", options.offset_m, "m", 0.001, 2.0,
               "A line of the scan lies at most this far from its line of the map.");
  visitor.Real("slope_rad", options.slope_rad, "rad", 0.001, 1.0,
               "A line of the scan is turned at most by this against its line of the map.");
  visitor.Real("overhang_m", options.overhang_m, "m", 0.0, 5.0,
               "A line of the scan reaches at most this far beyond the ends of its line of the map.");
  visitor.Real("min_line_m", options.min_line_m, "m", 0.0, 10.0, "Lines of the scan that are shorter are not used.");
  visitor.Real("min_share", options.min_share, "1", 0.0, 1.0,
               "Share of the total length of the lines of the scan that must be found in the map.");
  visitor.Real("same_m", options.same_m, "m", 0.0, 10.0,
               "Poses that are nearer to each other than this, and turned by less than same_rad, count as one.");
  visitor.Real("same_rad", options.same_rad, "rad", 0.0, kPi,
               "Poses that are turned by less than this, and nearer than same_m, count as one.");
  visitor.Real("line_sigma_m", options.line_sigma_m, "m", 1e-4, 1.0,
               "Standard deviation of the place of a line of the scan.");
  visitor.Real("line_slope_sigma_rad", options.line_slope_sigma_rad, "rad", 1e-5, 1.0,
               "Standard deviation of the slope of a line of the scan.");
  visitor.Integer("max_comparisons", options.max_comparisons, "1", 1, 1'000'000'000'000,
                  "Most comparisons of a line of the scan with a line of the map in one search, or as much other work. "
                  "A comparison takes about 10 ns.");
  visitor.Integer("max_hypotheses", options.max_hypotheses, "1", 1, 100000, "Most poses that a search answers.");
}

LineMatchAnswer MatchLinesWithMap(std::span<const MapLine> map, std::span<const LineFeature> scan,
                                  const LineMatchOptions& options, const std::optional<LineMatchWindow>& window) {
  return Search(map, scan, options, window).Run();
}

}  // namespace cairn::slam
