// The high level of DP-SLAM: a particle filter over the placement of the trajectory segments from the low
// level. A segment keeps its shape; at every joint each particle draws its own drift and chooses one of the
// given trajectories.
// - The error of the low level over a segment depends on the robot, the front-end and the number of
//   particles, and is hardly known beforehand. So the particles draw different shares of `drift`, evenly from
//   none to all of it. If the low level was exact, the particles with little drift fit best when a loop
//   closes, and their maps are not bent by random drift; if it was not, the others close the loop. (When all
//   particles drew all of it, the path of every particle was bent by 0.1 m and 0.85 deg at each joint,
//   however exact the low level: on intel the error was three times that of the steps.)
// - The best particle is the one with the greatest posterior, which includes the drift. While no evidence
//   distinguishes the particles it is the first, which draws no drift. (By likelihood alone any particle may
//   be the best until a loop closes, and the pose jumps by the whole spread at the first joint.)
// - Evidence is used once. The low level found neighbouring segments by how well they fit together, so a
//   segment is compared only with segments that the low level had forgotten. (With a comparison to its
//   neighbours, particles are removed because of a drift that a loop would have shown to be right, and few are left
//   when the robot returns.)
// - A segment is drawn only when the robot comes near it again. Until then it is a placement, which costs
//   only a pose per particle.
// - When a loop closes, few of the particles fit. The evidence is therefore introduced in steps, and
//   particles that were duplicated move: the drift at their joints is drawn anew near its old value (Neal
//   1998; Del Moral et al. 2006), by a proposal that preserves its distribution (Cotter et al. 2013), so that
//   the likelihood alone decides. Joints are free to move if no drawn segment depends on them, and no
//   evidence but that of the last few segments, which is evaluated again with them.
// - The work is done in parts: Take, then Work until it is finished; only then does the result become
//   visible.
// Poses are T_map_robot. Not thread-safe; deterministic for a seed, on any number of threads.
// Source: Eliazar, Parr 2005 (hierarchical); thesis C 3.2.3.3-4, 4.5.2, which compare with the neighbours too
// and resample.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "server/slam/dpslam/level_filter.h"

namespace cairn::slam {

class SegmentFilter {
 public:
  SegmentFilter(const LevelOptions& options, const OpacityOptions& opacity, double memory_m,
                const Pose2& T_map_robot_start)
      : memory_m_(memory_m), level_(options, opacity, T_map_robot_start), joints_(level_.particles().size()) {}

  // Begins the next segment: `trajectories` start at the end of the last segment, the most likely first, and
  // `way_m` is their length. REQUIRES: not at work; trajectories with equal numbers of scans, not empty.
  void Take(std::vector<Evidence> trajectories, double way_m, Rng& rng);
  [[nodiscard]] bool at_work() const { return at_work_; }
  // Does a part of the work, about the share of one scan of the segment.
  void Work(Rng& rng, const ParallelFor& parallel_for);

