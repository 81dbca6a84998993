// Scan matching with NDT and differential evolution along a sequence of scans, as thesis C measures it (5.1): every
// scan is matched with the one before, without any knowledge of the motion. The answer is compared with the truth if
// that is known.
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

// One step of the sequence. Errors are along the axes of Cairn: x ahead, y to the left (y and -x of the thesis).
struct StepError {
  slam::NdtDeMatch match;
  // The answer of the evolution, or of Newton's method that started there. It is not joined with the prior, because an
  // evolution that ended far from a maximum would then give the prior, that is, no motion.
  Pose2 T_prev_curr;
  Eigen::Vector3d error = Eigen::Vector3d::Zero();  // Zero where the truth is not known.
  [[nodiscard]] double metres() const { return error.head<2>().norm(); }
  [[nodiscard]] double degrees() const { return std::abs(Degrees(error.z())); }
  [[nodiscard]] bool lost() const {
    return metres() > 0.1 || degrees() > 2.0;
  }  // The thesis calls this "not converged".
};

struct SequenceErrors {
  std::vector<StepError> steps;  // One less than scans.
  double cpu_ms = 0.0;           // Processor time per match.
  [[nodiscard]] std::vector<double> metres() const;
  [[nodiscard]] std::vector<double> degrees() const;
  [[nodiscard]] std::vector<double> fitness() const;
  [[nodiscard]] int lost() const;
};
[[nodiscard]] SequenceErrors MatchSequence(const ScanSequence& sequence, const slam::NdtDeOptions& options);

// The method of the thesis: the answer of the evolution is not improved.
[[nodiscard]] slam::NdtDeOptions ThesisOptions(std::uint64_t seed);

// The poses that follow from the steps, from the identity; as many as scans.
[[nodiscard]] std::vector<Pose2> ChainOf(const SequenceErrors& errors);

// The simulated drive of 5.1: 366 scans of 181 beams, 8 m range or more, a given noise. The measures of
// the world of the thesis are not printed, so a shipped world is used.
[[nodiscard]] ScanSequence SimulatedDrive(StudyContext& context, double noise_m);

}  // namespace cairn::studies
