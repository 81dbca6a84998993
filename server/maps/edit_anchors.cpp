#include "server/maps/edit_anchors.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <memory>
#include <optional>
#include <utility>

namespace cairn::server {
namespace {

using Complex = std::complex<double>;

// The heading of a keyframe counts as much as the place of a point so far from the others.
constexpr double kHeadingAsFar_m = 1.0;
// Whether a keyframe sees a point is asked of so many at most, the nearest first.
constexpr double kSeenFrom_m = 10.0;
constexpr std::size_t kMostLookedAt = 64;

std::uint64_t NumberAt(const DrawnPath& drawn, std::size_t index) {
  return drawn.numbers == nullptr ? index : (*drawn.numbers)[index];
}

std::size_t SizeOf(const DrawnPath& drawn) {
  if (drawn.path == nullptr) return 0;
  return drawn.numbers == nullptr ? drawn.path->size() : std::min(drawn.path->size(), drawn.numbers->size());
}

std::optional<EditAnchor> AnchorOf(const Eigen::Vector2d& point, const DrawnPaths& paths, const AnchorChoice& choice) {
  using Found = std::pair<double, EditAnchor>;  // How far it is, squared.
  std::optional<Found> nearest;
  std::vector<Found> near;
  for (const SessionId session : choice.sessions_at(point)) {
    const auto drawn = paths.find(session);
    if (drawn == paths.end()) continue;
    for (std::size_t i = 0; i < SizeOf(drawn->second); ++i) {
      const Pose2& pose = (*drawn->second.path)[i];
      const double away_m2 = (pose.translation() - point).squaredNorm();
      const bool is_near = away_m2 <= kSeenFrom_m * kSeenFrom_m, is_nearest = !nearest || away_m2 < nearest->first;
      if (!is_near && !is_nearest) continue;
      const Found found{away_m2, {session, NumberAt(drawn->second, i), pose, pose}};
      if (is_near) near.push_back(found);
      if (is_nearest) nearest = found;
    }
  }
  if (!nearest) return std::nullopt;
  std::ranges::stable_sort(near, {}, &Found::first);
  if (near.size() > kMostLookedAt) near.resize(kMostLookedAt);
  const auto seen = std::ranges::find_if(
      near, [&](const Found& one) { return choice.sees(one.second.T_map_now.translation(), point); });
  return seen == near.end() ? nearest->second : seen->second;
}

// The motion of the keyframe that is nearest to the point.
Pose2 MotionAt(const Eigen::Vector2d& point_then, const std::vector<EditAnchor>& keyframes) {
  const EditAnchor& nearest = *std::ranges::min_element(
      keyframes, {}, [&](const EditAnchor& one) { return (one.T_map_then.translation() - point_then).squaredNorm(); });
  return nearest.T_map_now * nearest.T_map_then.Inverse();
}

}  // namespace

EditAnchors AnchorsOf(const MapEdit& edit, const DrawnPaths& paths, const AnchorChoice& choice) {
  EditAnchors anchors{.points_then = edit.points_map, .keyframes = {}};
  for (const Eigen::Vector2d& point : edit.points_map) {
    const auto anchor = AnchorOf(point, paths, choice);
    if (anchor && std::ranges::find(anchors.keyframes, *anchor) == anchors.keyframes.end())
      anchors.keyframes.push_back(*anchor);
  }
  return anchors;
}

Pose2 MotionOf(const EditAnchors& anchors) {
  const bool same =
      std::ranges::all_of(anchors.keyframes, [](const EditAnchor& one) { return one.T_map_now == one.T_map_then; });
  if (same) return {};
  std::vector<Complex> then, now;
  Complex headings;
  for (const Eigen::Vector2d& point : anchors.points_then) {
    const Pose2 motion = MotionAt(point, anchors.keyframes);
    const Eigen::Vector2d moved = motion * point;
    then.emplace_back(point.x(), point.y());
    now.emplace_back(moved.x(), moved.y());
    headings += std::polar(kHeadingAsFar_m * kHeadingAsFar_m, motion.theta);
  }
  const auto mean = [](const std::vector<Complex>& points) {
    Complex sum;
    for (const Complex& point : points) sum += point;
    return sum / static_cast<double>(points.size());
  };
  const Complex mean_then = mean(then), mean_now = mean(now);
  Complex turn = headings;
  for (std::size_t i = 0; i < then.size(); ++i) turn += std::conj(then[i] - mean_then) * (now[i] - mean_now);
  const double theta = std::arg(turn);
  const Complex shift = mean_now - std::polar(1.0, theta) * mean_then;
  return {shift.real(), shift.imag(), theta};
}

DrawnPath PosesBefore(const DrawnPath& before, const DrawnPath& after) {
  auto path = std::make_shared<std::vector<Pose2>>();
  auto numbers = std::make_shared<std::vector<std::uint64_t>>();
  for (std::size_t i = 0; i < SizeOf(before); ++i) {
    if (after.Find(NumberAt(before, i)) == nullptr) continue;
    path->push_back((*before.path)[i]);
    numbers->push_back(NumberAt(before, i));
  }
  return {std::move(path), std::move(numbers)};
}

}  // namespace cairn::server
