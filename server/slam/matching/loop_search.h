// Finds large loops: places seen so long ago that nobody knows well where they lie from here. Compares the last stretch
// of the way, not one scan, with the surroundings of old keyframes over a window as wide as the doubt, and believes
// what it finds only if nothing else fits nearly as well, if no wall stands where beams went through, and if a second
// comparison further on agrees. Late rather than wrong. Small loops are RevisitSearch's. Not thread-safe.
// Source: matching by branch and bound as in Hess et al., ICRA 2016; confirmation by agreement between closures as in
// Olson 2009 (Recognizing places using spectrally clustered local matches), in its simplest form.
#pragma once

#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "common/options/option_visitor.h"
#include "server/slam/filters/filter.h"
#include "server/slam/matching/point_to_line.h"
#include "server/slam/matching/region.h"

namespace cairn::slam {

struct LoopOptions {
  bool enabled = true;
  double min_way_m = 60.0;    // Along what is known, between here and there; nearer: a revisit.
  double every_m = 1.0;       // Travelled between searches.
  double recent_m = 15.0;     // Length of the way whose surfaces are compared ...
  double around_m = 15.0;     // ... with those of the old way, this far to either side.
  double doubt_m = 1.5;       // The window reaches this far ...
  double doubt_per_m = 0.02;  // ... and this much per metre between here and there, ...
  double doubt_rad = 0.1;     // ... and turns this far ...
  double doubt_rad_per_m = 0.001;
  double max_doubt_m = 12.0;  // ... but no farther.
  double max_doubt_rad = 0.6;
  double min_score = 0.5;          // Mean likelihood of the recent surfaces.
  double max_rival = 0.9;          // Score of the best pose elsewhere over that of the best.
  double min_explained = 0.5;      // Share of the recent surfaces found again.
  double max_conflict = 0.10;      // Share of surfaces that stand where beams went through.
  double confirm_after_m = 1.5;    // Travelled between two comparisons that must agree ...
  double confirm_within_m = 10.0;  // ... and at most this.
  double agree_m = 0.5;
  double agree_rad = 0.06;
  double sigma_m = 0.1;  // Uncertainty of a loop's relation.
  double sigma_rad = 0.01;
};
void Visit(OptionVisitor& visitor, LoopOptions& options);

class LoopSearch {
 public:
  explicit LoopSearch(const LoopOptions& options, const PointToLineOptions& align);

  // The last keyframe as seen from an old one, once that is certain. `distances_m[k]`: along what is known, from the
  // last keyframe; `path`: where the keyframes are believed, the last one included.
  [[nodiscard]] std::optional<RevisitObservation> Find(std::span<const Keyframe> keyframes,
                                                       std::span<const KeyframeShape> shapes,
                                                       const SharedSequence<Pose2>& path,
                                                       std::span<const double> distances_m);

 private:
  struct Closure {
    std::size_t old = 0;
    std::size_t recent = 0;
    Pose2 T_old_recent;
    double score = 0.0;
  };
  [[nodiscard]] std::vector<std::size_t> Candidates(std::span<const KeyframeShape> shapes,
                                                    const SharedSequence<Pose2>& path,
                                                    std::span<const double> distances_m) const;
  [[nodiscard]] std::optional<Closure> Compare(std::span<const Keyframe> keyframes,
                                               std::span<const KeyframeShape> shapes, std::size_t old,
                                               const Pose2& T_old_recent_guess, double way_m) const;
  [[nodiscard]] bool Agree(const Closure& a, const Closure& b, std::span<const KeyframeShape> shapes) const;
  [[nodiscard]] double Reach(double way_m) const;

  LoopOptions options_;
  PointToLineOptions align_;
  double searched_at_m_ = 0.0;
  std::deque<Closure> unconfirmed_;
};

}  // namespace cairn::slam
