#include "server/slam/site/site_smoothing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <utility>

#include "server/slam/site/agreement.h"
#include "server/slam/site/consistent_set.h"
#include "server/slam/site/site_graph.h"
#include "server/slam/smoothing/smoothed_map.h"

namespace cairn::slam {
namespace {

constexpr std::size_t kMinPlaces = 3;     // Recognised places that must agree before sessions are joined, ...
constexpr double kMinSpreadM = 15.0;      // ... and the way along which they must lie, in both sessions.
constexpr std::size_t kEnoughPlaces = 5;  // With so many the search ends.
constexpr std::array<std::size_t, 4> kPasses{0, 2, 1, 3};  // Each looks at every fourth place, from this one on.
// A job that will soon be made again ends where so many passes have found no place.
constexpr std::size_t kFirstPasses = 2;
constexpr double kTieEveryM = 3.0;          // Way between two ties.
constexpr std::size_t kMinRelations = 3;    // Two sessions are not related by fewer.
constexpr double kMaxContradicting = 0.10;  // Share of what both have seen that may contradict, ...
constexpr double kMaxBadPlaces = 0.15;      // ... and of places where much contradicts.
constexpr std::size_t kMinComparedPlaces = 5;
constexpr int kRounds = 3;            // Searches near the paths, each along the paths of the last one.
constexpr double kEnoughMore = 1.02;  // No further search if the last one found no more than this ratio.

class Smoothing {
 public:
  Smoothing(std::deque<SessionMap>& maps, SiteGraph graph, const SiteOptions& options, SiteSearch search,
            const std::function<bool(double)>& go_on)
      : maps_(maps), graph_(std::move(graph)), options_(options), search_(search), go_on_(go_on) {}

  // False: cancelled.
  bool Run() {
    if (search_ == SiteSearch::kAll) return JoinByStarts() && JoinByPlaces() && Refine();
    // Where nothing was found, there is nothing to fit.
    return JoinByPlaces() && (graph_.relations().empty() || (JoinByStarts() && Refine()));
  }

  [[nodiscard]] SmoothedSession ResultOf(std::size_t s) const {
    SmoothedSession result;
    result.path = graph_.path(s);
    result.frame = graph_.frame_of(s);
    result.relations = graph_.CountOf(s);
    result.joined = result.relations > 0;
    result.withdrawn = graph_.WithdrawnOf(s);
    if (!result.path.empty() && result.frame != s)
      result.T_site_own = result.path.front() * maps_[s].own_path().front().Inverse();
    VisibilityCounts all;
    for (std::size_t other = 0; other < maps_.size(); ++other)
      if (other != s && graph_.Together(s, other))
        all += AgreementBetween(std::min(s, other), std::max(s, other)).counts;
    if (result.joined && all.known() > 0) result.agreement = static_cast<double>(all.confirmed) / all.known();
    return result;
  }

 private:
  struct Pair {
    std::size_t a = 0;
    std::size_t b = 0;
  };

  [[nodiscard]] std::vector<Pair> Pairs() const {
    std::vector<Pair> pairs;
    for (std::size_t b = 1; b < maps_.size(); ++b)
      for (std::size_t a = 0; a < b; ++a)
        if (maps_[a].size() > 0 && maps_[b].size() > 0) pairs.push_back({a, b});
    return pairs;
  }

  [[nodiscard]] GoOn Asked() {
    return [this] { return go_on_(done_); };
  }

  // Sessions that start at known places are related where their paths say that they have seen the same.
  bool JoinByStarts() {
    for (const auto& [a, b] : Pairs()) {
      if (!graph_.start_known(a) || !graph_.start_known(b)) continue;
      const SiteGraph before = graph_;
      const std::vector<Tie> starts{{0, 0}};
      const auto found = SearchNearby(a, b, starts);
      if (!go_on_(done_)) return false;
      if (!Try(a, b, found)) return false;
      if (!IsTrusted(a, b)) graph_ = before;
    }
    return true;
  }

  bool JoinByPlaces() {
    std::vector<Pair> left = Pairs();
    const std::size_t all = left.size();
    // A fragment that is joined makes pairs of others worth a search that were not before.
    for (auto next = left.begin(); next != left.end();) {
      done_ = kShareOfPlaces * static_cast<double>(all - left.size()) / static_cast<double>(all);
      const Pair pair = *next;
      if (!IsToBeSearched(pair)) {
        ++next;
        continue;
      }
      left.erase(next);
      if (!JoinPair(pair)) return false;
      next = left.begin();
    }
    for (SessionMap& map : maps_) map.ForgetPlaces();
    done_ = kShareOfPlaces;
    return true;
  }

  [[nodiscard]] bool IsToBeSearched(const Pair& pair) const {
    if (graph_.Together(pair.a, pair.b)) return false;
    const auto known = [this](std::size_t session) { return graph_.start_known(graph_.frame_of(session)); };
    return search_ == SiteSearch::kAll || known(pair.a) != known(pair.b);
  }

