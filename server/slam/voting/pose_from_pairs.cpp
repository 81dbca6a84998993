#include "server/slam/voting/pose_from_pairs.h"

#include <algorithm>
#include <cmath>

namespace cairn::slam {
namespace {

double PairWeight(const LineFeature& ref, const LineFeature& curr) {
  return std::sqrt(ref.length * curr.length);
}

// The candidates of Table 3.30: every line near the x axis is combined with every line near the y axis, if
// the two cross at a large enough angle.
std::vector<WeightedVector> CandidatesOf(std::span<const PairOffset> offsets, double rotation_rad,
                                         const PoseOptions& options) {
  const double least_cos = std::cos(options.axis_rad), least_crossing = std::sin(options.crossing_rad);
  const double half_c = std::cos(0.5 * rotation_rad), half_s = std::sin(0.5 * rotation_rad);
  const auto near_axis = [&](const PairOffset& o, bool x_axis) {
    // In the frame half-way between the two headings.
    const double normal_x = half_c * o.normal.x() + half_s * o.normal.y();
    const double normal_y = -half_s * o.normal.x() + half_c * o.normal.y();
    return std::abs(x_axis ? normal_y : normal_x) >= least_cos;
  };
  std::vector<WeightedVector> candidates;
  for (std::size_t a = 0; a < offsets.size(); ++a) {
    for (std::size_t b = a + 1; b < offsets.size(); ++b) {
      const PairOffset &u = offsets[a], &v = offsets[b];
      const double sine = u.normal.x() * v.normal.y() - u.normal.y() * v.normal.x();
      if (std::abs(sine) < least_crossing) continue;
      if (!(near_axis(u, true) && near_axis(v, false)) && !(near_axis(u, false) && near_axis(v, true))) continue;
      candidates.push_back({.value = {(u.offset * v.normal.y() - v.offset * u.normal.y()) / sine,
                                      (v.offset * u.normal.x() - u.offset * v.normal.x()) / sine},
                            .weight = std::sqrt(u.weight * v.weight) * std::abs(sine)});
    }
  }
  return candidates;
}

}  // namespace

RobustMean MeanWithoutOutliers(std::vector<WeightedVector> values, double spread, int keep) {
  std::erase_if(values, [](const WeightedVector& v) { return !(v.weight > 0.0) || !v.value.allFinite(); });
  RobustMean result;
  while (!values.empty()) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    double weight = 0.0;
    for (const WeightedVector& v : values) sum += v.weight * v.value, weight += v.weight;
    result.mean = sum / weight;
    const auto farthest = std::max_element(values.begin(), values.end(), [&](const auto& a, const auto& b) {
      return (a.value - result.mean).squaredNorm() < (b.value - result.mean).squaredNorm();
    });
    result.spread = (farthest->value - result.mean).norm();
    result.kept = static_cast<int>(values.size());
    if (result.spread <= spread || result.kept <= keep) break;
    values.erase(farthest);
  }
  return result;
}

std::optional<RotationEstimate> RotationFromPairs(const ScanFeatures& ref, const ScanFeatures& curr,
                                                  std::span<const LinePair> pairs, const PoseOptions& options) {
  if (pairs.empty()) return std::nullopt;
  // Differences are averaged relative to that of the first pair, so that the mean is right across +-pi.
  double origin = 0.0;
  std::vector<WeightedVector> values;
  values.reserve(pairs.size());
  for (const LinePair& pair : pairs) {
    const LineFeature& line_ref = ref.lines[static_cast<std::size_t>(pair.ref)];
    const LineFeature& line_curr = curr.lines[static_cast<std::size_t>(pair.curr)];
    const double difference = AngleDiff(line_ref.slope, line_curr.slope);
    if (values.empty()) origin = difference;
    values.push_back({.value = {AngleDiff(difference, origin), 0.0},
                      .weight = std::pow(PairWeight(line_ref, line_curr), options.rotation_length_power)});
  }
  const RobustMean mean =
      MeanWithoutOutliers(std::move(values), options.rotation_spread_rad, static_cast<int>(options.rotation_keep));
  if (mean.kept == 0) return std::nullopt;
  return RotationEstimate{WrapAngle(origin + mean.mean.x()), mean.kept};
}

std::vector<PairOffset> OffsetsOf(const ScanFeatures& ref, const ScanFeatures& curr, std::span<const LinePair> pairs,
                                  double rotation_rad, const PoseOptions& options) {
  const Pose2 turn{0.0, 0.0, rotation_rad};
  const Eigen::Matrix2d R = turn.rotation();
  std::vector<PairOffset> offsets;
  offsets.reserve(pairs.size());
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const LineFeature& line_ref = ref.lines[static_cast<std::size_t>(pairs[k].ref)];
    const LineFeature& line_curr = curr.lines[static_cast<std::size_t>(pairs[k].curr)];
    if (std::abs(AngleDiff(AngleDiff(line_ref.slope, line_curr.slope), rotation_rad)) > options.pair_rotation_rad) {
      continue;
    }
    const Eigen::Vector2d normal = (line_ref.left_normal() + R * line_curr.left_normal()).normalized();
    const Eigen::Vector2d between = line_ref.midpoint() - R * line_curr.midpoint();
    offsets.push_back(
        {.normal = normal, .offset = normal.dot(between), .weight = PairWeight(line_ref, line_curr), .pair = k});
  }
  return offsets;
}

std::optional<TranslationEstimate> TranslationFromOffsets(std::span<const PairOffset> offsets, double rotation_rad,
                                                          const Eigen::Vector2d& odometry, const PoseOptions& options) {
  if (offsets.empty()) return std::nullopt;
  TranslationEstimate estimate;
  const RobustMean mean = MeanWithoutOutliers(CandidatesOf(offsets, rotation_rad, options),
                                              options.translation_spread_m, static_cast<int>(options.translation_keep));
  if (mean.kept > 0) {
    estimate.translation = mean.mean;
    estimate.spread_m = mean.spread;
    estimate.kept = mean.kept;
    return estimate;
  }
  // In a corridor the longest pair fixes the sign of the common normal; the normals of the others are turned
  // to its side.
  const PairOffset& longest = *std::max_element(
      offsets.begin(), offsets.end(), [](const PairOffset& a, const PairOffset& b) { return a.weight < b.weight; });
  std::vector<WeightedVector> across;
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();
  for (const PairOffset& o : offsets) {
    const double cosine = o.normal.dot(longest.normal);
    if (std::abs(cosine) < std::cos(options.crossing_rad)) continue;
    const double side = cosine < 0.0 ? -1.0 : 1.0;
    normal += side * o.weight * o.normal;
    across.push_back({.value = {side * o.offset, 0.0}, .weight = o.weight});
  }
  normal.normalize();
  const RobustMean offset =
      MeanWithoutOutliers(std::move(across), options.translation_spread_m, static_cast<int>(options.translation_keep));
  estimate.degenerate = true;
  estimate.along = {-normal.y(), normal.x()};
  estimate.translation = offset.mean.x() * normal + odometry.dot(estimate.along) * estimate.along;
  estimate.spread_m = offset.spread;
  estimate.kept = offset.kept;
  return estimate;
}

}  // namespace cairn::slam
