#include "server/slam/dpslam/particle_maps.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/slam/dpslam/map_changes.h"

namespace cairn::slam {
namespace {

constexpr double kGivenUp = -std::numeric_limits<double>::infinity();
constexpr std::size_t kFirstLook = 4;  // The first evaluation uses one ray in this many.
// 2048 cells, 17 MB of rates. If the particles are farther apart, cells outside count as unknown.
constexpr int kMaxBoxTiles = 32;

int TileOf(double metres, double resolution_m) {
  const double tiles = std::floor(metres / resolution_m / kChangeTileSide);
  return static_cast<int>(std::clamp(tiles, -3e7, 3e7));
}

// The box of all cells that the rays of the samples can reach.
TileBox BoxOf(std::span<const MapSample> samples, std::span<const Evidence> evidence, double sigma_m,
              double resolution_m) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  std::vector<double> reach(evidence.size());
  for (std::size_t e = 0; e < evidence.size(); ++e)
    for (const PlacedRays& placed : evidence[e])
      for (const LaserRay& ray : placed.rays->rays) reach[e] = std::max(reach[e], ray.length_m);
  for (const MapSample& sample : samples) {
    const double margin = reach[sample.evidence] + 5.0 * sigma_m + 3.0 * resolution_m;
    for (const PlacedRays& placed : evidence[sample.evidence]) {
      const Eigen::Vector2d p = (sample.T_map_start * placed.T_start_robot) * placed.rays->origin_robot;
      low = low.cwiseMin(p - Eigen::Vector2d::Constant(margin));
      high = high.cwiseMax(p + Eigen::Vector2d::Constant(margin));
    }
  }
  const auto side = [&](double from, double to, int& first, int& count) {
    if (!(from <= to)) return;
    first = TileOf(from, resolution_m);
    count = TileOf(to, resolution_m) - first + 1;
    if (count > kMaxBoxTiles) first += (count - kMaxBoxTiles) / 2, count = kMaxBoxTiles;
  };
  TileBox box;
  side(low.x(), high.x(), box.low_x, box.width);
  side(low.y(), high.y(), box.low_y, box.height);
  return box;
}

}  // namespace

std::vector<double> ParticleMaps::LogLikelihoods(std::span<const MapSample> samples, std::span<const Evidence> evidence,
                                                 const LikelihoodOptions& options,
                                                 const ParallelFor& parallel_for) const {
  std::vector<double> result(samples.size(), 0.0);
  const TileBox box = BoxOf(samples, evidence, options.model.sigma_m, options_.resolution_m);
  if (box.width == 0) return result;
  // Evaluates the rays of every scan whose index modulo `step` is in [first, last).
  const auto look = [&](std::size_t first, std::size_t last, std::size_t step) {
    parallel_for(static_cast<int>(samples.size()), [&](int begin, int end) {
      OpacityWindow window(ancestry_, box, rate_);
      for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
        if (result[i] == kGivenUp) continue;
        const MapSample& sample = samples[i];
        window.Show(ancestry_.living()[sample.map]);
        for (const PlacedRays& placed : evidence[sample.evidence]) {
          const Pose2 T_map_robot = sample.T_map_start * placed.T_start_robot;
          for (std::size_t k = first; k < last; ++k)
            result[i] += LogLikelihood(window, T_map_robot, *placed.rays, k * options.ray_stride,
                                       step * options.ray_stride, options.model);
        }
      }
    });
  };
  if (!(options.give_up_behind > 0.0)) {
    look(0, 1, 1);
    return result;
  }
  look(0, 1, kFirstLook);
  const double best = *std::max_element(result.begin(), result.end());
  for (double& value : result)
    if (value < best - options.give_up_behind) value = kGivenUp;
  look(1, kFirstLook, kFirstLook);
  return result;
}

std::vector<Ancestry::Child> ParticleMaps::Draw(std::span<const MapSample> survivors,
                                                std::span<const Evidence> evidence,
                                                const ParallelFor& parallel_for) const {
  std::vector<Ancestry::Child> children(survivors.size());
  parallel_for(static_cast<int>(survivors.size()), [&](int begin, int end) {
    ChangePainter painter(options_.resolution_m);
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      const MapSample& survivor = survivors[i];
      for (const PlacedRays& placed : evidence[survivor.evidence])
        painter.Draw(*placed.rays, survivor.T_map_start * placed.T_start_robot);
      children[i] = {survivor.map, painter.Take()};
    }
  });
  return children;
}

void ParticleMaps::KeepNear(const Eigen::Vector2d& p_map, double radius_m) {
  const double resolution_m = options_.resolution_m;
  ancestry_.KeepOnly({TileOf(p_map.y() - radius_m, resolution_m), TileOf(p_map.x() - radius_m, resolution_m)},
                     {TileOf(p_map.y() + radius_m, resolution_m), TileOf(p_map.x() + radius_m, resolution_m)});
}

OccupancyImage ParticleMaps::Image(std::size_t map, std::span<const PlacedRays> undrawn) const {
  ChangePainter painter(options_.resolution_m);
  for (const PlacedRays& placed : undrawn) painter.Draw(*placed.rays, placed.T_start_robot);
  MapChanges whole = painter.Take();
  std::vector<Ancestry::Id> line;
  ancestry_.LineTo(ancestry_.living()[map], line);
  for (const Ancestry::Id id : line) whole.Add(MapChanges(ancestry_.changes(id)));
  TileBox box;
  int high_x = INT32_MIN, high_y = INT32_MIN;
  box.low_x = box.low_y = INT32_MAX;
  for (const auto& tile : whole.tiles()) {
    box.low_x = std::min(box.low_x, tile->key.x), high_x = std::max(high_x, tile->key.x);
    box.low_y = std::min(box.low_y, tile->key.y), high_y = std::max(high_y, tile->key.y);
  }
  OccupancyImage image;
  image.resolution_m = options_.resolution_m;
  // Images have at most kMaxImagePixels: a wider map is not drawn.
  if (box.low_x > high_x || std::int64_t{high_x} - box.low_x >= 256 || std::int64_t{high_y} - box.low_y >= 256)
    return image;
  box.width = high_x - box.low_x + 1, box.height = high_y - box.low_y + 1;
  Ancestry alone;
  std::vector<Ancestry::Child> only;
  only.push_back({0, std::move(whole)});
  alone.NextGeneration(std::move(only));
  OpacityWindow window(alone, box, rate_);
  window.Show(alone.living()[0]);
  image.width = window.width(), image.height = window.height();
  image.T_map_origin = {window.low_x() * image.resolution_m, window.low_y() * image.resolution_m, 0.0};
  image.cells.reserve(window.counts().size());
  for (std::size_t i = 0; i < window.counts().size(); ++i) {
    const bool seen = window.counts()[i] != CellCounts{};
    const double stops = StopProbability(1.0, 1.0 / static_cast<double>(window.rates()[i]));
    image.cells.push_back(seen ? static_cast<std::uint8_t>(std::lround(100.0 * stops)) : kUnknownCell);
  }
  return image;
}

}  // namespace cairn::slam
