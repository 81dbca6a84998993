// Compares a scan (the witness) with surface points seen from another pose, under the assumption that the
// poses are right. A point is confirmed (borne out) if a beam ends near it. It is contradicted if all beams
// that pass near it end far behind it, because then there can be no surface. If something stands before it,
// or no beam passes there, it is unknown. With the comparison in both directions this finds beams that end
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

struct Testimony {
  int borne_out = 0;
  int contradicted = 0;

  [[nodiscard]] int known() const { return borne_out + contradicted; }
  Testimony& operator+=(const Testimony& other) {
    borne_out += other.borne_out;
    contradicted += other.contradicted;
    return *this;
  }
};

// `T_witness_points` transforms the frame of the points into the robot frame of `witness` (a validated scan).
// Points farther than `max_range_m` from the laser of the witness are left out. `near_m` is the tolerance for
// errors of poses and points.
[[nodiscard]] Testimony Testify(const Scan& witness, const Pose2& T_witness_points,
                                std::span<const SurfacePoint> points, double near_m, double max_range_m);

}  // namespace cairn::slam
