// What a scan has to say about surface points seen from elsewhere, supposed that the poses are right. A point is borne
// out where a beam ends near it; contradicted where all beams that pass near it go on well beyond, for then nothing can
// stand there; and where something stands before it, or no beam went that way, the scan does not know. Asked both ways,
// this finds beams that end deep in free space and beams that pass through walls, without a grid. Not a matcher: poses
// are taken as they are. Stateless, thread-safe. Source: visibility between range scans as in Lu and Milios 1997 (the
// points to compare), and hits, misses and passes of Burgard et al., Map building with mobile robots (2003).
#pragma once

#include <span>

#include "common/geometry/pose2.h"
#include "common/sensor/scan.h"
#include "server/slam/matching/surface_points.h"

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

// `T_witness_points` maps the frame of the points into the robot frame of `witness` (a validated scan). Points farther
// than `max_range_m` from the witness' laser are left out; poses and points may be wrong by `near_m`.
[[nodiscard]] Testimony Testify(const Scan& witness, const Pose2& T_witness_points,
                                std::span<const SurfacePoint> points, double near_m, double max_range_m);

}  // namespace cairn::slam
