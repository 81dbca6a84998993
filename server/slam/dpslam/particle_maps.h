// The maps of all particles, in their ancestry tree: computes how well evidence agrees with each map, and
// draws evidence into them. Evidence is a piece of trajectory with its scans: one scan in the low level, a
// whole segment in the high level. A particle is first evaluated with a quarter of the rays; if it is then
// too far behind the best, the other rays are skipped.
// Frames: `map` of the particles; evidence is placed by T_map_start. Not thread-safe; distributes its work by
// ParallelFor, with the same result on any number of threads.
// Source: Eliazar, Parr 2003, 2004; thesis C 3.2.3.2-4.
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

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.rays, self.T_start_robot);
  }
};
using Evidence = std::vector<PlacedRays>;

// One placement of evidence in one map.
struct MapSample {
  Pose2 T_map_start;
  std::size_t map = 0;       // Index of the inherited map.
  std::size_t evidence = 0;  // Index of the evidence among the alternatives.
  bool operator==(const MapSample&) const = default;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.T_map_start, self.map, self.evidence);
  }
};

struct LikelihoodOptions {
  RayModel model;
  std::size_t ray_stride = 1;  // Every n-th ray is used.
  // A sample is given up if its log likelihood by the first quarter of the rays is this far behind the best;
  // <= 0: never.
  double give_up_behind = 100.0;
};

class ParticleMaps {
 public:
  explicit ParticleMaps(const OpacityOptions& options) : options_(options), rate_(options) {}

  // Log likelihood of each sample; minus infinity for those that were given up. REQUIRES: samples ordered by
  // map.
  [[nodiscard]] std::vector<double> LogLikelihoods(std::span<const MapSample> samples,
                                                   std::span<const Evidence> evidence, const LikelihoodOptions& options,
                                                   const ParallelFor& parallel_for) const;
  // The changes by which each survivor extends its map when its evidence is drawn.
  [[nodiscard]] std::vector<Ancestry::Child> Draw(std::span<const MapSample> survivors,
                                                  std::span<const Evidence> evidence,
                                                  const ParallelFor& parallel_for) const;
  // Replaces the maps by those of `children`, in their order. REQUIRES: at least one child, ordered by parent.
  void NextGeneration(std::vector<Ancestry::Child> children) { ancestry_.NextGeneration(std::move(children)); }

  // Removes from all maps the tiles that are farther away.
  void KeepNear(const Eigen::Vector2d& p_map, double radius_m);

  [[nodiscard]] std::size_t count() const { return ancestry_.living().size(); }
  [[nodiscard]] bool blank() const { return ancestry_.size() == 1 && ancestry_.changes(ancestry_.living()[0]).empty(); }
  [[nodiscard]] const Ancestry& ancestry() const { return ancestry_; }
  [[nodiscard]] const OpacityOptions& options() const { return options_; }
  [[nodiscard]] const StopRate& rate() const { return rate_; }
  // Probability (0..100) that a ray straight through a cell is stopped there, for one map together with the
  // scans `undrawn`; unknown in cells that no ray has crossed.
  [[nodiscard]] OccupancyImage Image(std::size_t map, std::span<const PlacedRays> undrawn = {}) const;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.ancestry_);
  }

 private:
  OpacityOptions options_;
  StopRate rate_;
  Ancestry ancestry_;
};

}  // namespace cairn::slam
