// FastSLAM: a particle filter over the robot's path. Every particle has its own landmark map and its own
// association of sightings with landmarks. There are two kinds of observations: landmarks, and revisits (the
// robot's pose relative to an old keyframe, by scan matching), which need only the particle's path and
// therefore suit every variant. The model of a landmark is the template's argument; the default is
// LandmarkPair, and the variants are chosen in methods.cpp.
// FastSLAM 2.0 uses the observation before it samples. FastSLAM 1.0, which gets a MotionSampler, samples the
// motion model and uses the observation for the weights only. Corrected: thesis C Table 4.2 computes the
// weight from the landmark after its update, which uses the observation twice; here the weight is computed
// from the landmark before its update. A particle to which a sighting is new or ambiguous is weighted with
// the density at the gate, so that the weights of particles with different associations are comparable.
// Copies of a particle share their landmarks until one of them changes. Frames: T_map_robot; sightings in
// `robot`. Not thread-safe. Deterministic for a given seed.
// Source: thesis A chapter 4, thesis C 4.2; Montemerlo 2002, 2003 (association per particle: 2003, 3.3).
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "server/slam/fastslam/particle_set.h"
#include "server/slam/filters/filter.h"
#include "server/slam/filters/filter_health.h"
#include "server/slam/landmarks/association.h"
#include "server/slam/landmarks/innovation.h"
#include "server/slam/landmarks/landmark_candidates.h"

namespace cairn::slam {

template <typename LandmarkModel>
class FastSlam final : public Filter {
 public:
  // With a `sampler` the filter is FastSLAM 1.0, without one FastSLAM 2.0.
  FastSlam(const FastSlamOptions& options, const BackEndOptions& back_end, std::int64_t particles,
           const Pose2& T_map_robot_start, std::uint64_t seed, MotionSampler sampler = {});

  void Predict(const StepMotion& step) override;
  bool GoOnAt(const FilterEstimate& place) override {
    set_.GoOnAt(place);
    return true;
  }
  bool Observe(const RevisitObservation& revisit) override;
  void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) override;
  // Association, proposal and weights, sampling, landmark updates and new landmarks (Tables 4.3-4.8).
  void Observe(std::span<const LandmarkSighting> sightings, double travelled_m);
  void Commit() override;
  [[nodiscard]] bool rebases() const override { return true; }
  void Rebase(std::span<const Pose2> path) override;
  void MoveTo(std::span<const Pose2> path) override;
  [[nodiscard]] bool retires() const override { return true; }
  void Retire(const Retirement& retirement) override;

  [[nodiscard]] FilterEstimate estimate() const override { return set_.estimate(); }
  [[nodiscard]] FilterHealth health() const override;
  // Hypothesis 0 is the best particle; after it come all particles.
  [[nodiscard]] std::size_t hypothesis_count() const override { return set_.size() + 1; }
  [[nodiscard]] Hypothesis hypothesis(std::size_t index) const override;
  [[nodiscard]] std::vector<WeightedPose> belief() const override { return set_.belief(); }
  [[nodiscard]] std::vector<Landmark> landmarks() const override;
  void Save(StateWriter& archive) const override { archive(*this); }
  void Load(StateReader& archive) override { archive(*this); }
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    Later maps{self.maps_};
    archive(self.candidates_, self.index_, self.set_, maps, self.contradictions_);
    bool sound = self.maps_.size() == self.set_.size() && self.candidates_.slots() <= self.index_.size();
    for (const Map& map : self.maps_) sound = sound && map.size() <= self.index_.size();
    archive.Require(sound, "the maps of the particles");
  }

  [[nodiscard]] const ParticleSet& particles() const { return set_; }
  [[nodiscard]] std::size_t LandmarkCount(std::size_t particle) const;

 private:
  using Measurement = typename LandmarkModel::Measurement;
  struct Entry {
    LandmarkModel landmark;
    double last_observed_m = 0.0;
    std::uint32_t sightings = 0;       // 0 if this particle does not have the landmark.
    std::uint32_t first_keyframe = 0;  // Keyframe from which the landmark was first seen.

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.landmark, self.last_observed_m, self.sightings, self.first_keyframe);
      if (self.sightings > 0) archive.RequireKeyframe(self.first_keyframe);
    }
  };
  using Map = SharedSequence<Entry>;  // Indexed by slot.

  [[nodiscard]] std::vector<std::size_t> SlotsInReach(const LandmarkSighting& sighting) const;
  [[nodiscard]] Association Associate(std::size_t particle, const LandmarkSighting& sighting,
                                      const Measurement& measurement, std::span<const std::size_t> slots,
                                      double travelled_m) const;
  void Remember(std::size_t particle, const LandmarkSighting& sighting, const Measurement& measurement,
                const Association& association, double travelled_m);

  BackEndOptions options_;
  double gate_;     // Largest squared Mahalanobis distance of a match.
  double new_nis_;  // The same quantile for all numbers of a sighting.
  LandmarkCandidates candidates_;
  LandmarkIndex index_;
  ParticleSet set_;
  std::vector<Map> maps_;  // One per particle.
  Contradictions contradictions_;
};

