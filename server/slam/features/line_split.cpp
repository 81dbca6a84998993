#include <algorithm>
#include <cmath>

#include "server/slam/features/split_and_merge.h"

namespace cairn::slam {
namespace {

// A run of hits within one cluster, [begin, end) in clusters_.order, and the line fitted through them.
struct Run {
  int begin = 0;
  int end = 0;
  FittedLine line;
};

class Splitter {
 public:
  Splitter(const Sweep& sweep, const LineOptions& options)
      : sweep_(sweep), options_(options), clusters_(ClusterHits(sweep, options)) {
    prefix_.resize(clusters_.order.size() + 1);
    for (std::size_t k = 0; k < clusters_.order.size(); ++k) {
      prefix_[k + 1] = prefix_[k];
      prefix_[k + 1].Add(sweep.hit(clusters_.order[k]).p_robot);
    }
  }

  SplitResult Split() {
    for (const auto& [begin, end] : clusters_.runs) {
      const std::size_t first = runs_.size();
      SplitRun(begin, end);
      for (std::size_t k = first; k + 1 < runs_.size(); ++k) SettleBoundary(runs_[k], runs_[k + 1]);
      for (std::size_t k = first; k < runs_.size(); ++k) TrimEnds(runs_[k]);
    }
    std::sort(runs_.begin(), runs_.end(), [&](const Run& a, const Run& b) { return HitAt(a.begin) < HitAt(b.begin); });
    SplitResult result;
    result.owner.assign(clusters_.order.size(), -1);
    result.segments.reserve(runs_.size());
    for (std::size_t k = 0; k < runs_.size(); ++k) {
      const Run& run = runs_[k];
      for (int i = run.begin; i < run.end; ++i) {
        result.owner[static_cast<std::size_t>(HitAt(i))] = static_cast<int>(k);
      }
      const int first_hit = HitAt(run.begin), last_hit = HitAt(run.end - 1);
      result.segments.push_back({.begin = first_hit,
                                 .end = last_hit + 1 + (last_hit < first_hit ? sweep_.size() : 0),
                                 .sums = SumsOf(run.begin, run.end),
                                 .line = run.line});
    }
    return result;
  }

 private:
  [[nodiscard]] int HitAt(int i) const { return clusters_.order[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const BeamPoint& At(int i) const { return sweep_.hit(HitAt(i)); }
  [[nodiscard]] PointSums SumsOf(int begin, int end) const {
    return prefix_[static_cast<std::size_t>(end)] - prefix_[static_cast<std::size_t>(begin)];
  }

  [[nodiscard]] bool Fits(const Run& run) const {
    for (int i = run.begin; i < run.end; ++i) {
      if (std::abs(run.line.DistanceOf(At(i).p_robot)) > SplitDistance(At(i).range_m, options_)) return false;
    }
    return true;
  }

  // The inner hit of the run that is farthest from the chord between its ends. The least-squares line decides
  // only whether to split. The hit farthest from that line would be a wrong place to split at: the line
  // through an L is as far from the ends of the L as from its corner.
  [[nodiscard]] int FarthestFromChord(int begin, int end) const {
    const Eigen::Vector2d first = At(begin).p_robot, chord = At(end - 1).p_robot - first;
    const bool closed = chord.squaredNorm() < 1e-12;
    int farthest = begin + 1;
    double largest = -1.0;
    for (int i = begin + 1; i < end - 1; ++i) {
      const Eigen::Vector2d p = At(i).p_robot - first;
      const double distance = closed ? p.norm() : std::abs(chord.x() * p.y() - chord.y() * p.x());
      if (distance > largest) largest = distance, farthest = i;
    }
    return farthest;
  }

  void SplitRun(int begin, int end) {
    std::vector<std::pair<int, int>> open{{begin, end}};
    while (!open.empty()) {
      const auto [from, to] = open.back();
      open.pop_back();
      if (to - from < 2) continue;
      const Run run{from, to, FitLine(SumsOf(from, to))};
      if (to - from == 2 || Fits(run)) {
        runs_.push_back(run);
        continue;
      }
      const int split = FarthestFromChord(from, to);
      open.emplace_back(split, to);
      open.emplace_back(from, split);
    }
  }

  // Gives each hit around the common corner of two lines to the line to which it is nearer.
  void SettleBoundary(Run& before, Run& after) const {
    if (before.end != after.begin) return;
    const auto nearer_to = [&](const Run& a, const Run& b, int i) {
      const Eigen::Vector2d& p = At(i).p_robot;
      return std::abs(a.line.DistanceOf(p)) < std::abs(b.line.DistanceOf(p));
    };
    int boundary = before.end;
    while (boundary - before.begin > 2 && nearer_to(after, before, boundary - 1)) --boundary;
    if (boundary == before.end) {
      while (after.end - boundary > 2 && nearer_to(before, after, boundary)) ++boundary;
    }
    if (boundary == before.end) return;
    before.end = after.begin = boundary;
    before.line = FitLine(SumsOf(before.begin, before.end));
    after.line = FitLine(SumsOf(after.begin, after.end));
  }

  // Removes hits at the ends that lie too far from the line through the other hits.
  void TrimEnds(Run& run) const {
    constexpr int kLeastOthers = 4;
    for (const bool at_end : {false, true}) {
      while (run.end - run.begin > kLeastOthers) {
        const int begin = at_end ? run.begin : run.begin + 1, end = at_end ? run.end - 1 : run.end;
        const FittedLine others = FitLine(SumsOf(begin, end));
        const BeamPoint& hit = At(at_end ? run.end - 1 : run.begin);
        if (std::abs(others.DistanceOf(hit.p_robot)) <= EndDistance(others, hit.range_m, options_)) break;
        run = {begin, end, others};
      }
    }
  }

  const Sweep& sweep_;
  const LineOptions& options_;
  const HitClusters clusters_;
  std::vector<PointSums> prefix_;  // Prefix sums of the hits in the order of clusters_.order.
  std::vector<Run> runs_;
};

}  // namespace

SplitResult SplitIntoSegments(const Sweep& sweep, const LineOptions& options) {
  return Splitter(sweep, options).Split();
}

}  // namespace cairn::slam