  [[nodiscard]] const LevelFilter& level() const { return level_; }
  // The map of the best particle.
  [[nodiscard]] OccupancyImage MapImage() const;
  // Memory of all maps and of the scans that are kept until they are drawn.
  [[nodiscard]] std::size_t bytes() const;

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.level_, self.segments_, self.joints_, self.fixed_, self.open_, self.at_work_, self.share_, self.free_,
            self.candidates_, self.proposed_, self.log_likelihoods_, self.tempering_, self.stride_, self.moves_left_,
            self.moved_, self.to_draw_, self.drawings_, self.children_);
    if constexpr (Archive::kReads) archive.RequireThat([&] { return self.IsConsistent(); }, "the segments");
  }

 private:
  static constexpr int kMoves = 4;  // Moves after each resampling.

  struct Segment {
    std::vector<Evidence> trajectories;  // Empty once the segment is drawn.
    std::vector<Pose2> T_start_end;      // End of each trajectory in the frame of its start.
    std::vector<Evidence> compared;      // For each trajectory, the scans used for the comparison.
    // The area that the most likely trajectory passed and saw, in the frame of its start.
    Eigen::AlignedBox2d seen_start;
    Eigen::Vector3d drift_sigma = Eigen::Vector3d::Zero();
    std::size_t scans = 0;
    bool forgotten = false;  // Whether the low level has forgotten it.
    bool drawn = false;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.trajectories, self.T_start_end, self.compared, self.seen_start, self.drift_sigma, self.scans,
              self.forgotten, self.drawn);
    }
  };
  // The placement of a segment by a particle: the drift in standard deviations, the resulting start, and the
  // trajectory chosen.
  struct Joint {
    Eigen::Vector3d drift = Eigen::Vector3d::Zero();
    Pose2 T_map_start;
    std::size_t trajectory = 0;

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.drift, self.T_map_start, self.trajectory);
    }
  };
  // A particle during the work: its new joints from `free_` on.
  struct Candidate {
    std::size_t parent = 0;
    std::vector<Joint> joints;
    double log_weight = 0.0;
    // Log likelihood of the open segments before this one.
    double settled = 0.0;
    double evidence = 0.0;  // Log likelihood of this segment.
    double before = 0.0;    // Log likelihood of all that is not open.

    template <typename Archive>
    static void Members(Archive& archive, auto& self) {
      archive(self.parent, self.joints, self.log_weight, self.settled, self.evidence, self.before);
    }
  };
  // Whether all indices lie within what they count.
  [[nodiscard]] bool IsConsistent() const;
  [[nodiscard]] bool SegmentsAreConsistent() const;
  [[nodiscard]] bool CandidatesAreConsistent(const std::vector<Candidate>& candidates) const;
  [[nodiscard]] Eigen::AlignedBox2d SeenBy(const Segment& segment, const std::vector<Pose2>& starts) const;
  [[nodiscard]] std::vector<MapSample> SamplesOf(std::size_t segment) const;
  [[nodiscard]] MapSample SampleOf(const Candidate& candidate, std::size_t segment) const;
  void Place(Candidate& candidate) const;
  void StartDrawing();
  // Draw into the maps of at most `count` particles, or evaluate them; return the number done.
  [[nodiscard]] std::size_t DrawSome(std::size_t count, const ParallelFor& parallel_for);
  [[nodiscard]] std::size_t EvaluateSome(std::size_t count, const ParallelFor& parallel_for);
  void Enter(std::vector<Candidate>& subjects);
  void RaiseTempering(Rng& rng);
  void Propose(Rng& rng);
  void Accept(Rng& rng);
  void Finish();
  void Forget();

  const double memory_m_;
  LevelFilter level_;
  std::vector<Segment> segments_;              // The last one may be in work.
  std::vector<SharedSequence<Joint>> joints_;  // For each particle, its joints with all finished segments.
  std::size_t fixed_ = 1;                      // Joints before this index are fixed.
  // Evaluated segments that depend on joints which may still move.
  std::vector<std::size_t> open_;

  // State of the work.
  bool at_work_ = false;
  std::size_t share_ = 0;  // Work of one call, in evaluated trajectories.
  std::size_t free_ = 0;   // Index of the first joint that may move.
  std::vector<Candidate> candidates_;
  // The proposals of the move in evaluation; empty while the candidates themselves are evaluated.
  std::vector<Candidate> proposed_;
  std::vector<double> log_likelihoods_;  // Results so far, by open segment.
  double tempering_ = 0.0;               // Share of the evidence introduced so far, 0..1.
  // Relative size of the moves of all joints and of the last joint: 0 does not move, 1 is independent of the
  // old value.
  std::array<double, 2> stride_{};
  int moves_left_ = 0;
  bool moved_ = false;
  std::vector<std::size_t> to_draw_;  // Near segments to be drawn, from the back.
  // Drawings of the segment at the back of to_draw_, and the children finished so far.
  LevelFilter::Drawings drawings_;
  std::vector<Ancestry::Child> children_;
};

}  // namespace cairn::slam