template <typename LandmarkModel>
FastSlam<LandmarkModel>::FastSlam(const FastSlamOptions& options, const BackEndOptions& back_end,
                                  std::int64_t particles, const Pose2& T_map_robot_start, std::uint64_t seed,
                                  MotionSampler sampler)
    : options_(back_end),
      gate_(ChiSquareQuantile(back_end.landmarks.match_share, LandmarkModel::kGateNumbers)),
      new_nis_(ChiSquareQuantile(back_end.landmarks.match_share, LandmarkModel::kNumbers)),
      candidates_(back_end.landmarks),
      set_(options, particles, T_map_robot_start, seed, std::move(sampler)),
      maps_(static_cast<std::size_t>(particles)),
      contradictions_(back_end.diverged_after) {}

template <typename LandmarkModel>
void FastSlam<LandmarkModel>::Predict(const StepMotion& step) {
  if (set_.samples_motion()) return set_.PredictBySampling(step);
  set_.Predict(step.T_prev_curr, options_.drift.Covariance(step.T_prev_curr) + step.covariance_prev);
}

template <typename LandmarkModel>
bool FastSlam<LandmarkModel>::Observe(const RevisitObservation& revisit) {
  const bool explained = set_.Observe(revisit);
  contradictions_.Add(explained);
  return explained;
}

template <typename LandmarkModel>
void FastSlam<LandmarkModel>::Observe(const KeyframeSight& sight, const ParallelFor& /*parallel_for*/) {
  Observe(candidates_.Observe(sight.view.features, sight.T_track_robot, sight.travelled_m), sight.travelled_m);
}

