#include "server/slam/matchers/ndt_map.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

constexpr double kMostHalfCells = 512.0;  // Half cells to either side of the middle; bounds the memory.
constexpr double kInlierDistance2 = 9.0;  // Square of three sigma.
// Smaller exponents contribute nothing, and below -87 denormal numbers make the computation slow.
constexpr float kLeastExponent = -60.0F;
// Distance in metres at which a distribution with a variance of one has density 0.
constexpr double kFar = 100.0;

// Sums for the mean and covariance of a cell. Offsets are taken from the first point, so that no digits are
// lost far from the origin.
struct CellSums {
  Eigen::Vector2d first = Eigen::Vector2d::Zero();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  std::int64_t count = 0;
};

// Inverse covariance (2.12) of a cell, with its smaller eigenvalue raised to at least `min_flatness` times
// the larger (Biber 2003), because the covariance of a straight wall is singular. Returns false if all points
// coincide.
bool InverseCovariance(const CellSums& cell, double min_flatness, Eigen::Matrix2d& B) {
  const auto n = static_cast<double>(cell.count);
  const Eigen::Vector2d offset = cell.sum / n;
  const Eigen::Matrix2d covariance = cell.squares / n - offset * offset.transpose();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver;
  solver.computeDirect(covariance);
  const double along = solver.eigenvalues()(1);
  if (!(along > 1e-9)) return false;
  const double across = std::max(solver.eigenvalues()(0), min_flatness * along);
  const Eigen::Matrix2d& V = solver.eigenvectors();
  B = V * Eigen::Vector2d(1.0 / across, 1.0 / along).asDiagonal() * V.transpose();
  return true;
}

}  // namespace

void Visit(OptionVisitor& visitor, NdtMapOptions& options) {
  visitor.Real("cell_m", options.cell_m, "m", 0.1, 10.0,
               "Side of a cell. Larger cells find matches from farther away, and are less accurate.");
  visitor.Integer("min_points", options.min_points, "1", 3, 100, "Fewest points of a cell that has a distribution.");
  visitor.Real("min_flatness", options.min_flatness, "1", 1e-6, 1.0,
               "Smallest ratio of the variances of a cell across and along a wall.");
}

NdtMap::NdtMap(std::span<const Eigen::Vector2d> points, const NdtMapOptions& options)
    : half_m_(0.5 * options.cell_m), per_half_m_(1.0 / half_m_) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  double count = 0.0;
  for (const Eigen::Vector2d& p : points) {
    if (!p.allFinite()) continue;
    middle += p;
    ++count;
  }
  if (count == 0.0) return;
  middle /= count;
  std::vector<Eigen::Vector2d> kept;
  for (const Eigen::Vector2d& p : points)
    if (p.allFinite() && (p - middle).cwiseAbs().maxCoeff() < kMostHalfCells * half_m_) kept.push_back(p);
  if (kept.empty()) return;

  Eigen::Array2d least = kept.front(), most = kept.front();
  for (const Eigen::Vector2d& p : kept) {
    least = least.min(p.array());
    most = most.max(p.array());
  }
  // Cell corners are multiples of the cell's side. One spare cell around the points is for the shifted grids.
  const Eigen::Array2d first = ((least / options.cell_m).floor() - 1.0) * options.cell_m;
  x_first_ = first.x();
  y_first_ = first.y();
  columns_ = static_cast<int>((most.x() - x_first_) / half_m_) + 3;
  rows_ = static_cast<int>((most.y() - y_first_) / half_m_) + 3;
  index_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), -1);
  for (int grid = 0; grid < 4; ++grid) AddGrid(kept, grid, options);
  Shorten();
}

void NdtMap::AddGrid(std::span<const Eigen::Vector2d> points, int grid, const NdtMapOptions& options) {
  // Shift of this grid in half cells.
  const int shift_x = grid & 1, shift_y = grid >> 1;
  const int columns = columns_ / 2 + 2, rows = rows_ / 2 + 2;
  std::vector<std::int32_t> cell_of(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), -1);
  std::vector<CellSums> cells;
  std::vector<std::pair<int, int>> places;
  for (const Eigen::Vector2d& p : points) {
    const int column = (static_cast<int>((p.x() - x_first_) / half_m_) + shift_x) / 2;
    const int row = (static_cast<int>((p.y() - y_first_) / half_m_) + shift_y) / 2;
    std::int32_t& cell = cell_of[static_cast<std::size_t>(row * columns + column)];
    if (cell < 0) {
      cell = static_cast<std::int32_t>(cells.size());
      cells.push_back({.first = p});
      places.emplace_back(column, row);
    }
    CellSums& sums = cells[static_cast<std::size_t>(cell)];
    const Eigen::Vector2d d = p - sums.first;
    sums.sum += d;
    sums.squares += d * d.transpose();
    ++sums.count;
  }
  for (std::size_t i = 0; i < cells.size(); ++i) {
    Eigen::Matrix2d B;
    if (cells[i].count < options.min_points || !InverseCovariance(cells[i], options.min_flatness, B)) continue;
    const Eigen::Vector2d mean = cells[i].first + cells[i].sum / static_cast<double>(cells[i].count);
    for (int part = 0; part < 4; ++part) {
      const int column = 2 * places[i].first - shift_x + (part & 1), row = 2 * places[i].second - shift_y + (part >> 1);
      if (column < 0 || row < 0 || column >= columns_ || row >= rows_) continue;
      std::int32_t& entry = index_[static_cast<std::size_t>(row * columns_ + column)];
      if (entry < 0) {
        entry = static_cast<std::int32_t>(quads_.size());
        quads_.emplace_back();
      }
      Quad& quad = quads_[static_cast<std::size_t>(entry)];
      quad.mean_x(grid) = mean.x();
      quad.mean_y(grid) = mean.y();
      quad.B_xx(grid) = B(0, 0);
      quad.B_xy(grid) = B(0, 1);
      quad.B_yy(grid) = B(1, 1);
      quad.present(grid) = 1.0;
    }
  }
}

