#include "server/slam/graph/path_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/geometry/pose_difference.h"

namespace cairn::slam {
namespace {

constexpr int kMostHalvings = 5;

// The square of the width of the loss in a stage, in squared standard deviations.
double SquaredWidth(std::uint32_t stage) {
  const std::array<double, 3> widths = {kLossWidening * kLossWidening * kLoopLoss, kLossWidening * kLoopLoss,
                                        kLoopLoss};
  return widths[stage] * widths[stage];
}

// The robust loss of Cauchy for a squared normalised error, and its derivative.
double Loss(double squared, double squared_width) {
  return squared_width * std::log1p(squared / squared_width);
}
double WeightOf(double squared, double squared_width) {
  return 1.0 / (1.0 + squared / squared_width);
}

}  // namespace

// The normal equations of all poses but the first, as a sparse matrix of which the lower triangle is stored. The poses
// are in the order in which they are eliminated.
struct PathFit::Equations {
  using Matrix = Eigen::SparseMatrix<double>;
  Matrix H;
  Eigen::VectorXd g;
  std::vector<int> place;  // Of each pose in this order; -1 for the first pose, which is no unknown.
  Eigen::SimplicialLDLT<Matrix, Eigen::Lower, Eigen::NaturalOrdering<int>> solver;
  bool current = false;  // H and g belong to the path.

