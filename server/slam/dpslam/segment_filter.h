// The high level of DP-SLAM: a particle filter over where the segments of trajectory lie that the low level hands up.
// A segment keeps its shape; at every joint each particle draws drift of its own and chooses one of the trajectories
// handed up.
// - How far the low level errs over a segment depends on the robot, the front-end and the particles it has, and is
//   hardly known beforehand. So the particles differ in how much of `drift` they draw, evenly from none to all of it.
//   Where the low level was right, those that leave it alone fit best when it shows, and carry maps that chance has not
//   bent; where it was not, the others close the loop. (When all drew all of it, every particle's way was bent by 0.1 m
//   and 0.85 deg at each joint, for good, however exact the low level: intel ended three times as wrong as the steps
//   that went in.)
// - The best particle is the one with the greatest posterior, which counts the drift too: while nothing tells them
//   apart it is the first, which drew none. (By likelihood alone it is any one until a loop closes, and the pose jumps
//   by the whole spread at the first joint.)
// - Evidence counts once: that neighbouring segments fit together is what the low level found them by, so a segment is
//   judged on those only that the low level had forgotten. (Judged on its neighbours too, particles die for drift that
//   a loop would have shown to be right: few are left when the robot comes round.)
// - Until somebody comes near it again a segment is a placement and nothing is drawn: staying apart costs a pose.
// - Where a loop closes, few of the particles fit. The evidence is let in by and by, and particles that double move on:
//   the drift at their joints is drawn anew near what it was (Neal 1998; Del Moral et al. 2006), by a proposal that
//   keeps its distribution (Cotter et al. 2013), so that the likelihood alone decides. All joints move that nothing
//   drawn and no evidence but that of the last few segments hangs on: it is judged again with them.
// - The work is done piece by piece: Take, then Work until it is done; only then does anything outside change.
// Poses are T_map_robot. Not thread-safe; deterministic for a seed, on any number of threads.
// Source: Eliazar, Parr 2005 (hierarchical); thesis C 3.2.3.3-4, 4.5.2, which judge on the neighbours too and resample.
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

  // The next segment: its trajectories from where the last one ended, the likeliest first, and the way it went.
  // REQUIRES: not at work; trajectories of equal length, not empty.
  void Take(std::vector<Evidence> trajectories, double way_m, Rng& rng);
  [[nodiscard]] bool at_work() const { return at_work_; }
  // A share of the work, about a scan's of the segment.
  void Work(Rng& rng, const ParallelFor& parallel_for);

  [[nodiscard]] const LevelFilter& level() const { return level_; }
  // Of the best particle.
  [[nodiscard]] OccupancyImage MapImage() const;
  // Of all maps, and of the scans kept until they are drawn.
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct Segment {
    std::vector<Evidence> trajectories;  // None once it is drawn.
    std::vector<Pose2> T_start_end;      // Of each trajectory.
    std::vector<Evidence> judged;        // Of each trajectory, the scans that judge.
    Eigen::AlignedBox2d seen_start;      // What it passed and saw, by its likeliest trajectory, from its start.
    Eigen::Vector3d drift_sigma = Eigen::Vector3d::Zero();
    std::size_t scans = 0;
    bool forgotten = false;  // By the low level.
    bool drawn = false;
  };
  // What a particle made of a segment: its drift in standard deviations, where that puts it, the trajectory it took.
  struct Joint {
    Eigen::Vector3d drift = Eigen::Vector3d::Zero();
    Pose2 T_map_start;
    std::size_t trajectory = 0;
  };
  // A particle at work: what becomes of its joints from `free_` on.
  struct Candidate {
    std::size_t parent = 0;
    std::vector<Joint> joints;
    double log_weight = 0.0;
    double settled = 0.0;   // Log likelihood that counts, of the open segments before this one,
    double evidence = 0.0;  // and of this one.
    double before = 0.0;    // Of all that is not open.
  };
  [[nodiscard]] Eigen::AlignedBox2d SeenBy(const Segment& segment, const std::vector<Pose2>& starts) const;
  [[nodiscard]] std::vector<MapSample> SamplesOf(std::size_t segment) const;
  [[nodiscard]] MapSample SampleOf(const Candidate& candidate, std::size_t segment) const;
  void Place(Candidate& candidate) const;
  void StartDrawing();
  // At most so many particles draw, or are judged; returns how many.
  [[nodiscard]] std::size_t DrawSome(std::size_t count, const ParallelFor& parallel_for);
  [[nodiscard]] std::size_t JudgeSome(std::size_t count, const ParallelFor& parallel_for);
  void Enter(std::vector<Candidate>& subjects);
  void LetInEvidence(Rng& rng);
  void Propose(Rng& rng);
  void Accept(Rng& rng);
  void Finish();
  void Forget();

  const double memory_m_;
  LevelFilter level_;
  std::vector<Segment> segments_;              // The last one may be at work.
  std::vector<SharedSequence<Joint>> joints_;  // By particle, of every segment done.
  std::size_t fixed_ = 1;                      // Joints before move no more.
  std::vector<std::size_t> open_;              // Segments judged, on which the joints that may move depend.

  // The work.
  bool at_work_ = false;
  std::size_t share_ = 0;  // Of a call, in trajectories judged.
  std::size_t free_ = 0;   // First joint that may move.
  std::vector<Candidate> candidates_;
  std::vector<Candidate> proposed_;      // Of the move that is judged; none while the candidates themselves are.
  std::vector<double> log_likelihoods_;  // Of those judged so far, by open segment.
  double let_in_ = 0.0;                  // Of the evidence, 0..1.
  std::array<double, 2> stride_{};       // How far moves go, of all joints and of the last: 0 nowhere, 1 anywhere.
  int moves_left_ = 0;
  bool moved_ = false;
  std::vector<std::size_t> to_draw_;     // Segments that are near, from the back.
  LevelFilter::Drawings drawings_;       // Of the one at the back,
  std::vector<Ancestry::Birth> births_;  // as far as they are done.
};

}  // namespace cairn::slam