void NdtMap::Shorten() {
  short_quads_.resize(quads_.size());
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const std::int32_t index = index_[static_cast<std::size_t>(row * columns_ + column)];
      if (index < 0) continue;
      const Quad& quad = quads_[static_cast<std::size_t>(index)];
      const Eigen::Array4d x = quad.mean_x - (x_first_ + column * half_m_);
      const Eigen::Array4d y = quad.mean_y - (y_first_ + row * half_m_);
      const auto present = quad.present > 0.0;
      short_quads_[static_cast<std::size_t>(index)] = {
          present.select(x, kFar).cast<float>(), present.select(y, kFar).cast<float>(),
          present.select(-0.5 * quad.B_xx, -1.0).cast<float>(), present.select(-quad.B_xy, 0.0).cast<float>(),
          present.select(-0.5 * quad.B_yy, -1.0).cast<float>()};
    }
  }
}

std::int32_t NdtMap::QuadIndex(double x, double y, Place& place) const {
  const double u = (x - x_first_) * per_half_m_, v = (y - y_first_) * per_half_m_;
  // True also if u or v is not a number.
  if (!(u >= 0.0 && v >= 0.0 && u < columns_ && v < rows_)) return -1;
  place = {static_cast<int>(u), static_cast<int>(v)};
  return index_[static_cast<std::size_t>(place.row * columns_ + place.column)];
}

const NdtMap::Quad* NdtMap::QuadAt(double x, double y) const {
  Place place{};
  const std::int32_t quad = QuadIndex(x, y, place);
  return quad < 0 ? nullptr : &quads_[static_cast<std::size_t>(quad)];
}

double NdtMap::Density(const Eigen::Vector2d& p) const {
  const Quad* quad = QuadAt(p.x(), p.y());
  if (quad == nullptr) return 0.0;
  const Eigen::Array4d dx = p.x() - quad->mean_x, dy = p.y() - quad->mean_y;
  const Eigen::Array4d distance2 = quad->B_xx * dx * dx + 2.0 * quad->B_xy * dx * dy + quad->B_yy * dy * dy;
  return (quad->present * (-0.5 * distance2).exp()).sum();
}

double NdtMap::Score(std::span<const Eigen::Vector2d> points, const Pose2& T_map_points) const {
  const double c = std::cos(T_map_points.theta), s = std::sin(T_map_points.theta);
  Eigen::Array4f sum = Eigen::Array4f::Zero();
  Place place{};
  for (const Eigen::Vector2d& p : points) {
    const double x = c * p.x() - s * p.y() + T_map_points.x, y = s * p.x() + c * p.y() + T_map_points.y;
    const std::int32_t index = QuadIndex(x, y, place);
    if (index < 0) continue;
    const ShortQuad& quad = short_quads_[static_cast<std::size_t>(index)];
    const Eigen::Array4f dx = static_cast<float>(x - (x_first_ + place.column * half_m_)) - quad.mean_x;
    const Eigen::Array4f dy = static_cast<float>(y - (y_first_ + place.row * half_m_)) - quad.mean_y;
    sum += ((quad.xx * dx + quad.xy * dy) * dx + quad.yy * dy * dy).max(kLeastExponent).exp();
  }
  return static_cast<double>(sum.sum());
}

NdtDerivatives NdtMap::Derivatives(std::span<const Eigen::Vector2d> points, const Pose2& T_map_points) const {
  const double c = std::cos(T_map_points.theta), s = std::sin(T_map_points.theta);
  NdtDerivatives sum;
  for (const Eigen::Vector2d& p : points) {
    const Eigen::Vector2d turned(c * p.x() - s * p.y(), s * p.x() + c * p.y());
    const Eigen::Vector2d p_map = turned + T_map_points.translation();
    const Quad* quad = QuadAt(p_map.x(), p_map.y());
    if (quad == nullptr) continue;
    // d(p_map) / d(x, y, theta); the only second derivative that is not zero is -turned, twice in theta.
    Eigen::Matrix<double, 2, 3> J;
    J << 1.0, 0.0, -turned.y(), 0.0, 1.0, turned.x();
    bool inlier = false;
    for (int grid = 0; grid < 4; ++grid) {
      if (quad->present(grid) == 0.0) continue;
      const Eigen::Vector2d q(p_map.x() - quad->mean_x(grid), p_map.y() - quad->mean_y(grid));
      Eigen::Matrix2d B;
      B << quad->B_xx(grid), quad->B_xy(grid), quad->B_xy(grid), quad->B_yy(grid);
      const Eigen::Vector2d Bq = B * q;
      const double distance2 = q.dot(Bq);
      const double density = std::exp(-0.5 * distance2);
      // First derivative: d(density) = -density q'B J. The second follows from it:
      const Eigen::Vector3d slope = J.transpose() * Bq;
      sum.score += density;
      sum.gradient -= density * slope;
      sum.hessian += density * (slope * slope.transpose() - J.transpose() * B * J);
      sum.hessian(2, 2) += density * Bq.dot(turned);
      inlier = inlier || distance2 < kInlierDistance2;
    }
    sum.inliers += inlier ? 1 : 0;
  }
  return sum;
}

}  // namespace cairn::slam
