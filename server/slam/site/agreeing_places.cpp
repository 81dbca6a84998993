#include "server/slam/site/agreeing_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "server/slam/site/consistent_set.h"

namespace cairn::slam {
namespace {

constexpr std::size_t kMinPlaces = 3;  // Recognised places that must agree before sessions are joined, ...
// ... and the way that they must cover together, in both sessions. The first and the last place may each reach 4.5 m
// beyond what both have seen, because most of a place must be explained, but not all of it. So 15 m are shared.
constexpr double kMinCoveredM = 24.0;
constexpr std::size_t kEnoughPlaces = 5;                   // With so many the search ends.
constexpr std::array<std::size_t, 4> kPasses{0, 2, 1, 3};  // Each looks at every fourth place, from this one on.
constexpr double kMostOfLength = 1.5;  // A place is at most so many times as long in one session as in the other.
// A search that will soon be made again ends where so many passes have found no place.
constexpr std::size_t kFirstPasses = 2;

struct WayRange {
  double low_m = std::numeric_limits<double>::infinity();
  double high_m = -std::numeric_limits<double>::infinity();

  void Add(double way_m) {
    low_m = std::min(low_m, way_m);
    high_m = std::max(high_m, way_m);
  }
  void Add(const WayRange& other) {
    Add(other.low_m);
    Add(other.high_m);
  }
};

// A stretch of one session that was recognised in the other: from `a` to `b`, and from where to where it goes along
// both.
struct Recognised {
  SessionRelation relation;
  WayRange in_a, in_b;
};

SessionRelation Reversed(const SessionRelation& one) {
  const Eigen::Matrix3d J = J_inverse(one.T_from_to);
  return {one.to, one.from, one.T_from_to.Inverse(), J * one.covariance * J.transpose()};
}

// A place of `seen` that begins at keyframe `first` and was recognised in `known`.
Recognised InBoth(const SessionRelation& place, const SessionMap& known, const SessionMap& seen, std::size_t first) {
  Recognised both{.relation = place, .in_a = {}, .in_b = {}};
  both.in_b.Add(seen.travelled_m(first));
  both.in_b.Add(seen.travelled_m(place.to.keyframe));
  const Pose2 T_known_first = known.own_path()[place.from.keyframe] * place.T_from_to *
                              Between(seen.own_path()[place.to.keyframe], seen.own_path()[first]);
  both.in_a.Add(known.travelled_m(place.from.keyframe));
  // Not that of another pass through the same place: the place would seem to cover all the way between the two.
  const double first_m = known.travelled_m(known.NearestTo(T_known_first));
  const double most_m = kMostOfLength * (both.in_b.high_m - both.in_b.low_m);
  if (std::abs(first_m - known.travelled_m(place.from.keyframe)) <= most_m) both.in_a.Add(first_m);
  return both;
}

std::vector<Recognised> LargestAgreeing(const std::vector<Recognised>& all, const SessionMap& a, const SessionMap& b,
                                        const LoopOptions& options) {
  const auto set = LargestConsistentSet(all.size(), [&](std::size_t i, std::size_t j) {
    return Disagreement2(all[i].relation, all[j].relation, a, b, options) <= kMaxChiSquare;
  });
  std::vector<Recognised> agreeing;
  agreeing.reserve(set.size());
  for (const std::size_t i : set) agreeing.push_back(all[i]);
  return agreeing;
}

// So many places, which cover enough way in both sessions: places next to each other show nearly the same.
bool IsProof(const std::vector<Recognised>& places, std::size_t least) {
  if (places.size() < least) return false;
  WayRange in_a, in_b;
  for (const Recognised& one : places) {
    in_a.Add(one.in_a);
    in_b.Add(one.in_b);
  }
  return in_a.high_m - in_a.low_m >= kMinCoveredM && in_b.high_m - in_b.low_m >= kMinCoveredM;
}

// The places of two sessions that were recognised in each other so far.
class PlacesOfBoth {
 public:
  PlacesOfBoth(std::size_t a, SessionMap& map_a, std::size_t b, SessionMap& map_b, const LoopOptions& options,
               RelationBook& book, const IsRival& counts = {})
      : a_(a), b_(b), map_a_(map_a), map_b_(map_b), options_(options), book_(book), counts_(counts) {}

