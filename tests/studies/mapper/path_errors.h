// The errors that a path may still have after it was fitted to its relations (pose_graph.h), as samples from their
// joint distribution. Every sample is the change of the fitted path if the relations had other errors, drawn from their
// covariances; loops count with the weight that the robust loss gives them. Samples of all poses together also tell
// how uncertain one pose is relative to another one. Node 0 has no error. Poses and errors are in `map`. Stateless,
// thread-safe, deterministic for a given state of `rng`. Takes about as long as two iterations of the fit, and some
// milliseconds a sample for thousands of poses.
// Source: Papandreou and Yuille 2010 (Gaussian sampling by local perturbations).
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "server/slam/graph/pose_graph.h"
#include "server/slam/random/draws.h"

namespace cairn::studies {

// One column per sample: the error of a pose, (x, y, theta).
using PoseErrorSamples = Eigen::Matrix3Xf;

// One element per pose of `path`. All errors are zero if the relations do not determine the path. REQUIRES: the
// indices of all relations lie within the path.
[[nodiscard]] std::vector<PoseErrorSamples> SamplePathErrors(std::span<const Pose2> path,
                                                             std::span<const slam::PoseRelation> relations, int samples,
                                                             slam::Rng& rng);

// Covariance of the pose `to` relative to the pose `from`, (x, y, theta) in the frame `from`.
[[nodiscard]] Eigen::Matrix3d RelativeCovariance(const Pose2& T_map_from, const PoseErrorSamples& errors_from,
                                                 const Pose2& T_map_to, const PoseErrorSamples& errors_to);

}  // namespace cairn::studies
