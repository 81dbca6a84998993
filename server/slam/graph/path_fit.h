// Fits a path to its relations and one more loop in parts, for callers who spread it over time: what OptimisePoses does
// (pose_graph.h), which is its oracle in the tests, takes a hundred milliseconds for a path of some thousand poses. The
// parts are counted by what they do and not by time, so that the same input gives the same result. Gauss-Newton with
// iteratively reweighted loops; a step that does not lower the cost is halved.
// Frame: that of the path, whose first pose stays where it is. Not thread-safe.
// Source: as pose_graph.h; Holland and Welsch 1977 (reweighting); order of elimination: Amestoy et al. 1996.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "server/slam/graph/pose_graph.h"

namespace cairn::slam {

class PathFit {
 public:
  PathFit();
  // `path` has a pose for each keyframe so far, and `relations` are the relations between them, of which later calls
  // may have more.
  PathFit(std::vector<Pose2> path, std::span<const PoseRelation> relations, const PoseRelation& loop);
  ~PathFit();
  PathFit(PathFit&&) noexcept;
  PathFit& operator=(PathFit&&) noexcept;

  // Does the next parts, until they have gone through `work` poses; at least one, of which the longest is one step of
  // the least squares. `relations` begin with those that were given to the constructor.
  void GoOn(std::span<const PoseRelation> relations, const PoseGraphOptions& options, std::size_t work);
  [[nodiscard]] bool done() const { return part_ == Part::kDone; }
  // REQUIRES: done(). Whether path() is better than the path that was given.
  [[nodiscard]] bool usable() const { return usable_; }
  [[nodiscard]] const std::vector<Pose2>& path() const { return path_; }
  [[nodiscard]] const PoseRelation& loop() const { return loop_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.part_, self.path_, self.count_, self.loop_, self.stage_, self.iterations_, self.cost_,
            self.cost_before_, self.usable_);
    archive.Require(self.part_ <= Part::kDone && self.stage_ < kStages, "the part of a fit");
    archive.RequireKeyframe(self.loop_.from);
    archive.RequireKeyframe(self.loop_.to);
    archive.Require(self.loop_.from < self.path_.size() && self.loop_.to < self.path_.size(), "the path of a fit");
  }
  // Whether what was read fits to the relations.
  [[nodiscard]] bool IsConsistent(std::span<const PoseRelation> relations, std::size_t keyframes) const;

 private:
  enum class Part : std::uint8_t { kOrder, kEquations, kStep, kDone };
  static constexpr std::uint32_t kStages = 3;
  struct Equations;

  [[nodiscard]] const PoseRelation& Relation(std::span<const PoseRelation> relations, std::size_t index) const {
    return index < count_ ? relations[index] : loop_;
  }
  // Half the sum of the squared normalised errors, after the robust loss of this stage.
  [[nodiscard]] double CostOf(std::span<const PoseRelation> relations, const std::vector<Pose2>& path,
                              std::uint32_t stage) const;
  void DoPart(std::span<const PoseRelation> relations, const PoseGraphOptions& options);
  void Order(std::span<const PoseRelation> relations);
  void SetUp(std::span<const PoseRelation> relations);
  void Step(std::span<const PoseRelation> relations, const PoseGraphOptions& options);
  void EndStage(std::span<const PoseRelation> relations);

  Part part_ = Part::kDone;
  std::vector<Pose2> path_;
  std::size_t count_ = 0;  // Relations without the loop.
  PoseRelation loop_;
  std::uint32_t stage_ = 0;      // How far the loss has been narrowed.
  std::int64_t iterations_ = 0;  // In this stage.
  double cost_ = 0.0;            // In this stage.
  double cost_before_ = 0.0;     // Of the path that was given, after the narrowest loss.
  bool usable_ = false;
  std::unique_ptr<Equations> equations_;  // Made anew when it is missing: it follows from the rest.
};

}  // namespace cairn::slam
