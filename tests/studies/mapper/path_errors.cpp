#include "tests/studies/mapper/path_errors.h"

#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "common/geometry/pose_difference.h"

namespace cairn::studies {
namespace {

using slam::PoseRelation, slam::PoseRelationError, slam::Rng, slam::ThreeNormalDraws;

constexpr int kSolvedAtOnce = 10;  // Samples whose right-hand sides are in memory together.

// A relation as the fit sees it: its Jacobians by both poses, whitened by its covariance and its weight.
struct WhiteRelation {
  std::size_t from = 0;
  std::size_t to = 0;
  Eigen::Matrix3d J_from;
  Eigen::Matrix3d J_to;
};

WhiteRelation Whiten(const PoseRelation& relation, std::span<const Pose2> path) {
  const PoseRelationError at = slam::ErrorOf(relation, path[relation.from], path[relation.to]);
  const Eigen::Matrix3d L = relation.covariance.llt().matrixL();
  const Eigen::Matrix3d W = L.triangularView<Eigen::Lower>().solve(Eigen::Matrix3d::Identity());
  const double root_weight = relation.loop ? std::sqrt(slam::LoopWeight((W * at.error).squaredNorm())) : 1.0;
  return {relation.from, relation.to, root_weight * W * at.J_error_from, root_weight * W * at.J_error_to};
}

// Pose 0 does not move, so it has no columns.
constexpr Eigen::Index kNone = -1;
Eigen::Index ColumnOf(std::size_t pose) {
  return pose == 0 ? kNone : 3 * static_cast<Eigen::Index>(pose - 1);
}

Eigen::SparseMatrix<double> Information(const std::vector<WhiteRelation>& relations, Eigen::Index numbers) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(27 * relations.size());
  const auto add = [&](Eigen::Index row, Eigen::Index column, const Eigen::Matrix3d& block) {
    if (row == kNone || column == kNone || row < column) return;  // The lower triangle is enough.
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        entries.emplace_back(static_cast<int>(row + i), static_cast<int>(column + j), block(i, j));
  };
  for (const WhiteRelation& relation : relations) {
    const Eigen::Index from = ColumnOf(relation.from), to = ColumnOf(relation.to);
    add(from, from, relation.J_from.transpose() * relation.J_from);
    add(to, to, relation.J_to.transpose() * relation.J_to);
    add(from, to, relation.J_from.transpose() * relation.J_to);
    add(to, from, relation.J_to.transpose() * relation.J_from);
  }
  Eigen::SparseMatrix<double> H(numbers, numbers);
  H.setFromTriplets(entries.begin(), entries.end());
  return H;
}

}  // namespace

std::vector<PoseErrorSamples> SamplePathErrors(std::span<const Pose2> path, std::span<const PoseRelation> relations,
                                               int samples, Rng& rng) {
  std::vector<PoseErrorSamples> errors(path.size(), PoseErrorSamples::Zero(3, samples));
  if (path.size() < 2) return errors;
  std::vector<WhiteRelation> white;
  white.reserve(relations.size());
  for (const PoseRelation& relation : relations) white.push_back(Whiten(relation, path));
  const Eigen::Index numbers = 3 * static_cast<Eigen::Index>(path.size() - 1);
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(Information(white, numbers));
  if (factor.info() != Eigen::Success) return errors;
  for (int begin = 0; begin < samples; begin += kSolvedAtOnce) {
    const int count = std::min(kSolvedAtOnce, samples - begin);
    Eigen::MatrixXd b = Eigen::MatrixXd::Zero(numbers, count);
    for (int j = 0; j < count; ++j) {
      for (const WhiteRelation& relation : white) {
        const Eigen::Vector3d noise = ThreeNormalDraws(rng);
        const Eigen::Index from = ColumnOf(relation.from), to = ColumnOf(relation.to);
        if (from != kNone) b.col(j).segment<3>(from) += relation.J_from.transpose() * noise;
        if (to != kNone) b.col(j).segment<3>(to) += relation.J_to.transpose() * noise;
      }
    }
    const Eigen::MatrixXd x = factor.solve(b);
    if (!x.allFinite()) return std::vector<PoseErrorSamples>(path.size(), PoseErrorSamples::Zero(3, samples));
    for (std::size_t k = 1; k < path.size(); ++k)
      errors[k].middleCols(begin, count) = x.middleRows(ColumnOf(k), 3).cast<float>();
  }
  return errors;
}

Eigen::Matrix3d RelativeCovariance(const Pose2& T_map_from, const PoseErrorSamples& errors_from, const Pose2& T_map_to,
                                   const PoseErrorSamples& errors_to) {
  const Pose2 T_from_map = T_map_from.Inverse();
  const Eigen::Matrix3d J_from = J_compose_left(T_from_map, T_map_to) * J_inverse(T_map_from);
  const Eigen::Matrix3d J_to = J_compose_right(T_from_map, T_map_to);
  const Eigen::Matrix3Xd errors = J_from * errors_from.cast<double>() + J_to * errors_to.cast<double>();
  const Eigen::Matrix3Xd centred = errors.colwise() - errors.rowwise().mean();
  return centred * centred.transpose() / std::max<double>(1.0, static_cast<double>(errors.cols() - 1));
}

}  // namespace cairn::studies
