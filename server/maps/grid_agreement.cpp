#include "server/maps/grid_agreement.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace cairn::server {
namespace {

using slam::OccupancyGrid;

// In units of GridChunk::log_odds: three hits, one hit, five rays that passed.
constexpr int kOccupied = 200, kHit = 80, kFree = -150;
constexpr std::size_t kMostCells = 1000;  // Of each of the two grids that are compared.
constexpr double kStepM = 0.15, kStepRad = 0.03;

struct Cell {
  int x = 0, y = 0;
};

template <typename Visit>
void ForEachCell(const OccupancyGrid::Chunks& grid, const Visit& visit) {
  for (const auto& [key, chunk] : grid) {
    for (int i = 0; i < kTileArea; ++i)
      visit(Cell{key.x * kTileCells + i % kTileCells, key.y * kTileCells + i / kTileCells},
            chunk->log_odds[static_cast<std::size_t>(i)]);
  }
}

// What others know of each cell of an area.
class Known {
 public:
  enum What : std::uint8_t { kNothing = 0, kIsFree, kNearWall };

  Known(const OccupancyGrid::Chunks& grid, Cell low, Cell high, int near)
      : low_(low),
        width_(high.x - low.x + 1),
        height_(high.y - low.y + 1),
        cells_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), kNothing) {
    ForEachCell(grid, [&](Cell cell, int log_odds) {
      if (log_odds == slam::kUnseen) return;
      if (log_odds >= kHit) MarkNear(cell, near);
      if (log_odds <= kFree && Has(cell) && At(cell) == kNothing) Set(cell, kIsFree);
    });
  }
  [[nodiscard]] What operator()(Cell cell) const { return Has(cell) ? At(cell) : kNothing; }

 private:
  [[nodiscard]] bool Has(Cell cell) const {
    return low_.x <= cell.x && cell.x < low_.x + width_ && low_.y <= cell.y && cell.y < low_.y + height_;
  }
  [[nodiscard]] std::size_t Index(Cell cell) const {
    return static_cast<std::size_t>(cell.y - low_.y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(cell.x - low_.x);
  }
  [[nodiscard]] What At(Cell cell) const { return static_cast<What>(cells_[Index(cell)]); }
  void Set(Cell cell, What what) { cells_[Index(cell)] = what; }
  void MarkNear(Cell wall, int near) {
    for (int dy = -near; dy <= near; ++dy) {
      for (int dx = -near; dx <= near; ++dx) {
        const Cell cell{wall.x + dx, wall.y + dy};
        if (Has(cell)) Set(cell, kNearWall);
      }
    }
  }

  const Cell low_;
  const int width_, height_;
  std::vector<std::uint8_t> cells_;
};

// Of many walls, every second, third, ...
std::vector<Eigen::Vector2d> Thinned(std::vector<Eigen::Vector2d> walls) {
  const std::size_t stride = walls.size() / kMostCells + 1;
  std::vector<Eigen::Vector2d> some;
  some.reserve(walls.size() / stride + 1);
  for (std::size_t i = 0; i < walls.size(); i += stride) some.push_back(walls[i]);
  return some;
}

}  // namespace

GridAgreement CompareGrids(const OccupancyGrid::Chunks& grid, const OccupancyGrid::Chunks& others, const Pose2& start,
                           double resolution_m) {
  const Eigen::Vector2d c = start.translation();
  const auto cell_of = [&](const Eigen::Vector2d& p) {
    return Cell{static_cast<int>(std::floor(p.x() / resolution_m)), static_cast<int>(std::floor(p.y() / resolution_m))};
  };
  const auto from_start = [&](Cell cell) -> Eigen::Vector2d {
    return Eigen::Vector2d(cell.x + 0.5, cell.y + 0.5) * resolution_m - c;
  };
  std::vector<Eigen::Vector2d> own;  // Walls as seen from the start, and `theirs` likewise.
  double reach_m = 0.0;
  ForEachCell(grid, [&](Cell cell, int log_odds) {
    if (log_odds < kOccupied) return;
    own.push_back(from_start(cell));
    reach_m = std::max(reach_m, own.back().norm());
  });
  if (own.empty()) return {};

  const auto around = [&](const OccupancyGrid::Chunks& of, double within_m) {
    const Eigen::Vector2d corner(within_m, within_m);
    return Known(of, cell_of(c - corner), cell_of(c + corner),
                 static_cast<int>(std::lround(GridAgreement::kNearM / resolution_m)));
  };
  const double others_m = reach_m + 2.0 * GridAgreement::kReachM;
  const Known of_others = around(others, others_m), of_robot = around(grid, reach_m);
  std::vector<Eigen::Vector2d> theirs;
  ForEachCell(others, [&](Cell cell, int log_odds) {
    if (log_odds < kOccupied) return;
    const Eigen::Vector2d wall = from_start(cell);
    if (wall.norm() <= others_m) theirs.push_back(wall);
  });
  own = Thinned(std::move(own));
  theirs = Thinned(std::move(theirs));

  const auto turns = static_cast<int>(std::lround(GridAgreement::kReachRad / kStepRad));
  const auto steps = static_cast<int>(std::lround(GridAgreement::kReachM / kStepM));
  // At the best place most of what can be compared agrees.
  const auto agrees = [](const GridAgreement& one) {
    return static_cast<long>(one.compared) - 2 * static_cast<long>(one.contradicted);
  };
  // Nothing if less agrees there than `least`, even if all that is not compared yet agrees.
  const auto compare_at = [&](const Eigen::Matrix2d& R, const Eigen::Vector2d& shift,
                              long least) -> std::optional<GridAgreement> {
    GridAgreement agreement;
    auto left = static_cast<long>(own.size() + theirs.size());
    const auto may_be_best = [&](Known::What what) {
      agreement.compared += what != Known::kNothing ? 1 : 0;
      agreement.contradicted += what == Known::kIsFree ? 1 : 0;
      return agrees(agreement) + --left >= least;
    };
    for (const Eigen::Vector2d& wall : own)
      if (!may_be_best(of_others(cell_of(R * wall + shift + c)))) return std::nullopt;
    for (const Eigen::Vector2d& wall : theirs)
      if (!may_be_best(of_robot(cell_of(R.transpose() * (wall - shift) + c)))) return std::nullopt;
    return agreement;
  };
  // Where the robot is said to be is one of the places, and mostly nearly the best: the others need only be compared
  // until they are worse.
  const auto all = static_cast<long>(own.size() + theirs.size());
  long least = agrees(*compare_at(Eigen::Matrix2d::Identity(), Eigen::Vector2d::Zero(), -2 * all));
  GridAgreement best;
  for (int turn = -turns; turn <= turns; ++turn) {
    const Eigen::Matrix2d R = Pose2{0.0, 0.0, turn * kStepRad}.rotation();
    for (int y = -steps; y <= steps; ++y) {
      for (int x = -steps; x <= steps; ++x) {
        const auto agreement = compare_at(R, kStepM * Eigen::Vector2d(x, y), least);
        if (!agreement) continue;
        best = *agreement;
        least = agrees(best) + 1;
      }
    }
  }
  return best;
}

}  // namespace cairn::server
