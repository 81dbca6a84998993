#include "server/slam/site/agreement.h"

#include <cmath>
#include <limits>
#include <optional>

namespace cairn::slam {
namespace {

constexpr double kEveryM = 1.0;   // Way between two comparisons.
constexpr int kMinCompared = 20;  // Points.
constexpr double kBadShare = 1.0 / 3.0;
constexpr double kMaxContradicting = 0.10;  // Share of what both have seen that may contradict, ...
constexpr double kMaxBadPlaces = 0.15;      // ... and of places where much contradicts.

// The keyframe of `map` that shows most of what is seen from this pose.
std::optional<std::size_t> NearestOf(const PlacedSession& session, const Pose2& T_site_robot) {
  std::optional<std::size_t> nearest;
  double least = std::numeric_limits<double>::infinity();
  ForEachNear(session.path, session.path.size(), T_site_robot.translation(), kMaxVisibleM,
              [&](std::size_t k, const Pose2& there) {
                const double distance = (there.translation() - T_site_robot.translation()).norm();
                const double cost = distance + std::abs(AngleDiff(there.theta, T_site_robot.theta));
                if (distance > kMaxVisibleM || !session.map.localized(k) || cost >= least) return;
                least = cost;
                nearest = k;
              });
  return nearest;
}

}  // namespace

bool Contradicts(const SessionAgreement& agreement) {
  return agreement.counts.contradicted > kMaxContradicting * agreement.counts.known() ||
         static_cast<double>(agreement.contradicting) > kMaxBadPlaces * static_cast<double>(agreement.places);
}

SessionAgreement AgreementOf(const PlacedSession& a, const PlacedSession& b, const SiteOptions& options) {
  SessionAgreement agreement;
  double next_m = 0.0;
  for (std::size_t k = 0; k < b.map.size(); ++k) {
    if (b.map.travelled_m(k) < next_m || !b.map.localized(k)) continue;
    const auto near = NearestOf(a, b.path[k]);
    if (!near) continue;
    next_m = b.map.travelled_m(k) + kEveryM;
    const Trail& of_a = a.map.trail();
    const Trail& of_b = b.map.trail();
    const VisibilityCounts counts =
        CompareBothWays(*of_a.keyframes()[*near].scan, *of_a.points(*near), *of_b.keyframes()[k].scan, *of_b.points(k),
                        Between(a.path[*near], b.path[k]), options.self_check.near_m);
    if (counts.known() < kMinCompared) continue;
    agreement.counts += counts;
    ++agreement.places;
    agreement.contradicting += counts.contradicted > kBadShare * counts.known() ? 1 : 0;
  }
  return agreement;
}

}  // namespace cairn::slam