  // Adds to the block of two places. On the diagonal only the lower triangle is stored.
  void Add(int row, int column, const Eigen::Matrix3d& block) {
    if (row < column) return Add(column, row, block.transpose());
    for (int c = 0; c < 3; ++c) {
      const int first = row == column ? c : 0;
      const int* begin = H.innerIndexPtr() + H.outerIndexPtr()[3 * column + c];
      const int* end = H.innerIndexPtr() + H.outerIndexPtr()[3 * column + c + 1];
      double* value = H.valuePtr() + (std::lower_bound(begin, end, 3 * row + first) - H.innerIndexPtr());
      for (int r = first; r < 3; ++r) value[r - first] += block(r, c);
    }
  }
};

PathFit::PathFit() = default;
PathFit::~PathFit() = default;
PathFit::PathFit(PathFit&&) noexcept = default;
PathFit& PathFit::operator=(PathFit&&) noexcept = default;

PathFit::PathFit(std::vector<Pose2> path, std::span<const PoseRelation> relations, const PoseRelation& loop)
    : part_(path.size() < 2 ? Part::kDone : Part::kOrder),
      path_(std::move(path)),
      count_(relations.size()),
      loop_(loop) {}

void PathFit::GoOn(std::span<const PoseRelation> relations, const PoseGraphOptions& options, std::size_t work) {
  for (std::size_t worked = 0; !done() && worked < work; worked += path_.size()) DoPart(relations, options);
}

void PathFit::DoPart(std::span<const PoseRelation> relations, const PoseGraphOptions& options) {
  if (part_ == Part::kOrder || !equations_) Order(relations);
  switch (part_) {
    case Part::kOrder:
      cost_before_ = CostOf(relations, path_, kStages - 1);
      cost_ = CostOf(relations, path_, stage_);
      part_ = Part::kEquations;
      return;
    case Part::kEquations:
      SetUp(relations);
      part_ = Part::kStep;
      return;
    case Part::kStep:
      if (!equations_->current) SetUp(relations);
      return Step(relations, options);
    case Part::kDone:
      return;
  }
}

double PathFit::CostOf(std::span<const PoseRelation> relations, const std::vector<Pose2>& path,
                       std::uint32_t stage) const {
  double cost = 0.0;
  for (std::size_t i = 0; i <= count_; ++i) {
    const PoseRelation& relation = Relation(relations, i);
    const Eigen::Vector3d error = Minus(Between(path[relation.from], path[relation.to]), relation.T_from_to);
    const double squared = error.dot(relation.covariance.llt().solve(error));
    cost += 0.5 * (relation.loop ? Loss(squared, SquaredWidth(stage)) : squared);
  }
  return cost;
}

// The order in which the poses are eliminated, and which values the equations have.
void PathFit::Order(std::span<const PoseRelation> relations) {
  equations_ = std::make_unique<Equations>();
  const auto unknown = static_cast<int>(path_.size() - 1);
  std::vector<Eigen::Triplet<double>> related;
  for (int k = 0; k < unknown; ++k) related.emplace_back(k, k, 1.0);
  for (std::size_t i = 0; i <= count_; ++i) {
    const PoseRelation& relation = Relation(relations, i);
    if (relation.from == 0 || relation.to == 0 || relation.from == relation.to) continue;
    const auto from = static_cast<int>(relation.from - 1), to = static_cast<int>(relation.to - 1);
    related.emplace_back(from, to, 1.0);
    related.emplace_back(to, from, 1.0);
  }
  Equations::Matrix pattern(unknown, unknown);
  pattern.setFromTriplets(related.begin(), related.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;  // The pose at each place.
  Eigen::AMDOrdering<int>()(pattern, order);
  std::vector<int>& place = equations_->place;
  place.assign(path_.size(), -1);
  for (int k = 0; k < unknown; ++k) place[static_cast<std::size_t>(order.indices()[k]) + 1] = k;

  std::vector<Eigen::Triplet<double>> values;
  values.reserve(5 * related.size());
  for (const auto& pair : related) {
    const int row = place[static_cast<std::size_t>(pair.row()) + 1],
              column = place[static_cast<std::size_t>(pair.col()) + 1];
    if (row < column) continue;
    for (int c = 0; c < 3; ++c)
      for (int r = row == column ? c : 0; r < 3; ++r) values.emplace_back(3 * row + r, 3 * column + c, 0.0);
  }
  equations_->H.resize(3 * unknown, 3 * unknown);
  equations_->H.setFromTriplets(values.begin(), values.end());
  equations_->solver.analyzePattern(equations_->H);
}

void PathFit::SetUp(std::span<const PoseRelation> relations) {
  Equations& equations = *equations_;
  std::fill_n(equations.H.valuePtr(), equations.H.nonZeros(), 0.0);
  equations.g = Eigen::VectorXd::Zero(equations.H.rows());
  for (std::size_t i = 0; i <= count_; ++i) {
    const PoseRelation& relation = Relation(relations, i);
    if (relation.from == relation.to) continue;
    const PoseRelationError at = ErrorOf(relation, path_[relation.from], path_[relation.to]);
    Eigen::Matrix3d information = relation.covariance.llt().solve(Eigen::Matrix3d::Identity());
    if (relation.loop) information *= WeightOf(at.error.dot(information * at.error), SquaredWidth(stage_));
    const Eigen::Matrix<double, 3, 3> from_information = at.J_error_from.transpose() * information,
                                      to_information = at.J_error_to.transpose() * information;
    const int from = equations.place[relation.from], to = equations.place[relation.to];
    if (from >= 0) {
      equations.Add(from, from, from_information * at.J_error_from);
      equations.g.segment<3>(3 * from) += from_information * at.error;
    }
    if (to >= 0) {
      equations.Add(to, to, to_information * at.J_error_to);
      equations.g.segment<3>(3 * to) += to_information * at.error;
    }
    if (from >= 0 && to >= 0) equations.Add(from, to, from_information * at.J_error_to);
  }
  equations.current = true;
}

void PathFit::Step(std::span<const PoseRelation> relations, const PoseGraphOptions& options) {
  Equations& equations = *equations_;
  equations.current = false;
  part_ = Part::kEquations;
  ++iterations_;
  equations.solver.factorize(equations.H);
  if (equations.solver.info() != Eigen::Success) return EndStage(relations);
  Eigen::VectorXd step = equations.solver.solve(-equations.g);
  if (!step.allFinite()) return EndStage(relations);
  for (int halving = 0; halving <= kMostHalvings; ++halving, step *= 0.5) {
    std::vector<Pose2> moved = path_;
    for (std::size_t k = 1; k < moved.size(); ++k) {
      const Eigen::Vector3d by = step.segment<3>(3 * equations.place[k]);
      moved[k] = {moved[k].x + by.x(), moved[k].y + by.y(), WrapAngle(moved[k].theta + by.z())};
    }
    const double cost = CostOf(relations, moved, stage_);
    if (!(cost < cost_)) continue;
    const bool settled = cost_ - cost < options.tolerance * cost_;
    path_ = std::move(moved);
    cost_ = cost;
    if (settled || iterations_ >= options.max_iterations) EndStage(relations);
    return;
  }
  EndStage(relations);
}

void PathFit::EndStage(std::span<const PoseRelation> relations) {
  iterations_ = 0;
  if (stage_ + 1 < kStages) {
    cost_ = CostOf(relations, path_, ++stage_);
    return;
  }
  usable_ = cost_ <= cost_before_;
  part_ = Part::kDone;
  equations_.reset();
}

bool PathFit::IsConsistent(std::span<const PoseRelation> relations, std::size_t keyframes) const {
  if (path_.size() < 2 || path_.size() > keyframes || count_ > relations.size()) return false;
  return std::all_of(relations.begin(), relations.begin() + static_cast<std::ptrdiff_t>(count_),
                     [this](const auto& one) { return one.from < path_.size() && one.to < path_.size(); });
}

}  // namespace cairn::slam
