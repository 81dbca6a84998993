// What the search for large loops and the search for the robot in its whole map have in common: the pose at which
// recent surfaces fit best, if no other pose fits nearly as well, and when two such poses, found one after the other,
// agree. Stateless, thread-safe, deterministic.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/loops/region_search.h"

namespace cairn::slam {

inline constexpr double kStretchM = 15.0;         // Recent path that is compared.
inline constexpr std::size_t kMinSurfaces = 20;   // Fewest surfaces on either side.
inline constexpr double kSearchCellM = 0.1;       // Cell of the raster for the search.
inline constexpr double kLikelihoodReachM = 0.3;  // At this distance from a surface the likelihood is zero.
inline constexpr double kConfirmWithinM = 10.0;   // Largest way between two poses that confirm each other.
inline constexpr double kMinLikelihood = 0.5;     // Smallest mean likelihood of the surfaces at a pose.
inline constexpr double kFoundSigmaRad = 0.01;    // Standard deviation of the heading of a pose that was found.

// Pose T_ref_curr in the window at which the surfaces fit best. No value if they fit badly, if a pose farther away or
// with another heading has more than `max_rival` of the best score, or if the search had to be given up.
[[nodiscard]] std::optional<Pose2> FindUniquePose(std::span<const SurfacePoint> surfaces_curr,
                                                  const LikelihoodPyramid& pyramid_ref, const SearchWindow& window,
                                                  double max_rival);

// The same search, done in several parts. The pyramid must outlive it. Copyable.
class UniquePoseSearch {
 public:
  UniquePoseSearch(std::span<const SurfacePoint> surfaces_curr, const LikelihoodPyramid& pyramid_ref,
                   const SearchWindow& window, double max_rival);
  // The pose is probably in this small part of the window. This saves time: if it is there, it is searched for rivals
  // only.
  void LookFirstIn(const SearchWindow& likely);
  // Goes on until about so many blocks more are evaluated. Returns whether the search has ended.
  bool GoOn(int blocks);
  // Whether it has ended.
  [[nodiscard]] bool complete() const { return step_ == Step::kEnded; }
  // Of a search that has ended.
  [[nodiscard]] const std::optional<Pose2>& found() const { return found_; }
  // Of a search that has ended: the pose that fits best, also if it has rivals. No value if none fits, or if the search
  // had to be given up before it was known.
  [[nodiscard]] const std::optional<Pose2>& best() const { return best_; }

 private:
  enum class Step : std::uint8_t { kBest, kRivalOfLikely, kRival, kEnded };
  void LookForRivals(const RegionPeak& of, Step step);

  std::vector<Eigen::Vector2d> sample_;
  const LikelihoodPyramid* pyramid_;
  double max_rival_;
  PoseSearch search_;
  Step step_ = Step::kBest;
  std::optional<Pose2> best_;
  std::optional<Pose2> found_;
};

// The points with which poses are compared: at most 250 of the surfaces, spread over all of them.
[[nodiscard]] std::vector<Eigen::Vector2d> SampleOf(std::span<const SurfacePoint> surfaces);
// A pose within this of the best one is no rival of it.
[[nodiscard]] Exclusion ApartFrom(const Pose2& T_ref_curr);

// The covariance of the answer, for an alignment that starts there: the search is exact to some cells.
[[nodiscard]] Eigen::Matrix3d UniquePoseCovariance();

// Whether two searches found the same pose, each transformed to the same moment.
[[nodiscard]] bool ConfirmEachOther(const Pose2& a, const Pose2& b);

}  // namespace cairn::slam
