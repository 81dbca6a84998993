// The joint Gaussian of EKF-SLAM: the robot's pose, landmarks and old poses with all their correlations. It
// has no options and makes no decisions. Memory and every update cost the square of the state's dimension.
// Frame `map`. Not thread-safe.
// Source: thesis C 3.1.2 (3.20)-(3.24), 4.1 (4.3)-(4.20). Corrected: (4.18) has the signs of the heading's
// column exchanged (d(Lx)/d(theta) = -l sin, d(Ly)/d(theta) = l cos); (4.2), (4.11) show standard deviations
// where variances belong; (4.16) lacks a transpose. Old poses: stochastic cloning, Roumeliotis and Burdick
// 2002.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "common/geometry/pose2.h"

namespace cairn::slam {

class JointState {
 public:
  explicit JointState(const Pose2& T_map_robot_start);

  [[nodiscard]] Eigen::Index size() const { return size_; }
  [[nodiscard]] Pose2 robot() const { return pose(0); }
  [[nodiscard]] Pose2 pose(Eigen::Index at) const { return {mean_(at), mean_(at + 1), mean_(at + 2)}; }
  [[nodiscard]] Eigen::Vector2d point(Eigen::Index at) const { return mean_.segment<2>(at); }
  template <int Rows, int Columns>
  [[nodiscard]] Eigen::Matrix<double, Rows, Columns> covariance(Eigen::Index row, Eigen::Index column) const {
    return covariance_.block<Rows, Columns>(row, column);
  }

  // Replaces the mean of a pose; covariances are unchanged.
  void SetPose(Eigen::Index at, const Pose2& pose) { mean_.segment<3>(at) = pose.vector(); }
  void SetPoint(Eigen::Index at, const Eigen::Vector2d& point) { mean_.segment<2>(at) = point; }

  // The covariances of a pose or a point are those in a frame that is turned by this angle.
  void Turn(Eigen::Index at, double angle_rad);

  // Prediction. Only the robot moves, so F changes its rows and columns only (4.5). `step_covariance_prev` is
  // in the frame in which the step starts.
  void Move(const Pose2& T_prev_curr, const Eigen::Matrix3d& step_covariance_prev);

  // Augmentation (4.12)-(4.20): adds a point seen at range and bearing `z`, or a copy of the robot's present
  // pose. Returns the first index of the new entry.
  Eigen::Index AddPoint(const Eigen::Vector2d& z, const Eigen::Matrix2d& R_z);
  Eigen::Index AddRobotPose();
  // Removes an entry (marginalisation, which is exact for the others). Entries behind it move up by `count`.
  void Remove(Eigen::Index at, Eigen::Index count);

  // A measurement of the robot and of the entry at `at`: the covariance of the innovation, and the update
  // (3.22)-(3.24).
  template <int N, int M>
  [[nodiscard]] Eigen::Matrix<double, N, N> InnovationCovariance(const Eigen::Matrix<double, N, 3>& J_z_robot,
                                                                 Eigen::Index at,
                                                                 const Eigen::Matrix<double, N, M>& J_z_entry,
                                                                 const Eigen::Matrix<double, N, N>& R) const {
    const Eigen::Matrix<double, N, N> cross = J_z_robot * covariance<3, M>(0, at) * J_z_entry.transpose();
    return J_z_robot * covariance<3, 3>(0, 0) * J_z_robot.transpose() + cross + cross.transpose() +
           J_z_entry * covariance<M, M>(at, at) * J_z_entry.transpose() + R;
  }
  template <int N, int M>
  void Update(const Eigen::Matrix<double, N, 1>& v, const Eigen::Matrix<double, N, 3>& J_z_robot, Eigen::Index at,
              const Eigen::Matrix<double, N, M>& J_z_entry, const Eigen::Matrix<double, N, N>& R) {
    Eigen::Matrix<double, Eigen::Dynamic, N> PHt =
        covariance_.topLeftCorner(size_, size_).template leftCols<3>() * J_z_robot.transpose();
    PHt.noalias() += covariance_.block(0, at, size_, M) * J_z_entry.transpose();
    const auto S = InnovationCovariance<N, M>(J_z_robot, at, J_z_entry, R);
    Learn(PHt, Eigen::MatrixXd(S), Eigen::VectorXd(v));
  }

  // The capacity is part of the state: products of matrices round by how these lie in memory.
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    std::int64_t capacity = self.mean_.size();
    archive(self.size_, capacity, self.headings_);
    bool sound = 3 <= self.size_ && self.size_ <= kMostRead && self.size_ <= capacity && capacity <= 4 * self.size_;
    if constexpr (Archive::kReads)
      sound = sound && archive.Holds(static_cast<std::size_t>(self.size_ * self.size_) * sizeof(double));
    for (const Eigen::Index heading : self.headings_) sound = sound && 0 <= heading && heading < self.size_;
    if (!archive.Require(sound, "the size of the joint state")) return;
    if constexpr (Archive::kReads) {
      self.mean_.setZero(capacity);
      self.covariance_.setZero(capacity, capacity);
    }
    for (Eigen::Index i = 0; i < self.size_; ++i) archive(self.mean_(i));
    for (Eigen::Index column = 0; column < self.size_; ++column)
      for (Eigen::Index row = 0; row < self.size_; ++row) archive(self.covariance_(row, column));
    if constexpr (Archive::kReads)
      archive.Require(self.mean_.allFinite() && self.covariance_.allFinite(), "the joint state");
  }

 private:
  static constexpr std::int64_t kMostRead = 60000;

  void Grow(Eigen::Index count);
  void Learn(const Eigen::MatrixXd& PHt, const Eigen::MatrixXd& S, const Eigen::VectorXd& v);

  Eigen::Index size_ = 3;
  Eigen::VectorXd mean_;  // The capacity of mean and covariance may exceed size_.
  Eigen::MatrixXd covariance_;
  std::vector<Eigen::Index> headings_ = {2};  // Indices of the elements that are angles.
};

}  // namespace cairn::slam