  // False: cancelled.
  bool JoinPair(const Pair& pair) {
    const auto [a, b] = pair;
    const auto places = AgreeingPlaces(a, b);
    if (!go_on_(done_)) return false;
    if (places.empty()) return true;
    const SiteGraph before = graph_;
    if (!Try(a, b, places)) return false;
    const auto found = SearchNearby(a, b, TiesOf(a, b));
    if (!go_on_(done_) || !Try(a, b, found)) return false;
    if (!IsTrusted(a, b)) graph_ = before;
    return true;
  }

  // Relations between all sessions that lie in one frame, searched anew along the solved paths.
  bool Refine() {
    double relations_before = 0.0;
    for (int round = 0; round < kRounds; ++round) {
      done_ = kShareOfPlaces + (1.0 - kShareOfPlaces) * round / kRounds;
      std::vector<SessionRelation> all;
      const std::vector<Pair> pairs = Pairs();
      for (const auto& [a, b] : pairs) {
        if (!graph_.Together(a, b)) continue;
        const auto found = SearchNearby(a, b, TiesOf(a, b));
        if (!go_on_(done_)) return false;
        all.insert(all.end(), found.begin(), found.end());
      }
      for (const auto& [a, b] : pairs) graph_.RemoveBetween(a, b);
      graph_.Add(all);
      if (!SolveAndWithdraw()) return false;
      for (const auto& [a, b] : pairs)
        if (RelationsBetween(a, b) > 0 && !IsTrusted(a, b)) graph_.RemoveBetween(a, b);
      if (!graph_.Solve(Asked())) return false;
      const auto relations_now = static_cast<double>(graph_.relations().size());
      if (relations_now <= kEnoughMore * relations_before) break;
      relations_before = relations_now;
    }
    return true;
  }

  // False: cancelled.
  bool Try(std::size_t a, std::size_t b, std::span<const SessionRelation> relations) {
    graph_.RemoveBetween(a, b);
    graph_.Add(relations);
    return SolveAndWithdraw();
  }

  bool SolveAndWithdraw() {
    constexpr int kMostRounds = 4;
    for (int i = 0; i < kMostRounds; ++i) {
      if (!graph_.Solve(Asked())) return false;
      if (graph_.WithdrawOutvoted() == 0) return true;
    }
    return graph_.Solve(Asked());
  }

  [[nodiscard]] std::size_t RelationsBetween(std::size_t a, std::size_t b) const {
    return static_cast<std::size_t>(std::ranges::count_if(graph_.relations(), [a, b](const SessionRelation& one) {
      return one.from.session == a && one.to.session == b;
    }));
  }

  [[nodiscard]] SessionAgreement AgreementBetween(std::size_t a, std::size_t b) const {
    const PosePath path_a = PathOf(a), path_b = PathOf(b);
    return AgreementOf({a, maps_[a], path_a}, {b, maps_[b], path_b}, options_);
  }

  // Whether the relations between two sessions may bend the map.
  [[nodiscard]] bool IsTrusted(std::size_t a, std::size_t b) const {
    if (RelationsBetween(a, b) < kMinRelations) return false;
    const SessionAgreement agreement = AgreementBetween(a, b);
    return agreement.places >= kMinComparedPlaces &&
           agreement.counts.contradicted <= kMaxContradicting * agreement.counts.known() &&
           static_cast<double>(agreement.contradicting) <= kMaxBadPlaces * static_cast<double>(agreement.places);
  }

  // Places of each that are recognised in the other, the largest set of them that agrees. Empty if these are no proof.
  // The search ends with the first proof; it looks at places far apart first.
  [[nodiscard]] std::vector<SessionRelation> AgreeingPlaces(std::size_t a, std::size_t b) {
    const std::vector<std::size_t> of_a = PlacesToLookFor(maps_[a]), of_b = PlacesToLookFor(maps_[b]);
    std::vector<SessionRelation> all;
    std::vector<SessionRelation> agreeing;
    const auto add = [&](const std::optional<SessionRelation>& place) {
      if (!place) return;
      all.push_back(*place);
      agreeing = LargestAgreeing(all);
    };
    for (std::size_t pass = 0; pass < kPasses.size(); ++pass) {
      if (search_ == SiteSearch::kFragments && pass == kFirstPasses && all.empty()) return {};
      for (std::size_t i = kPasses[pass]; i < std::max(of_a.size(), of_b.size()); i += kPasses.size()) {
        if (IsProof(agreeing, kEnoughPlaces)) return agreeing;
        if (!go_on_(done_)) return {};
        if (i < of_b.size()) add(RecognisePlace(a, maps_[a], b, maps_[b], of_b[i], options_.loop));
        if (i >= of_a.size() || !go_on_(done_)) continue;
        const auto place = RecognisePlace(b, maps_[b], a, maps_[a], of_a[i], options_.loop);
        if (place) add(Reversed(*place));
      }
    }
    if (!IsProof(agreeing, kMinPlaces)) agreeing.clear();
    return agreeing;
  }