template <typename LandmarkModel>
void FastSlam<LandmarkModel>::Observe(std::span<const LandmarkSighting> sightings, double travelled_m) {
  if (sightings.empty()) return;
  std::vector<Measurement> measurements;
  std::vector<std::vector<std::size_t>> slots;  // Per sighting: slots of landmarks from earlier scans.
  for (const LandmarkSighting& sighting : sightings) {
    measurements.push_back(LandmarkModel::Measure(sighting, options_.landmarks.noise));
    slots.push_back(SlotsInReach(sighting));
  }
  for (const LandmarkSighting& sighting : sightings) index_.Name(sighting.slot, sighting.signature);

  std::vector<Association> associations(sightings.size());
  std::vector<MixtureInnovation<LandmarkModel::kGateNumbers>> mixtures(sightings.size());
  const std::vector<double> before = set_.weights();
  for (std::size_t i = 0; i < set_.size(); ++i) {
    for (std::size_t s = 0; s < sightings.size(); ++s) {
      associations[s] = Associate(i, sightings[s], measurements[s], slots[s], travelled_m);
      // Two features of one scan cannot show the same landmark.
      for (std::size_t other = 0; other < s; ++other)
        if (associations[s].decision == AssociationDecision::kKnown &&
            associations[other].decision == AssociationDecision::kKnown &&
            associations[s].slot == associations[other].slot)
          associations[s].decision = AssociationDecision::kIgnored;
    }
    for (std::size_t s = 0; s < sightings.size(); ++s) {
      if (associations[s].decision != AssociationDecision::kKnown) continue;
      const auto innovation =
          maps_[i][associations[s].slot].landmark.GateInnovation(set_[i].T_map_robot, measurements[s]);
      mixtures[s].Add(before[i], innovation.v, innovation.S(set_[i].covariance));
    }
    for (std::size_t s = 0; s < sightings.size(); ++s) {
      if (associations[s].decision == AssociationDecision::kKnown) {
        const Entry& entry = maps_[i][associations[s].slot];
        entry.landmark.ForEachInnovation(set_[i].T_map_robot, measurements[s], [&](const auto& innovation) {
          if (i == set_.best_index()) set_.Constrain(entry.first_keyframe, innovation);
          set_.Fuse(i, innovation);
        });
      } else {
        set_.AddLogLikelihood(i, LandmarkModel::LogDensityAt(new_nis_, measurements[s]));
      }
    }
    if (!set_.samples_motion()) set_.Sample(i);
    for (std::size_t s = 0; s < sightings.size(); ++s)
      Remember(i, sightings[s], measurements[s], associations[s], travelled_m);
  }
  for (const auto& mixture : mixtures) set_.AddInnovation(mixture);
  set_.SampledAll();
}

// Slots of similar landmarks that some particle may have near a place where some particle sees the sighting.
template <typename LandmarkModel>
std::vector<std::size_t> FastSlam<LandmarkModel>::SlotsInReach(const LandmarkSighting& sighting) const {
  Eigen::AlignedBox2d box;
  for (const Particle& particle : set_.particles()) box.extend(particle.T_map_robot * sighting.p_robot);
  const Eigen::Vector2d reach = Eigen::Vector2d::Constant(kMatchDistanceM);
  return index_.Near(sighting.signature, {box.min() - reach, box.max() + reach}, options_.landmarks);
}

template <typename LandmarkModel>
Association FastSlam<LandmarkModel>::Associate(std::size_t particle, const LandmarkSighting& sighting,
                                               const Measurement& measurement, std::span<const std::size_t> slots,
                                               double travelled_m) const {
  const Particle& belief = set_[particle];
  const Map& map = maps_[particle];
  const Eigen::Vector2d p_map = belief.T_map_robot * sighting.p_robot;
  AssociationVote vote;
  for (const std::size_t slot : slots) {
    if (slot >= map.size()) continue;
    const Entry& entry = map[slot];
    if (entry.sightings == 0) continue;
    if ((entry.landmark.p_map() - p_map).norm() > kMatchDistanceM) continue;
    if (!SlopesAgree(sighting, belief.T_map_robot.theta, entry.landmark.slope(), index_.signature(slot),
                     options_.landmarks))
      continue;
    const auto innovation = entry.landmark.GateInnovation(belief.T_map_robot, measurement);
    const bool match = Nis<LandmarkModel::kGateNumbers>(innovation.v, innovation.S(belief.covariance)) < gate_;
    vote.Add(slot, match ? Likeness::kMatch : Likeness::kNear,
             travelled_m - entry.last_observed_m < options_.landmarks.min_travel_m);
  }
  return vote.result();
}

template <typename LandmarkModel>
void FastSlam<LandmarkModel>::Remember(std::size_t particle, const LandmarkSighting& sighting,
                                       const Measurement& measurement, const Association& association,
                                       double travelled_m) {
  Map& map = maps_[particle];
  const Pose2& T_map_robot = set_[particle].T_map_robot;
  while (map.size() <= sighting.slot) map.Append({});
  const std::size_t slot = association.decision == AssociationDecision::kKnown ? association.slot : sighting.slot;
  const bool known = association.decision == AssociationDecision::kKnown;
  if (!known && (association.decision != AssociationDecision::kNew || map[slot].sightings > 0)) return;
  Entry& entry = map.Mutable(slot);
  if (known) {
    entry.landmark.Learn(T_map_robot, measurement);
  } else {
    entry.landmark = LandmarkModel::Initial(T_map_robot, measurement);
    entry.first_keyframe = static_cast<std::uint32_t>(set_[particle].path.size());
  }
  entry.last_observed_m = travelled_m;
  ++entry.sightings;
  index_.Grow(slot, entry.landmark.p_map());
}