  // Looks for the place around a keyframe of `b` in `a`.
  void LookForB(std::size_t keyframe) {
    if (const auto place = RecognisePlace(a_, map_a_, b_, map_b_, keyframe, options_, book_))
      Add(InBoth(*place, map_a_, map_b_, FirstOfPlace(map_b_, keyframe)));
  }
  void LookForA(std::size_t keyframe) {
    const auto place = RecognisePlace(b_, map_b_, a_, map_a_, keyframe, options_, book_);
    if (!place) return;
    Recognised both = InBoth(*place, map_b_, map_a_, FirstOfPlace(map_a_, keyframe));
    std::swap(both.in_a, both.in_b);
    both.relation = Reversed(*place);
    Add(std::move(both));
  }
  [[nodiscard]] bool none() const { return all_.empty(); }
  [[nodiscard]] bool AreProof(std::size_t least) const { return IsProof(agreeing_, least); }
  // Of the largest set that agrees.
  [[nodiscard]] std::vector<SessionRelation> Relations() const {
    std::vector<SessionRelation> relations;
    relations.reserve(agreeing_.size());
    for (const Recognised& one : agreeing_) relations.push_back(one.relation);
    return relations;
  }

 private:
  void Add(Recognised place) {
    if (counts_ && !counts_(place.relation)) return;
    all_.push_back(std::move(place));
    agreeing_ = LargestAgreeing(all_, map_a_, map_b_, options_);
  }

  const std::size_t a_, b_;
  SessionMap& map_a_;
  SessionMap& map_b_;
  const LoopOptions& options_;
  RelationBook& book_;
  const IsRival counts_;  // Empty: all do.
  std::vector<Recognised> all_;
  std::vector<Recognised> agreeing_;
};

}  // namespace

std::vector<SessionRelation> AgreeingPlaces(std::size_t a, SessionMap& map_a, std::size_t b, SessionMap& map_b,
                                            const LoopOptions& options, bool soon_again, const GoOn& go_on,
                                            RelationBook& book) {
  std::vector<std::size_t> of_a = PlacesToLookFor(map_a), of_b = PlacesToLookFor(map_b);
  if (soon_again) {  // What was driven since the last search has not been looked for yet.
    std::ranges::reverse(of_a);
    std::ranges::reverse(of_b);
  }
  PlacesOfBoth places(a, map_a, b, map_b, options, book);
  for (std::size_t pass = 0; pass < kPasses.size(); ++pass) {
    if (soon_again && pass == kFirstPasses && places.none()) return {};
    for (std::size_t i = kPasses[pass]; i < std::max(of_a.size(), of_b.size()); i += kPasses.size()) {
      if (places.AreProof(kEnoughPlaces)) return places.Relations();
      if (!go_on()) return {};
      if (i < of_b.size()) places.LookForB(of_b[i]);
      if (i >= of_a.size() || !go_on()) continue;
      places.LookForA(of_a[i]);
    }
  }
  return places.AreProof(kMinPlaces) ? places.Relations() : std::vector<SessionRelation>{};
}

std::vector<SessionRelation> RivalPlaces(std::size_t a, SessionMap& map_a, std::size_t b, SessionMap& map_b,
                                         const SoughtRivals& sought, const LoopOptions& options, const GoOn& go_on,
                                         RelationBook& book) {
  PlacesOfBoth rivals(a, map_a, b, map_b, options, book, sought.is_rival);
  // First what earlier jobs have found, which costs no search.
  const auto found_first = [&book](std::vector<std::size_t> places, const SessionMap& known, const SessionMap& seen) {
    std::stable_partition(places.begin(), places.end(), [&](std::size_t k) {
      const Measurement* const one = book.Find({known.session(), seen.session()}, MeasurementKind::kPlace, seen.id(k));
      return one != nullptr && one->found;
    });
    return places;
  };
  const std::vector<std::size_t> of_a = found_first(sought.of_a, map_b, map_a);
  const std::vector<std::size_t> of_b = found_first(sought.of_b, map_a, map_b);
  const std::size_t before = book.measured();
  const auto goes_on = [&] {
    return go_on() && book.measured() - before < (rivals.none() ? sought.most_until_first : sought.most);
  };
  for (const std::size_t pass : kPasses) {
    for (std::size_t i = pass; i < std::max(of_a.size(), of_b.size()); i += kPasses.size()) {
      if (rivals.AreProof(kEnoughPlaces)) return rivals.Relations();
      if (i < of_b.size() && goes_on()) rivals.LookForB(of_b[i]);
      if (i < of_a.size() && goes_on()) rivals.LookForA(of_a[i]);
    }
  }
  return rivals.AreProof(kMinPlaces) ? rivals.Relations() : std::vector<SessionRelation>{};
}

}  // namespace cairn::slam
