// DP-SLAM: a particle filter whose particles own whole grid maps, stored as changes in their family tree. Flat, or
// hierarchical: the low level maps the surroundings only and forgets what is far; the high level (segment_filter.h)
// joins the segments of trajectory it hands up, each particle with drift of its own at every joint, and judges a
// segment's scans on what the low level had forgotten. No landmarks, no revisits: loops close because some particle's
// map agrees with what is seen again. Frames: poses are T_map_robot; the low level's are in a frame of its own, which
// drifts. Not thread-safe; deterministic for a seed, on any number of threads. Source: Eliazar, Parr 2003-2005; thesis
// C 3.2.3, 4.5.
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
  // REQUIRES: at most once a step.
  void Observe(const KeyframeSight& sight, const ParallelFor& parallel_for) override;
  // The same with rays at hand.
  void Observe(std::shared_ptr<const LaserRays> rays, const ParallelFor& parallel_for);
  void Commit() override;

  [[nodiscard]] FilterEstimate estimate() const override;
  [[nodiscard]] FilterHealth health() const override;
  [[nodiscard]] std::size_t hypothesis_count() const override;
  [[nodiscard]] Hypothesis hypothesis(std::size_t index) const override;
  [[nodiscard]] std::vector<Landmark> landmarks() const override { return {}; }

  // The low level knows the surroundings only where there is a high level.
  [[nodiscard]] const LevelFilter& low() const { return low_; }
  [[nodiscard]] const LevelFilter* high() const { return high_ ? &high_->level() : nullptr; }
  // The best particle's map, without the scans still pending where there is a high level.
  [[nodiscard]] OccupancyImage MapImage() const;
  // Of all maps.
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct PendingScan {
    std::shared_ptr<const LaserRays> rays;
    double step_m = 0.0;  // From the scan before.
    double turn_rad = 0.0;
  };
  // Scans of the next segment, once it is long enough and hindsight allows; else 0.
  [[nodiscard]] std::size_t SegmentEnd() const;
  void HandUp(std::size_t count);

  const DpSlamOptions options_;
  Rng rng_;
  LevelFilter low_;
  std::optional<SegmentFilter> high_;
  std::vector<PendingScan> pending_;  // Not in the high level yet.
  std::size_t handed_up_ = 0;         // Scans before them.
  std::size_t at_work_ = 0;           // Of the pending, those the high level is working at.
  Pose2 T_low_joint_;                 // Where those before the pending ended when they were handed up,
  Pose2 T_low_end_;                   // and those at work. In the low level's frame.
  double step_m_ = 0.0;               // Since the last scan.
  double turn_rad_ = 0.0;
  std::int64_t contradicted_ = 0;  // Scans in a row.
  bool observed_ = false;          // In this step.
};

}  // namespace cairn::slam