  [[nodiscard]] static SessionRelation Reversed(const SessionRelation& one) {
    const Eigen::Matrix3d J = J_inverse(one.T_from_to);
    return {one.to, one.from, one.T_from_to.Inverse(), J * one.covariance * J.transpose()};
  }

  // All are between the same two sessions.
  [[nodiscard]] std::vector<SessionRelation> LargestAgreeing(const std::vector<SessionRelation>& all) const {
    const SessionMap& from = maps_[all.front().from.session];
    const SessionMap& to = maps_[all.front().to.session];
    const auto set = LargestConsistentSet(all.size(), [&](std::size_t i, std::size_t j) {
      return Disagreement2(all[i], all[j], from, to, options_.loop) <= kMaxChiSquare;
    });
    std::vector<SessionRelation> agreeing;
    agreeing.reserve(set.size());
    for (const std::size_t i : set) agreeing.push_back(all[i]);
    return agreeing;
  }

  // So many places, spread over some way in both sessions.
  [[nodiscard]] bool IsProof(const std::vector<SessionRelation>& places, std::size_t least) const {
    if (places.size() < least) return false;
    const auto spread = [&](auto keyframe_of) {
      double low = std::numeric_limits<double>::infinity(), high = -low;
      for (const SessionRelation& one : places) {
        const SessionKeyframe at = keyframe_of(one);
        const double here = maps_[at.session].travelled_m(at.keyframe);
        low = std::min(low, here);
        high = std::max(high, here);
      }
      return high - low;
    };
    return spread([](const auto& one) { return one.from; }) >= kMinSpreadM &&
           spread([](const auto& one) { return one.to; }) >= kMinSpreadM;
  }

  [[nodiscard]] PosePath PathOf(std::size_t session) const {
    PosePath path;
    for (const Pose2& pose : graph_.path(session)) path.Append(pose);
    return path;
  }

  [[nodiscard]] std::vector<SessionRelation> SearchNearby(std::size_t a, std::size_t b, std::span<const Tie> ties) {
    const PosePath path_a = PathOf(a), path_b = PathOf(b);
    return FindRelationsNearby({a, maps_[a], path_a}, {b, maps_[b], path_b}, ties, options_, Asked());
  }

  // The relations between two sessions, some metres apart. Sessions that are related only through others are tied where
  // they come nearest.
  [[nodiscard]] std::vector<Tie> TiesOf(std::size_t a, std::size_t b) const {
    std::vector<Tie> ties;
    const auto near = [this](std::size_t session, std::size_t x, std::size_t y) {
      return std::abs(maps_[session].travelled_m(x) - maps_[session].travelled_m(y)) < kTieEveryM;
    };
    for (const SessionRelation& one : graph_.relations()) {
      if (one.from.session != a || one.to.session != b) continue;
      const Tie tie{one.from.keyframe, one.to.keyframe};
      if (std::ranges::none_of(
              ties, [&](const Tie& other) { return near(a, other.known, tie.known) && near(b, other.seen, tie.seen); }))
        ties.push_back(tie);
    }
    if (!ties.empty()) return ties;
    Tie nearest;
    double least = std::numeric_limits<double>::infinity();
    const PosePath path_a = PathOf(a);
    for (std::size_t k = 0; k < maps_[b].size(); ++k) {
      const Eigen::Vector2d here = graph_.path(b)[k].translation();
      const double reach_m = std::min(least, options_.loop.max_doubt_m);
      ForEachNear(path_a, path_a.size(), here, reach_m, [&](std::size_t i, const Pose2& there) {
        const double away_m = (there.translation() - here).norm();
        if (away_m >= least) return;
        least = away_m;
        nearest = {i, k};
      });
    }
    return {nearest};
  }

  static constexpr double kShareOfPlaces = 0.5;  // Of the work.

  std::deque<SessionMap>& maps_;
  SiteGraph graph_;
  const SiteOptions& options_;
  const SiteSearch search_;
  const std::function<bool(double)>& go_on_;
  double done_ = 0.0;
};

}  // namespace

std::optional<std::vector<SmoothedSession>> SmoothSessions(std::span<const SiteSession> sessions,
                                                           const SiteOptions& options,
                                                           const std::function<bool(double)>& go_on,
                                                           SiteSearch search) {
  std::deque<SessionMap> maps;
  std::vector<const SessionMap*> known;
  std::vector<bool> start_known;
  for (const SiteSession& session : sessions) {
    auto own_path = SmoothedPath(session.snapshot, [&go_on] { return go_on(0.0); });
    if (!own_path) return std::nullopt;
    known.push_back(&maps.emplace_back(session.snapshot, *std::move(own_path), options));
    start_known.push_back(session.start_known);
  }
  Smoothing smoothing(maps, SiteGraph(known, std::move(start_known), options.pose_graph), options, search, go_on);
  if (options.pose_graph.enabled && !smoothing.Run()) return std::nullopt;
  std::vector<SmoothedSession> results;
  for (std::size_t s = 0; s < maps.size(); ++s) results.push_back(smoothing.ResultOf(s));
  return results;
}

}  // namespace cairn::slam
