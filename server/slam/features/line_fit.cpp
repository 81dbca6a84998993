#include "server/slam/features/line_fit.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {

FittedLine FitLine(const PointSums& sums) {
  FittedLine line;
  line.centroid = {sums.x / sums.n, sums.y / sums.n};
  const double sxx = sums.xx - sums.x * line.centroid.x();
  const double sxy = sums.xy - sums.x * line.centroid.y();
  const double syy = sums.yy - sums.y * line.centroid.y();
  // (3-8) is tan(2 alpha) = -2 sxy / (syy - sxx). The half-angle formulas avoid trigonometric functions,
  // which would take most of the time of a fit.
  const double numerator = -2.0 * sxy, denominator = syy - sxx;
  const double root = std::hypot(numerator, denominator);
  if (root > 0.0) {
    const double cos_2a = denominator / root;
    const double c = std::sqrt(0.5 * (1.0 + cos_2a)), s = std::sqrt(0.5 * (1.0 - cos_2a));
    line.normal = {c, std::copysign(s, numerator)};
  }
  line.offset = line.normal.dot(line.centroid);  // (3-9)
  line.deviation = std::sqrt(std::max(0.0, 0.5 * (sxx + syy - root)) / sums.n);
  return line;
}

}  // namespace cairn::slam
