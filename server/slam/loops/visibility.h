// Compares a scan with surface points seen from another pose, under the assumption that the poses are right. A
// point is confirmed if a beam of the scan ends near it. It is contradicted if all beams that pass near it end
// far behind it, because then there can be no surface. If something stands before it, or no beam passes there,
// it is unknown. With the comparison in both directions this finds beams that end
// deep in free space and beams that pass through walls, without a grid. Not a matcher: it does not change
// poses. Stateless, thread-safe.
// Source: visibility between range scans as in Lu and Milios 1997 (the points to compare), and hits, misses
// and passes of Burgard et al., Map building with mobile robots (2003).
#pragma once

#include <span>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "server/slam/scan/surface_points.h"

namespace cairn::slam {

struct VisibilityCounts {
  int confirmed = 0;
  int contradicted = 0;

  [[nodiscard]] int known() const { return confirmed + contradicted; }
  VisibilityCounts& operator+=(const VisibilityCounts& other) {
    confirmed += other.confirmed;
    contradicted += other.contradicted;
    return *this;
  }
};

// `T_scan_points` transforms the frame of the points into the robot frame of `scan` (a validated scan).
// Points farther than `max_range_m` from the laser of the scan are left out. `near_m` is the tolerance for
// errors of poses and points.
[[nodiscard]] VisibilityCounts CompareVisibility(const Scan& scan, const Pose2& T_scan_points,
                                                 std::span<const SurfacePoint> points, double near_m,
                                                 double max_range_m);

// Old keyframes farther away than this from the robot are not compared: they show too little of the same.
inline constexpr double kMaxVisibleM = 4.0;
// Both scans against each other, at the relative pose `T_a_b`. Farther points are left out, because errors of the
// heading displace them too much.
[[nodiscard]] VisibilityCounts CompareBothWays(const Scan& scan_a, std::span<const SurfacePoint> points_a,
                                               const Scan& scan_b, std::span<const SurfacePoint> points_b,
                                               const Pose2& T_a_b, double near_m);

}  // namespace cairn::slam