template <typename LandmarkModel>
void FastSlam<LandmarkModel>::Commit() {
  const std::vector<int> parents = set_.Commit();
  if (parents.empty()) return;
  maps_ = Resampled(maps_, parents);
}

template <typename LandmarkModel>
void FastSlam<LandmarkModel>::Rebase(std::span<const Pose2> path) {
  Map map = maps_[set_.best_index()];
  for (std::size_t slot = 0; slot < map.size(); ++slot) {
    if (map[slot].sightings == 0) continue;
    Entry& entry = map.Mutable(slot);
    entry.landmark.Move(path[entry.first_keyframe] * set_.best().path[entry.first_keyframe].Inverse());
    index_.Grow(slot, entry.landmark.p_map());
  }
  set_.Rebase(path);
  std::fill(maps_.begin(), maps_.end(), map);
}

// A landmark that several particles share was seen from a keyframe before they parted, so that it moves once for all.
template <typename LandmarkModel>
void FastSlam<LandmarkModel>::MoveTo(std::span<const Pose2> path) {
  const std::vector<Pose2> T_new_old = set_.MoveTo(path);
  const auto change = [&](std::size_t slot, Entry& entry) {
    if (entry.sightings == 0) return;
    entry.landmark.Move(T_new_old[entry.first_keyframe]);
    index_.Grow(slot, entry.landmark.p_map());
  };
  typename Map::Rewritten done;
  for (Map& map : maps_) map.Rewrite(change, done);
}

template <typename LandmarkModel>
void FastSlam<LandmarkModel>::Retire(const Retirement& retirement) {
  set_.Retire(retirement);
  std::vector<bool> used(index_.size());
  const auto change = [&](std::size_t slot, Entry& entry) {
    if (entry.sightings == 0) return;
    used[slot] = true;
    entry.first_keyframe = static_cast<std::uint32_t>(retirement.index_after[entry.first_keyframe]);
  };
  typename Map::Rewritten done;
  for (Map& map : maps_) map.Rewrite(change, done);
  // Every sighting that may be new takes a slot, and landmarks die with their particles.
  index_.Forget(used);
  used.resize(candidates_.slots());
  candidates_.GiveAgain(used);
}

template <typename LandmarkModel>
FilterHealth FastSlam<LandmarkModel>::health() const {
  FilterHealth health = set_.health();
  health.diverged = health.diverged || contradictions_.diverged();
  return health;
}

template <typename LandmarkModel>
Hypothesis FastSlam<LandmarkModel>::hypothesis(std::size_t index) const {
  const Particle& particle = index == 0 ? set_.best() : set_[index - 1];
  return {particle.T_map_robot, particle.path};
}

template <typename LandmarkModel>
std::vector<Landmark> FastSlam<LandmarkModel>::landmarks() const {
  const Map& map = maps_[set_.best_index()];
  std::vector<Landmark> landmarks;
  for (std::size_t slot = 0; slot < map.size(); ++slot) {
    const Entry& entry = map[slot];
    if (entry.sightings == 0) continue;
    landmarks.push_back({slot, index_.signature(slot).corner, entry.landmark.p_map(), entry.landmark.slope(),
                         entry.landmark.covariance(), entry.sightings});
  }
  return landmarks;
}

template <typename LandmarkModel>
std::size_t FastSlam<LandmarkModel>::LandmarkCount(std::size_t particle) const {
  std::size_t count = 0;
  for (std::size_t slot = 0; slot < maps_[particle].size(); ++slot)
    count += maps_[particle][slot].sightings > 0 ? 1 : 0;
  return count;
}

}  // namespace cairn::slam
