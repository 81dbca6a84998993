// DP-SLAM: a particle filter whose particles have complete grid maps, stored as changes in their ancestry
// tree. It is flat or hierarchical. The low level maps the surroundings only and forgets what is far away.
// The high level (segment_filter.h) joins the segments of trajectory from the low level. Each of its
// particles draws its own drift at every joint, and a segment's scans are compared only with what the low
// level had forgotten. With `high_level=plain` the high level is that of the thesis: a second filter like the
// low one, in which one step is a whole segment with drift, computed at once.
// It uses neither landmarks nor revisits: loops close because the map of some particle agrees with what is
// seen again. Frames: poses are T_map_robot; those of the low level are in a frame of its own, which drifts.
// Not thread-safe; deterministic for a seed, on any number of threads.
// Source: Eliazar, Parr 2003-2005; thesis C 3.2.3, 4.5.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "server/slam/dpslam/dpslam_options.h"
#include "server/slam/dpslam/segment_filter.h"
#include "server/slam/filters/filter.h"

namespace cairn::slam {

class DpSlam final : public Filter {
 public:
  DpSlam(const DpSlamOptions& options, const Pose2& T_map_robot_start, std::uint64_t seed);

  void Predict(const StepMotion& step) override;
  bool Observe(const RevisitObservation& /*revisit*/) override { return false; }
  // REQUIRES: at most one call per step.
  void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) override;
  // The same with rays that are already prepared.
  void Observe(std::shared_ptr<const LaserRays> rays, const ParallelFor& parallel_for);
  void Commit() override;

  [[nodiscard]] FilterEstimate estimate() const override;
  [[nodiscard]] FilterHealth health() const override;
  [[nodiscard]] std::size_t hypothesis_count() const override;
  [[nodiscard]] Hypothesis hypothesis(std::size_t index) const override;
  [[nodiscard]] std::vector<WeightedPose> belief() const override;
  [[nodiscard]] std::vector<Landmark> landmarks() const override { return {}; }
  void Save(StateWriter& archive) const override { archive(*this); }
  void Load(StateReader& archive) override { archive(*this); }
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.rng_, *self.low_, self.pending_, self.passed_on_, self.at_work_, self.T_low_joint_, self.T_low_end_,
            self.step_m_, self.turn_rad_, self.contradicted_, self.observed_);
    if (self.high_) archive(*self.high_);
    if (self.plain_) archive(*self.plain_);
    if constexpr (Archive::kReads)
      archive.RequireThat([&] { return self.IsConsistent(archive.keyframes()); }, "the scans of the low level");
  }

  // The map of the low level covers only the surroundings if there is a high level.
  [[nodiscard]] const LevelFilter& low() const { return *low_; }
  [[nodiscard]] const LevelFilter* high() const { return plain_ ? &*plain_ : high_ ? &high_->level() : nullptr; }
  // The best particle's map; if there is a high level, without the scans that are still pending.
  [[nodiscard]] OccupancyImage MapImage() const;
  // Memory of all maps.
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct PendingScan {
    std::shared_ptr<const LaserRays> rays;
    double step_m = 0.0;  // Distance from the previous scan.
    double turn_rad = 0.0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.rays, self.step_m, self.turn_rad);
    }
  };
  // Whether the numbers of scans agree with each other and with the number of keyframes.
  [[nodiscard]] bool IsConsistent(std::size_t keyframes) const;
  // Number of scans of the next segment once it is long enough and followed by enough later scans; otherwise
  // 0.
  [[nodiscard]] std::size_t SegmentEnd() const;
  // Begins the next segment of the high level with the first `count` pending scans.
  void PassToHighLevel(std::size_t count);
  // The whole step of the plain high level, with all pending scans.
  void JoinPlainly(const ParallelFor& parallel_for);
  // The next scans of a particle of the low level, from the joint on.
  [[nodiscard]] Evidence Along(const GridParticle& particle, std::size_t count) const;
  [[nodiscard]] double WayOf(std::size_t count) const;  // Distance over the first `count` pending scans.

  const DpSlamOptions options_;
  Rng rng_;
  std::optional<LevelFilter> low_;     // Never empty; replaced at every joint of the plain high level.
  std::optional<SegmentFilter> high_;  // At most one of high_ and plain_ has a value.
  std::optional<LevelFilter> plain_;
  std::vector<PendingScan> pending_;  // Scans that are not in the high level yet.
  std::size_t passed_on_ = 0;         // Number of scans before the pending ones.
  std::size_t at_work_ = 0;           // Number of pending scans that the high level is processing.
  // End poses in the low level's frame: of the scans before the pending ones, when they were passed on, and
  // of the scans that the high level is processing.
  Pose2 T_low_joint_;
  Pose2 T_low_end_;
  double step_m_ = 0.0;  // Distance since the last scan.
  double turn_rad_ = 0.0;
  std::int64_t contradicted_ = 0;  // Number of scans in a row that contradicted the map.
  bool observed_ = false;          // Whether this step has had a scan.
};

}  // namespace cairn::slam
