#include "server/slam/scan/thinning.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace cairn::slam {
namespace {

// Several readings that were replaced by one point.
struct Cloud {
  Eigen::Vector2d centre;
  double readings;
};

// The clouds sorted into squares with the side of a window. All clouds within a window of a point lie in the
// nine squares around it.
class Squares {
 public:
  Squares(const std::vector<Cloud>& clouds, double side_m) : side_m_(side_m) {
    order_.reserve(clouds.size());
    for (std::size_t i = 0; i < clouds.size(); ++i) order_.push_back({SquareOf(clouds[i].centre), i});
    std::sort(order_.begin(), order_.end());
  }

  // Finds the clouds in the nine squares around a point, in ascending order of their indices.
  void Near(const Eigen::Vector2d& p, std::vector<std::size_t>& found) const {
    found.clear();
    const auto [x, y] = SquareOf(p);
    for (double dx = -1; dx <= 1; ++dx) {
      const auto first = std::lower_bound(order_.begin(), order_.end(), Entry{{x + dx, y - 1}, 0});
      for (auto at = first; at != order_.end() && at->square[0] == x + dx && at->square[1] <= y + 1; ++at)
        found.push_back(at->cloud);
    }
    std::sort(found.begin(), found.end());
  }

 private:
  // Whole numbers, stored as double so that the square of a distant point does not overflow.
  using Square = std::array<double, 2>;
  struct Entry {
    Square square;
    std::size_t cloud;
    bool operator<(const Entry& other) const {
      return square != other.square ? square < other.square : cloud < other.cloud;
    }
  };
  [[nodiscard]] Square SquareOf(const Eigen::Vector2d& p) const {
    return {std::floor(p.x() / side_m_), std::floor(p.y() / side_m_)};
  }

  double side_m_;
  std::vector<Entry> order_;
};

// Places a window around every cloud that no earlier window contains, and merges the clouds in it.
std::vector<Cloud> MoveWindow(const std::vector<Cloud>& clouds, double window_m) {
  const Squares squares(clouds, window_m);
  std::vector<char> taken(clouds.size(), 0);
  std::vector<std::size_t> near;
  std::vector<Cloud> left;
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    if (taken[i] != 0) continue;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double readings = 0.0;
    squares.Near(clouds[i].centre, near);
    for (const std::size_t j : near) {
      if (taken[j] != 0 || (clouds[j].centre - clouds[i].centre).norm() >= window_m) continue;
      taken[j] = 1;
      sum += clouds[j].readings * clouds[j].centre;
      readings += clouds[j].readings;
    }
    left.push_back(readings > clouds[i].readings ? Cloud{sum / readings, readings} : clouds[i]);
  }
  return left;
}

}  // namespace

void Visit(OptionVisitor& visitor, ThinningOptions& options) {
  visitor.Real(
      "window_m", options.window_m, "m", 0.0, 1.0,
      "Points within this distance are replaced by their mean. A larger value leaves fewer points; 0 keeps all.");
}

std::vector<Eigen::Vector2d> ThinByCentreOfGravity(std::span<const Eigen::Vector2d> points,
                                                   const ThinningOptions& options) {
  std::vector<Cloud> clouds;
  clouds.reserve(points.size());
  for (const Eigen::Vector2d& p : points)
    if (p.allFinite()) clouds.push_back({p, 1.0});
  // After a pass the centres of neighbouring windows can be nearer to each other than the window. Passes are
  // repeated until the number of clouds no longer falls; one pass is nearly always enough.
  for (std::size_t before = clouds.size() + 1; options.window_m > 0.0 && clouds.size() < before;) {
    before = clouds.size();
    clouds = MoveWindow(clouds, options.window_m);
  }
  std::vector<Eigen::Vector2d> thinned;
  thinned.reserve(clouds.size());
  for (const Cloud& cloud : clouds) thinned.push_back(cloud.centre);
  return thinned;
}

}  // namespace cairn::slam
