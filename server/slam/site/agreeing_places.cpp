#include "server/slam/site/agreeing_places.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "server/slam/site/consistent_set.h"

namespace cairn::slam {
namespace {

constexpr std::size_t kMinPlaces = 3;     // Recognised places that must agree before sessions are joined, ...
constexpr double kMinSpreadM = 15.0;      // ... and the way along which they must lie, in both sessions.
constexpr std::size_t kEnoughPlaces = 5;  // With so many the search ends.
constexpr std::array<std::size_t, 4> kPasses{0, 2, 1, 3};  // Each looks at every fourth place, from this one on.
// A search that will soon be made again ends where so many passes have found no place.
constexpr std::size_t kFirstPasses = 2;

SessionRelation Reversed(const SessionRelation& one) {
  const Eigen::Matrix3d J = J_inverse(one.T_from_to);
  return {one.to, one.from, one.T_from_to.Inverse(), J * one.covariance * J.transpose()};
}

std::vector<SessionRelation> LargestAgreeing(const std::vector<SessionRelation>& all, const SessionMap& from,
                                             const SessionMap& to, const LoopOptions& options) {
  const auto set = LargestConsistentSet(all.size(), [&](std::size_t i, std::size_t j) {
    return Disagreement2(all[i], all[j], from, to, options) <= kMaxChiSquare;
  });
  std::vector<SessionRelation> agreeing;
  agreeing.reserve(set.size());
  for (const std::size_t i : set) agreeing.push_back(all[i]);
  return agreeing;
}

// So many places, spread over some way in both sessions.
bool IsProof(const std::vector<SessionRelation>& places, const SessionMap& from, const SessionMap& to,
             std::size_t least) {
  if (places.size() < least) return false;
  const auto spread = [&](const SessionMap& map, auto keyframe_of) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const SessionRelation& one : places) {
      const double here = map.travelled_m(keyframe_of(one).keyframe);
      low = std::min(low, here);
      high = std::max(high, here);
    }
    return high - low;
  };
  return spread(from, [](const auto& one) { return one.from; }) >= kMinSpreadM &&
         spread(to, [](const auto& one) { return one.to; }) >= kMinSpreadM;
}

}  // namespace

std::vector<SessionRelation> AgreeingPlaces(std::size_t a, SessionMap& map_a, std::size_t b, SessionMap& map_b,
                                            const LoopOptions& options, bool soon_again, const GoOn& go_on,
                                            RelationBook& book) {
  const std::vector<std::size_t> of_a = PlacesToLookFor(map_a), of_b = PlacesToLookFor(map_b);
  std::vector<SessionRelation> all;
  std::vector<SessionRelation> agreeing;
  const auto add = [&](const SessionRelation& place) {
    all.push_back(place);
    agreeing = LargestAgreeing(all, map_a, map_b, options);
  };
  for (std::size_t pass = 0; pass < kPasses.size(); ++pass) {
    if (soon_again && pass == kFirstPasses && all.empty()) return {};
    for (std::size_t i = kPasses[pass]; i < std::max(of_a.size(), of_b.size()); i += kPasses.size()) {
      if (IsProof(agreeing, map_a, map_b, kEnoughPlaces)) return agreeing;
      if (!go_on()) return {};
      if (i < of_b.size())
        if (const auto place = RecognisePlace(a, map_a, b, map_b, of_b[i], options, book)) add(*place);
      if (i >= of_a.size() || !go_on()) continue;
      if (const auto place = RecognisePlace(b, map_b, a, map_a, of_a[i], options, book)) add(Reversed(*place));
    }
  }
  if (!IsProof(agreeing, map_a, map_b, kMinPlaces)) agreeing.clear();
  return agreeing;
}

}  // namespace cairn::slam
