// FastSLAM: a particle filter over the robot's path whose particles carry their own landmark maps and decide for
// themselves which landmark a sighting shows. Two observations: landmarks, and revisits (the robot's place relative to
// an old keyframe by matching scans), which need only the particle's own path and so suit every variant. Variants:
//   FastSlam<LandmarkPair>      2.0, two positions a landmark (FS_2LS_2LP); thesis A 4.1-4.6
//   FastSlam<LandmarkOriented>  2.0, position and orientation (FS_3LS_1LP); thesis A 4.7
//   FastSlam<LandmarkPoint>     1.0, one position; thesis C 4.2
// 2.0 takes the observation into account before it samples (Proposal::kObservation); 1.0 samples the motion model and
// lets the weights do the rest. Thesis C Table 4.2 weighs with the landmark already updated, which uses the observation
// twice: corrected, weights come from the landmark as it was.
// A particle that finds a sighting new, or can not say what it is, is weighed by the density at the gate, so that
// particles with different answers compare. Copies of a particle share their landmarks until one of them changes.
// Frames: T_map_robot; sightings in `robot`. Not thread-safe. Deterministic for a seed.
// Source: thesis A chapter 4, thesis C 4.2; Montemerlo 2002, 2003 (per-particle association: 2003, 3.3).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/filters/association.h"
#include "server/slam/filters/back_end_options.h"
#include "server/slam/filters/contradictions.h"
#include "server/slam/filters/filter.h"
#include "server/slam/filters/landmark_candidates.h"
#include "server/slam/filters/landmark_index.h"
#include "server/slam/filters/landmark_oriented.h"
#include "server/slam/filters/landmark_pair.h"
#include "server/slam/filters/landmark_point.h"
#include "server/slam/filters/particle_set.h"

namespace cairn::slam {

enum class Proposal : std::uint8_t { kObservation = 0, kMotion };

template <typename LandmarkModel>
class FastSlam final : public Filter {
 public:
  FastSlam(Proposal proposal, const FastSlamOptions& options, const BackEndOptions& back_end, std::int64_t particles,
           const Pose2& T_map_robot_start, std::uint64_t seed);

  void Predict(const StepMotion& step) override;
  bool Observe(const RevisitObservation& revisit) override;
  void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) override;
  // Association, proposal and weights, sampling, landmark updates and new landmarks (Tables 4.3-4.8).
  void Observe(std::span<const LandmarkSighting> sightings, double travelled_m);
  void Commit() override;
  [[nodiscard]] bool rebases() const override { return true; }
  bool Rebase(std::span<const Pose2> path) override;

  [[nodiscard]] FilterEstimate estimate() const override { return set_.estimate(); }
  [[nodiscard]] FilterHealth health() const override;
  // The best particle, then every particle.
  [[nodiscard]] std::size_t hypothesis_count() const override { return set_.size() + 1; }
  [[nodiscard]] Hypothesis hypothesis(std::size_t index) const override;
  [[nodiscard]] std::vector<Landmark> landmarks() const override;

  [[nodiscard]] const ParticleSet& particles() const { return set_; }
  [[nodiscard]] std::size_t LandmarkCount(std::size_t particle) const;

 private:
  using Measurement = typename LandmarkModel::Measurement;
  struct Entry {
    LandmarkModel landmark;
    double last_observed_m = 0.0;
    std::uint32_t sightings = 0;       // 0: this particle does not have it.
    std::uint32_t first_keyframe = 0;  // It was first seen from here.
  };
  using Map = SharedSequence<Entry>;  // By slot.

  [[nodiscard]] std::vector<std::size_t> SlotsInReach(const LandmarkSighting& sighting) const;
  [[nodiscard]] Association Associate(std::size_t particle, const LandmarkSighting& sighting,
                                      const Measurement& measurement, std::span<const std::size_t> slots,
                                      double travelled_m) const;
  void Remember(std::size_t particle, const LandmarkSighting& sighting, const Measurement& measurement,
                const Association& association, double travelled_m);

  Proposal proposal_;
  BackEndOptions options_;
  double gate_;     // On the squared Mahalanobis distance.
  double new_nis_;  // The same for all numbers of a sighting.
  LandmarkCandidates candidates_;
  LandmarkIndex index_;
  ParticleSet set_;
  std::vector<Map> maps_;  // One per particle.
  Contradictions contradictions_;
};

extern template class FastSlam<LandmarkPair>;
extern template class FastSlam<LandmarkOriented>;
extern template class FastSlam<LandmarkPoint>;

}  // namespace cairn::slam
