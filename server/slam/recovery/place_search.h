// Finds the robot in a map, mostly the one that it has made itself, without knowing anything of where it is: after
// scans are missing and odometry does not tell how the robot moved meanwhile, or after somebody carried it. The last
// scans are compared with all surfaces of the map. A place is found only if no other place fits nearly as well, if most
// of the scans is explained, and if no surface lies where beams passed. Where rooms look alike there is no such place.
// In doubt nothing is found. But a place that the map does not show can be taken for one that it shows and that looks
// the same. Frames: surfaces in `map`; recent scans in any frame that is smooth over their stretch. Not thread-safe.
// Deterministic. Source: as LoopSearch (loop_search.h), over the whole map at once; visibility.h.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/slam/loops/loop_search.h"
#include "server/slam/loops/self_check.h"
#include "server/slam/loops/unique_pose.h"
#include "server/slam/recovery/recovery_options.h"
#include "server/slam/recovery/searched_map.h"

namespace cairn::slam {

// One of the last scans of a robot whose place is not known.
struct RecentScan {
  std::shared_ptr<const Scan> scan;
  Pose2 T_track_robot;
  double travelled_m = 0.0;
  std::vector<SurfacePoint> points;  // In the robot's frame. They follow from the scan and are not stored.

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.scan, self.T_track_robot, self.travelled_m);
    if constexpr (Archive::kReads) archive.Require(self.scan != nullptr, "one of the last scans");
  }
};

struct FoundPlace {
  Pose2 T_map_robot;  // At the last scan.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

// Where the last of some scans may have been seen.
struct RankedPlaces {
  struct Place {
    Pose2 T_map_robot;
    double score = 0.0;  // Mean likelihood of the surfaces, 0..1.
  };
  std::vector<Place> places;  // The best one first.
  bool complete = true;       // False: a search ended at its bound on work, and there may be other places.
  // The place, exactly, if it has no rival and the scans do not contradict it: as PlaceSearch::Find.
  std::optional<FoundPlace> found;

  // The score of the second place over that of the first: near 1 where two places look alike, 0 where no other place
  // has half of the score of the best.
  [[nodiscard]] double ambiguity() const { return places.size() < 2 ? 0.0 : places[1].score / places[0].score; }
};

class PlaceSearch {
 public:
  // Shares the options of large loops and of the self-check, so that a place is judged alike everywhere.
  PlaceSearch(const PlaceSearchOptions& options, const LoopOptions& loop, const SelfCheckOptions& check,
              const PointToLineOptions& align);

  // The place of the last of the scans, which are in the order of time. REQUIRES: the map does not change between two
  // calls, unless Forget is called.
  [[nodiscard]] std::optional<FoundPlace> Find(const SearchedMap& map, std::span<const RecentScan> recent);
  // The same in several parts, for a caller that has not the time to wait for all of it. With `T_map_believed`, where
  // the last of the scans is believed to be, it takes less time if it is there.
  void Begin(const SearchedMap& map, std::span<const RecentScan> recent, const std::optional<Pose2>& T_map_believed);
  // Whether a search has begun, and nothing has ended it.
  [[nodiscard]] bool searching() const { return search_.has_value(); }
  // Goes on until about so many blocks more are evaluated (PoseSearch). REQUIRES: searching.
  void GoOn(int blocks) { search_->poses.GoOn(blocks); }
  // Whether nothing is left to search. REQUIRES: searching.
  [[nodiscard]] bool complete() const { return search_->poses.complete(); }
  struct Ended {
    std::optional<FoundPlace> found;  // As Find.
    std::optional<FoundPlace> best;   // Where the scans fit best, if nothing contradicts it there; it may have rivals.
  };
  // Ends a search of which nothing is left. Returns the place of the last of `recent`, which go on from those at Begin.
  [[nodiscard]] Ended End(const SearchedMap& map, std::span<const RecentScan> recent);
  void Stop() { search_.reset(); }
  // The same, in the part of the map around a pose where the last of the scans is believed to be: within
  // PlaceSearchOptions::near_m and near_rad, or farther.
  [[nodiscard]] std::optional<FoundPlace> FindNear(const SearchedMap& map, std::span<const RecentScan> recent,
                                                   const Pose2& T_map_robot, double reach_m = 0.0,
                                                   double reach_rad = 0.0);
  struct Returned {
    FoundPlace place;
    bool clear = false;  // It is also what FindNear finds.
  };
  // As FindNear, for a robot that comes back into the map. Much of what it sees lies where the map shows nothing, so
  // that no more must be explained than of any scan that is aligned, and as much may contradict as where a loop is
  // closed. One such place that is not `clear` is no proof.
  [[nodiscard]] std::optional<Returned> FindReturned(const SearchedMap& map, std::span<const RecentScan> recent,
                                                     const Pose2& T_map_robot, double reach_m, double reach_rad);
  // All places that may be that of the last of the scans, at most `most`. `go_on` is asked between the searches, each
  // of which is bounded (kMaxBlocks); if it returns false, what was found so far is returned and must not be used.
  // REQUIRES: as Find.
  [[nodiscard]] RankedPlaces Rank(const SearchedMap& map, std::span<const RecentScan> recent, std::size_t most,
                                  const std::function<bool()>& go_on);
  void Forget() {
    search_.reset();
    index_.reset();
  }
  // How well the surfaces of these scans fit, with the last of them at this pose and as seen best with a search of some
  // cells around it, 0..1. REQUIRES: as Find.
  [[nodiscard]] double ScoreAt(const SearchedMap& map, std::span<const RecentScan> recent, const Pose2& T_map_robot);
  // Whether they fit with more than `score` anywhere else, or may do so, because the search had to be given up.
  [[nodiscard]] bool FitsElsewhere(const SearchedMap& map, std::span<const RecentScan> recent, const Pose2& T_map_robot,
                                   double score);

  // How a scan at this pose agrees with old keyframes near it.
  enum class Agreement { kNothingNear, kAgrees, kDoubtful, kContradicts };
  [[nodiscard]] Agreement Compare(const SearchedMap& map, const Scan& scan,
                                  const std::vector<SurfacePoint>& points_robot, const Pose2& T_map_robot) const;

 private:
  // What a place must be like: as PlaceSearchOptions.
  struct Limits {
    double min_explained = 0.0;
    double max_conflict = 0.0;
  };
  [[nodiscard]] Limits usual() const { return {options_.min_explained, options_.max_conflict}; }
  // The pose near this one at which everything fits.
  [[nodiscard]] std::optional<Returned> Fit(const SearchedMap& map, std::span<const RecentScan> recent,
                                            const std::vector<SurfacePoint>& surfaces, const Pose2& T_map_robot,
                                            const Limits& limits) const;
  // Over all of the map if there is no window.
  [[nodiscard]] std::optional<Returned> FindWithin(const SearchWindow* window, const SearchedMap& map,
                                                   std::span<const RecentScan> recent, const Limits& limits);
  [[nodiscard]] SearchWindow WindowAround(const Pose2& T_map_robot, double reach_m, double reach_rad) const;
  const IndexedSurfaces& IndexOf(const SearchedMap& map);

  PlaceSearchOptions options_;
  LoopOptions loop_;
  SelfCheckOptions check_;
  PointToLineOptions align_;
  std::shared_ptr<const IndexedSurfaces> index_;  // Asked for at the first search.
  struct Search {
    UniquePoseSearch poses;
    Pose2 T_track_robot;  // Of the last scan at its begin.
  };
  std::optional<Search> search_;  // In `index_`.
};

}  // namespace cairn::slam
