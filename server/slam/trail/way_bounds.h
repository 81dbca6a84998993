// Bounds from above how long the shortest way along the relations is from the last keyframe to any other. It remembers
// the lengths from some keyframes (the hubs), for which all were computed once, and continues them with each keyframe
// that comes: keyframes and relations are only added (until Clear), so no way becomes longer, and a way through a hub
// is a way. So a robot that stays in one building needs no search through all its keyframes any more. Not thread-safe.
// Source: landmarks and the triangle inequality as in Goldberg and Harrelson 2005 (there for bounds from below).
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace cairn::slam {

class WayBounds {
 public:
  // The next keyframe, so far from the one before.
  void Append(double step_m);
  // Two keyframes are so far from each other.
  void AddRelation(std::size_t from, std::size_t to, double way_m);
  // The lengths of the shortest ways from the last keyframe to each.
  void AddHub(std::span<const double> ways_m);
  // The keyframes have changed: forgets all.
  void Clear();

  // The way from the last keyframe to this one is at most so long; infinite if nothing is known.
  [[nodiscard]] double AtMostM(std::size_t keyframe) const;
  // Whether this bound is below `way_m` for all keyframes from `begin` on and before `end`. It may say no although it
  // is. REQUIRES: `begin` is a multiple of the smallest power of 16 that is not less than end - begin.
  [[nodiscard]] bool AllBelow(std::size_t begin, std::size_t end, double way_m) const;

 private:
  static constexpr std::size_t kMostHubs = 8;
  static constexpr double kSamePlaceM = 12.0;  // A new hub replaces one that is as near as this.
  static constexpr std::size_t kLevels = 6;
  static constexpr int kBits = 4;

  struct Hub {
    std::vector<float> ways_m;                          // At most so long; one per keyframe.
    std::array<std::vector<float>, kLevels> longest_m;  // Of 16, 256, 4096, ... keyframes.
    mutable std::size_t used_at = 0;                    // Number of keyframes when it helped last.

    void Append(double way_m);
  };

  void SortHubs();

  std::vector<Hub> hubs_;  // The nearest to the last keyframe comes first.
};

}  // namespace cairn::slam
