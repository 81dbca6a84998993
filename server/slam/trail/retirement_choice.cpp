#include "server/slam/trail/retirement_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "common/geometry/angle.h"

namespace cairn::slam {
namespace {

constexpr double kVisitM = 12.0;         // From the beginning of a visit: what comes after such a way is another one.
constexpr double kTiedM = 2.0;           // Largest way to a keyframe that has seen a place again.
constexpr int kHeadings = 8;             // Many lasers see only what lies ahead.
constexpr std::size_t kShortestRun = 4;  // Fewer keyframes in a row are not worth a gap in the path.
constexpr double kMostErrorM = 0.25;     // A match that contradicts the path by more is not believed.
constexpr double kMostErrorRad = 0.1;
constexpr std::size_t kLeastShare = 16;  // Nothing is retired if it is less than this part of the keyframes.

struct Cell {
  int x = 0;
  int y = 0;
  int heading = 0;
  auto operator<=>(const Cell&) const = default;
};

Cell CellOf(const Pose2& T_map_robot, double cell_m) {
  const double heading = std::floor((T_map_robot.theta + kPi) / (2.0 * kPi) * kHeadings);
  return {static_cast<int>(std::floor(T_map_robot.x / cell_m)), static_cast<int>(std::floor(T_map_robot.y / cell_m)),
          static_cast<int>(heading) % kHeadings};
}

// Per keyframe: whether its place relative to older ones was measured not far from it along the way.
std::vector<bool> Tied(const Trail& trail) {
  const std::span<const KeyframeShape> shapes = trail.shapes();
  std::vector<bool> tied(trail.size());
  const auto pass = [&](auto keyframe_at) {
    double seen_at_m = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < trail.size(); ++i) {
      const std::size_t k = keyframe_at(i);
      if (trail.HasLoop(k)) seen_at_m = shapes[k].travelled_m;
      if (std::abs(shapes[k].travelled_m - seen_at_m) <= kTiedM) tied[k] = true;
    }
  };
  pass([](std::size_t i) { return i; });
  pass([&](std::size_t i) { return trail.size() - 1 - i; });
  return tied;
}

// The keyframes of one cell, in order: marks those of the visits that are neither the first nor among the last.
void MarkBetween(const std::vector<std::size_t>& in_cell, std::span<const KeyframeShape> shapes, std::size_t visits,
                 const std::vector<bool>& may, std::vector<bool>& marked) {
  std::vector<std::size_t> begins;  // Of the visits, in `in_cell`.
  for (std::size_t i = 0; i < in_cell.size(); ++i)
    if (i == 0 || shapes[in_cell[i]].travelled_m - shapes[in_cell[begins.back()]].travelled_m >= kVisitM)
      begins.push_back(i);
  if (begins.size() <= visits) return;
  const std::size_t end = begins[begins.size() - (visits - 1)];
  for (std::size_t i = begins[1]; i < end; ++i) marked[in_cell[i]] = may[in_cell[i]];
}

// Each piece of the path that is left out ends some stretches along which searches go.
void KeepShortRuns(std::vector<bool>& marked) {
  for (std::size_t k = 0; k < marked.size();) {
    std::size_t end = k + 1;
    while (end < marked.size() && marked[end] == marked[k]) ++end;
    if (marked[k] && end - k < kShortestRun)
      std::fill(marked.begin() + static_cast<std::ptrdiff_t>(k), marked.begin() + static_cast<std::ptrdiff_t>(end),
                false);
    k = end;
  }
}

// Finds the keyframes that stand for those retired: one that the retired has been matched with, or the keyframe before
// it. Two matches in a row are exact to some centimetres, which the path need not be.
class Representatives {
 public:
  Representatives(const Trail& trail, const PosePath& path, const std::vector<bool>& retired)
      : shapes_(trail.shapes()), path_(path), relations_(trail.relations()), matched_(trail.size()) {
    for (const PoseRelation& one : relations_)
      if (one.loop && one.from < one.to) matched_[one.to] = &one;
    for (std::size_t k = 0; k < trail.size(); ++k) {
      stands_for.push_back(k);
      T_stands_keyframe.emplace_back();
      if (retired[k]) Find(k);
    }
  }

