// The maps of all particles, in their family tree: how well evidence agrees with each, and drawing it there. Evidence
// is a piece of trajectory with its scans: one scan in the low level, a whole segment in the high level. A particle is
// judged by a quarter of the rays first; who then is hopelessly behind the best sees no more of them. Frames: `map` of
// the particles; evidence is placed by T_map_start. Not thread-safe; spreads its work by ParallelFor, with the same
// result on any number of threads. Source: Eliazar, Parr 2003, 2004; thesis C 3.2.3.2-4.
#pragma once

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "common/map/occupancy_image.h"
#include "server/slam/dpslam/ancestry.h"
#include "server/slam/dpslam/laser_rays.h"
#include "server/slam/dpslam/ray_likelihood.h"
#include "server/slam/parallel_for.h"

namespace cairn::slam {

struct PlacedRays {
  std::shared_ptr<const LaserRays> rays;
  Pose2 T_start_robot;
};
using Evidence = std::vector<PlacedRays>;

// A particle as its maps see it.
struct MapSample {
  Pose2 T_map_start;
  std::size_t map = 0;       // Which of the maps it has inherited.
  std::size_t evidence = 0;  // Which of the alternatives it has experienced.
  bool operator==(const MapSample&) const = default;
};

struct JudgeOptions {
  RayModel model;
  std::size_t ray_stride = 1;     // Every n-th ray takes part.
  double give_up_behind = 100.0;  // Log likelihood behind the best, by a quarter of the rays; <= 0: never.
};

class ParticleMaps {
 public:
  explicit ParticleMaps(const OpacityOptions& options) : options_(options), rate_(options) {}

  // Of each sample; minus infinity for those given up. REQUIRES: samples ordered by map.
  [[nodiscard]] std::vector<double> LogLikelihoods(std::span<const MapSample> samples,
                                                   std::span<const Evidence> evidence, const JudgeOptions& options,
                                                   const ParallelFor& parallel_for) const;
  // What each of them would add to its map by drawing its evidence.
  [[nodiscard]] std::vector<Ancestry::Birth> Draw(std::span<const MapSample> survivors,
                                                  std::span<const Evidence> evidence,
                                                  const ParallelFor& parallel_for) const;
  // From now on there is a map for each birth, in their order. REQUIRES: ordered by parent, at least one.
  void NextGeneration(std::vector<Ancestry::Birth> births) { ancestry_.NextGeneration(std::move(births)); }

  // All maps forget what is farther away, in whole tiles.
  void KeepNear(const Eigen::Vector2d& p_map, double radius_m);

  [[nodiscard]] std::size_t count() const { return ancestry_.living().size(); }
  [[nodiscard]] bool blank() const { return ancestry_.size() == 1 && ancestry_.changes(ancestry_.living()[0]).empty(); }
  [[nodiscard]] const Ancestry& ancestry() const { return ancestry_; }
  [[nodiscard]] const OpacityOptions& options() const { return options_; }
  [[nodiscard]] const StopRate& rate() const { return rate_; }
  // How likely a ray straight through each cell of one map, and what is still to be drawn in it, is stopped there,
  // 0..100; unknown where none has been.
  [[nodiscard]] OccupancyImage Image(std::size_t map, std::span<const PlacedRays> undrawn = {}) const;

 private:
  OpacityOptions options_;
  StopRate rate_;
  Ancestry ancestry_;
};

}  // namespace cairn::slam
