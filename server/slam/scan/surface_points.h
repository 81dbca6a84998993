// The points of a scan with the direction of the surface on which they lie, thinned to a bounded number.
// Point-to-line matching works with them. Points are in the robot frame of the scan. Stateless, thread-safe.
// Source: point-to-line metric of Censi, ICRA 2008; thinning after thesis C 4.4.3.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/sensor/scan.h"
#include "server/slam/scan/beam_points.h"

namespace cairn::slam {

struct SurfacePoint {
  Eigen::Vector2d p = Eigen::Vector2d::Zero();
  // Unit vector towards the sensor; zero if the surface is not smooth.
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();
  [[nodiscard]] bool smooth() const { return normal != Eigen::Vector2d::Zero(); }
  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.p, self.normal);
    archive.Require(self.p.cwiseAbs().maxCoeff() <= 2e7, "a point of a surface");
  }
};

struct SurfaceOptions {
  double max_range_m = 30.0;  // Farther hits are too sparse to show a surface.
  double min_spacing_m = 0.04;
  double neighbour_span_m = 0.15;
  double max_flatness = 0.12;
  double grazing_gap_m = 2.0;  // Without these two the far ends of corridors hold the robot back.
  double grazing_flat_m = 0.04;
  double span_steps = 3.0;
  std::int64_t skipped_beams = 3;
  std::int64_t grazing_beams = 2;
};
void Visit(OptionVisitor& visitor, SurfaceOptions& options);

// `points` must be PointsOf(scan).
[[nodiscard]] std::vector<SurfacePoint> SurfacePointsOf(std::span<const BeamPoint> points, const Scan& scan,
                                                        const SurfaceOptions& options);

// Finds the nearest surface point of a reference set. The plane is divided into square cells, which are
// mapped onto a torus of buckets, so that the number of buckets is fixed wherever the robot goes. Points of
// distant cells may share a bucket; they are told apart by their distance. A bucket holds at most
// kMaxInBucket points, far more than a wall that was seen forty times puts there, so that no scan can make
// the search slow. Thread rule: built by one thread, then read from any thread.
class PointIndex {
 public:
  static constexpr std::uint16_t kMaxInBucket = 1000;

  // `cell_m` is the side of a cell, and the largest distance at which Nearest is sure to find a point.
  explicit PointIndex(double cell_m);

  void Clear();
  void Add(const SurfacePoint& point);  // A point whose bucket is full is left out.
  // The nearest point within max_distance_m, or null. REQUIRES: max_distance_m <= cell_m.
  [[nodiscard]] const SurfacePoint* Nearest(const Eigen::Vector2d& p, double max_distance_m) const;
  [[nodiscard]] std::size_t size() const { return points_.size(); }

 private:
  static constexpr int kSide = 256;  // Buckets per side of the torus.
  [[nodiscard]] static std::size_t Bucket(int x, int y);

  double cell_m_;
  std::vector<std::int32_t> heads_;    // Per bucket: index of its first point, or -1 if it is empty.
  std::vector<std::uint16_t> counts_;  // Per bucket: number of its points.
  std::vector<std::int32_t> next_;     // Per point: index of the next point in its bucket, or -1.
  std::vector<SurfacePoint> points_;
};

}  // namespace cairn::slam