  std::vector<std::size_t> stands_for;
  std::vector<Pose2> T_stands_keyframe;

 private:
  // The first keyframe is never retired.
  void Find(std::size_t k) {
    if (matched_[k] != nullptr && Take(k, matched_[k]->from, matched_[k]->T_from_to)) return;
    if (shapes_[k - 1].number + 1 == shapes_[k].number &&
        Take(k, k - 1, Between(shapes_[k - 1].T_track_robot, shapes_[k].T_track_robot)))
      return;
    stands_for[k] = stands_for[k - 1];
    T_stands_keyframe[k] = Between(path_[stands_for[k]], path_[k]);
  }

  // False if this says something else than the path.
  bool Take(std::size_t k, std::size_t known, const Pose2& T_known_k) {
    const Pose2 T_stands_k = T_stands_keyframe[known] * T_known_k;
    const Pose2 error = Between(Between(path_[stands_for[known]], path_[k]), T_stands_k);
    if (error.translation().norm() > kMostErrorM || std::abs(error.theta) > kMostErrorRad) return false;
    stands_for[k] = stands_for[known];
    T_stands_keyframe[k] = T_stands_k;
    return true;
  }

  std::span<const KeyframeShape> shapes_;
  const PosePath& path_;
  std::vector<PoseRelation> relations_;
  std::vector<const PoseRelation*> matched_;  // Per keyframe: the relation with an older one; null: none.
};

}  // namespace

void Visit(OptionVisitor& visitor, RetireOptions& options) {
  visitor.Flag("enabled", options.enabled,
               ForOperators("Whether keyframes that show nothing new are forgotten, so that memory and time do not "
                            "grow with the way driven. The FastSLAM filters can do it."));
  visitor.Integer("from_keyframes", options.from_keyframes, "keyframes", 2, 100000000,
                  "With fewer keyframes none is forgotten. One takes some 3.5 KiB.");
  visitor.Integer("recent_keyframes", options.recent_keyframes, "keyframes", 200, 1000000,
                  "So many of the last keyframes are always kept.");
  visitor.Integer("visits", options.visits, "visits", 2, 1000,
                  "Of each place the first visit and the last ones are kept, so many in all.");
  visitor.Real("cell_m", options.cell_m, "m", 0.1, 10.0,
               "Side of the squares of the map that count as one place. Headings are told apart by 45 degrees.");
}

std::optional<Retirement> ChooseRetired(const Trail& trail, const PosePath& path, std::size_t end,
                                        const RetireOptions& options) {
  const std::vector<bool> tied = Tied(trail);
  std::map<Cell, std::vector<std::size_t>> cells;
  std::vector<bool> may(trail.size());
  for (std::size_t k = 0; k < trail.size(); ++k) {
    if (!trail.keyframes()[k].localized) continue;
    may[k] = k < end && tied[k];
    cells[CellOf(path[k], options.cell_m)].push_back(k);
  }
  std::vector<bool> retired(trail.size());
  for (const auto& [cell, in_cell] : cells)
    MarkBetween(in_cell, trail.shapes(), static_cast<std::size_t>(options.visits), may, retired);
  KeepShortRuns(retired);
  const auto count = static_cast<std::size_t>(std::ranges::count(retired, true));
  if (count == 0 || count < trail.size() / kLeastShare) return std::nullopt;

  Representatives representatives(trail, path, retired);
  Retirement result{.kept = {},
                    .stands_for = std::move(representatives.stands_for),
                    .index_after = {},
                    .T_stands_keyframe = std::move(representatives.T_stands_keyframe)};
  for (std::size_t k = 0; k < trail.size(); ++k)
    if (!retired[k]) result.kept.push_back(k);
  std::vector<std::size_t> after(trail.size());
  for (std::size_t i = 0; i < result.kept.size(); ++i) after[result.kept[i]] = i;
  for (const std::size_t k : result.stands_for) result.index_after.push_back(after[k]);
  return result;
}

}  // namespace cairn::slam
