// Scan matching by NDT and differential evolution along a sequence of scans, as thesis C measures it (5.1):
// every scan against the one before, nothing known of the motion; with the truth beside it where there is
// one.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "server/slam/matchers/ndt_de.h"
#include "tests/studies/logs.h"
#include "tests/studies/study.h"

namespace cairn::studies {

// The hits of every scan in its robot frame, not thinned, and the true poses (simulated logs only).
struct ScanSequence {
  std::string name;
  std::vector<Scan> scans;
  std::vector<std::vector<Eigen::Vector2d>> points;
  std::vector<Pose2> T_map_robot;
};
[[nodiscard]] ScanSequence SequenceOf(const StudyLog& log);

// One step of the sequence. Errors in the axes of ours: x ahead, y to the left (the thesis' y and -x).
struct StepError {
  slam::NdtDeMatch match;
  // The evolution's own answer, or where it is climbed from there. Not the join with what was believed
  // before: where an evolution ended far from a maximum that would say "nothing known: stand still".
  Pose2 T_prev_curr;
  Eigen::Vector3d error = Eigen::Vector3d::Zero();  // Zero where the truth is not known.
  [[nodiscard]] double metres() const { return error.head<2>().norm(); }
  [[nodiscard]] double degrees() const { return std::abs(Degrees(error.z())); }
  [[nodiscard]] bool lost() const { return metres() > 0.1 || degrees() > 2.0; }  // Not converged, in the thesis' words.
};

struct SequenceErrors {
  std::vector<StepError> steps;  // One less than scans.
  double cpu_ms = 0.0;           // A match.
  [[nodiscard]] std::vector<double> metres() const;
  [[nodiscard]] std::vector<double> degrees() const;
  [[nodiscard]] std::vector<double> fitness() const;
  [[nodiscard]] int lost() const;
};
[[nodiscard]] SequenceErrors MatchSequence(const ScanSequence& sequence, const slam::NdtDeOptions& options);

// The thesis' own method: the evolution's answer as it is.
[[nodiscard]] slam::NdtDeOptions ThesisOptions(std::uint64_t seed);

// The poses that follow from the steps, from the identity; as many as scans.
[[nodiscard]] std::vector<Pose2> ChainOf(const SequenceErrors& errors);

// The simulated drive of 5.1: 366 scans of 181 beams, 8 m range or more, a given noise. The thesis' world is
// not given in numbers; a shipped one stands in.
[[nodiscard]] ScanSequence SimulatedDrive(StudyContext& context, double noise_m);

}  // namespace cairn::studies
