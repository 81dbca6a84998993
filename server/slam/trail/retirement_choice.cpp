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
constexpr double kNearM = 3.0;           // Largest distance between a keyframe and its representative.
constexpr double kMostErrorM = 0.25;     // A match that contradicts the path by more is not believed.
constexpr double kMostErrorRad = 0.1;
constexpr std::size_t kLeastShare = 16;  // Nothing is retired if it is less than this part of the keyframes.

struct Cell {
  int x = 0;
  int y = 0;
  int heading = 0;
  auto operator<=>(const Cell&) const = default;
};

// Not every number that a file may hold is a place.
bool IsUsable(const Pose2& T_map_robot) {
  constexpr double kFarthestM = 1e7;
  return T_map_robot.IsFinite() && T_map_robot.translation().cwiseAbs().maxCoeff() < kFarthestM;
}

Cell CellOf(const Pose2& T_map_robot, double cell_m) {
  const double heading = std::floor((WrapAngle(T_map_robot.theta) + kPi) / (2.0 * kPi) * kHeadings);
  return {static_cast<int>(std::floor(T_map_robot.x / cell_m)), static_cast<int>(std::floor(T_map_robot.y / cell_m)),
          static_cast<int>(heading) % kHeadings};
}

// Per keyframe: the nearest older keyframe that it has been matched with on another visit; null if there is none.
// Relations along the same drive (Mapper::AdoptGrid adds some) are no matches.
std::vector<const PoseRelation*> MatchesOf(const std::vector<PoseRelation>& relations,
                                           std::span<const KeyframeShape> shapes) {
  std::vector<const PoseRelation*> matches(shapes.size());
  for (const PoseRelation& one : relations) {
    if (!one.loop || shapes[one.to].travelled_m - shapes[one.from].travelled_m < kVisitM) continue;
    const PoseRelation*& match = matches[one.to];
    if (match == nullptr || one.T_from_to.translation().norm() < match->T_from_to.translation().norm()) match = &one;
  }
  return matches;
}

// Per keyframe: whether it or one not far from it along the way has a match.
std::vector<bool> Tied(const std::vector<const PoseRelation*>& matches, std::span<const KeyframeShape> shapes) {
  std::vector<bool> tied(shapes.size());
  const auto pass = [&](auto keyframe_at) {
    double matched_at_m = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      const std::size_t k = keyframe_at(i);
      if (matches[k] != nullptr) matched_at_m = shapes[k].travelled_m;
      if (std::abs(shapes[k].travelled_m - matched_at_m) <= kTiedM) tied[k] = true;
    }
  };
  pass([](std::size_t i) { return i; });
  pass([&](std::size_t i) { return shapes.size() - 1 - i; });
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

// Searches use keyframes that follow each other (StretchAround), so a gap costs more than a few keyframes.
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

// Finds a kept keyframe near each retired one: that of the keyframe it has been matched with, or that of the keyframe
// before it. Their poses relative to each other come from these matches and steps, which are more exact than the path.
// A keyframe for which none is found is not retired.
class Representatives {
 public:
  Representatives(const Trail& trail, const PosePath& path, const std::vector<const PoseRelation*>& matches,
                  std::vector<bool>& retired)
      : shapes_(trail.shapes()), path_(path), matches_(matches) {
    for (std::size_t k = 0; k < trail.size(); ++k) {
      representative.push_back(k);
      T_representative_keyframe.emplace_back();
      if (retired[k]) retired[k] = Find(k);
    }
  }

  std::vector<std::size_t> representative;
  std::vector<Pose2> T_representative_keyframe;

 private:
  bool Find(std::size_t k) {
    if (matches_[k] != nullptr && Take(k, matches_[k]->from, matches_[k]->T_from_to)) return true;
    return k > 0 && shapes_[k - 1].number + 1 == shapes_[k].number &&
           Take(k, k - 1, Between(shapes_[k - 1].T_track_robot, shapes_[k].T_track_robot));
  }

  // False if that one is not near, or if the path says something else.
  bool Take(std::size_t k, std::size_t known, const Pose2& T_known_k) {
    const Pose2 T_representative_k = T_representative_keyframe[known] * T_known_k;
    const Pose2 error = Between(Between(path_[representative[known]], path_[k]), T_representative_k);
    if (error.translation().norm() > kMostErrorM || std::abs(error.theta) > kMostErrorRad) return false;
    if (T_representative_k.translation().norm() > kNearM) return false;
    representative[k] = representative[known];
    T_representative_keyframe[k] = T_representative_k;
    return true;
  }

  std::span<const KeyframeShape> shapes_;
  const PosePath& path_;
  const std::vector<const PoseRelation*>& matches_;
};

}  // namespace

void Visit(OptionVisitor& visitor, RetireOptions& options) {
  visitor.Flag("enabled", options.enabled,
               ForOperators("Whether keyframes that show nothing new are forgotten, so that memory and time do not "
                            "grow with the way driven. The FastSLAM filters can do it."));
  visitor.Integer("from_keyframes", options.from_keyframes, "keyframes", 2, 100000000,
                  "With fewer keyframes none is forgotten. One takes some 3.5 KiB.");
  visitor.Integer("recent_keyframes", options.recent_keyframes, "keyframes", 2, 1000000,
                  "So many of the last keyframes are always kept.");
  visitor.Integer("visits", options.visits, "visits", 2, 1000,
                  "Of each place the first visit and the last ones are kept, so many in all.");
  visitor.Real("cell_m", options.cell_m, "m", 0.1, 10.0,
               "Side of the squares of the map that count as one place. Headings are told apart by 45 degrees.");
}

std::optional<Retirement> ChooseRetired(const Trail& trail, const PosePath& path, std::size_t end,
                                        const RetireOptions& options) {
  const std::vector<PoseRelation> relations = trail.relations();
  const std::vector<const PoseRelation*> matches = MatchesOf(relations, trail.shapes());
  const std::vector<bool> tied = Tied(matches, trail.shapes());
  std::map<Cell, std::vector<std::size_t>> cells;
  std::vector<bool> may(trail.size());
  for (std::size_t k = 0; k < trail.size(); ++k) {
    if (!trail.keyframes()[k].localized || !IsUsable(path[k])) continue;
    may[k] = k < end && tied[k];
    cells[CellOf(path[k], options.cell_m)].push_back(k);
  }
  std::vector<bool> retired(trail.size());
  for (const auto& [cell, in_cell] : cells)
    MarkBetween(in_cell, trail.shapes(), static_cast<std::size_t>(options.visits), may, retired);
  KeepShortRuns(retired);
  Representatives found(trail, path, matches, retired);
  const auto count = static_cast<std::size_t>(std::ranges::count(retired, true));
  if (count == 0 || count < trail.size() / kLeastShare) return std::nullopt;

  Retirement result{.kept = {},
                    .representative = std::move(found.representative),
                    .index_after = {},
                    .T_representative_keyframe = std::move(found.T_representative_keyframe)};
  for (std::size_t k = 0; k < trail.size(); ++k)
    if (!retired[k]) result.kept.push_back(k);
  std::vector<std::size_t> after(trail.size());
  for (std::size_t i = 0; i < result.kept.size(); ++i) after[result.kept[i]] = i;
  for (const std::size_t k : result.representative) result.index_after.push_back(after[k]);
  return result;
}

}  // namespace cairn::slam
