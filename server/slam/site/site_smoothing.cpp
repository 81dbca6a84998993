#include "server/slam/site/site_smoothing.h"

#include <algorithm>
#include <deque>
#include <map>
#include <optional>
#include <utility>

#include "server/slam/site/agreeing_places.h"
#include "server/slam/site/agreement.h"
#include "server/slam/site/believed_relations.h"
#include "server/slam/site/rival_places.h"
#include "server/slam/site/site_graph.h"
#include "server/slam/site/ties.h"
#include "server/slam/smoothing/smoothed_map.h"

namespace cairn::slam {
namespace {

constexpr std::size_t kMinRelations = 3;  // Two sessions are not related by fewer.
constexpr std::size_t kMinComparedPlaces = 5;
constexpr int kRounds = 3;                  // Searches near the paths, each along the paths of the last one.
constexpr std::size_t kRivalSearches = 24;  // Of one job.
// A session is moved away from where it was joined if this share of what is compared contradicts it there, and if less
// than half as much does where it is moved to, and more is explained. What a right join shows is never contradicted.
constexpr double kContradicted = 0.004, kMuchLess = 0.5;
constexpr double kEnoughMore = 1.02;  // No further search if the last one found no more than this ratio.

class Smoothing {
 public:
  // `told`: for each session, whether its place is known, and no job has found it.
  Smoothing(std::deque<SessionMap>& maps, SiteGraph graph, std::vector<bool> told, const SiteOptions& options,
            SiteSearch search, const std::function<bool(double)>& go_on, RelationBook& book)
      : maps_(maps),
        graph_(std::move(graph)),
        told_(std::move(told)),
        options_(options),
        search_(search),
        go_on_(go_on),
        book_(book) {}

  // False: cancelled.
  bool Run() {
    const SiteGraph nothing = graph_;
    const bool all = search_ == SiteSearch::kAll;
    if (!all && !JoinByPlaces()) return false;
    // Where nothing was found, there is nothing to fit.
    if (search_ == SiteSearch::kFragments && graph_.relations().empty()) return true;
    const bool joins = !all && !graph_.relations().empty();
    if (!BeginWithBelieved()) return false;
    // A fragment drives on as long as the job takes; to measure the rest can wait until the next job.
    if (joins && FitsAllTogether()) {
      NoteAllBelieved();
      return true;
    }
    if (!JoinByStarts() || (all && !JoinByPlaces()) || !Refine()) return false;
    if (began_with_ > 0 && distrusts_) {
      // Something of what was believed has turned out wrong, and may have misled the rest.
      TakeBack(nothing);
      began_with_ = 0;
      if ((!all && !JoinByPlaces()) || !JoinByStarts() || (all && !JoinByPlaces()) || !Refine()) return false;
    }
    if (began_with_ > 0 && search_ == SiteSearch::kRobots && !LookForRivals()) return false;
    NoteAllBelieved();
    return true;
  }

  [[nodiscard]] SmoothedSession ResultOf(std::size_t s) {
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

  // SmoothedSession::agreement_before. `online`: one path per session.
  [[nodiscard]] double AgreementBefore(std::size_t s, std::span<const PosePath> online) const {
    VisibilityCounts all;
    for (std::size_t other = 0; other < maps_.size(); ++other) {
      const std::size_t a = std::min(s, other), b = std::max(s, other);
      if (a == b || !graph_.Together(a, b) || !graph_.start_known(a) || !graph_.start_known(b)) continue;
      all += AgreementOf({a, maps_[a], online[a]}, {b, maps_[b], online[b]}, options_).counts;
    }
    return all.known() > 0 ? static_cast<double>(all.confirmed) / all.known() : 0.0;
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

  // The relations that the last job believed take the place of the first search.
  bool BeginWithBelieved() {
    std::vector<SessionRelation> all;
    for (const Pair& pair : Pairs()) {
      if (RelationsBetween(pair.a, pair.b) > 0) continue;
      const auto believed = BelievedBetween(graph_, pair.a, pair.b, book_);
      if (believed.size() >= kMinRelations) all.insert(all.end(), believed.begin(), believed.end());
    }
    began_with_ = all.size();
    graph_.Add(all);
    if (all.empty()) return true;
    // Solved by the last job, but for what is new.
    return graph_.BeginWithLastPaths(book_) || SolveAndWithdraw();
  }

  void NoteAllBelieved() {
    for (const Pair& pair : Pairs()) NoteBelieved(graph_, pair.a, pair.b, book_);
    graph_.NotePaths(book_);
  }

  // Some of it may be done twice.
  void Done(double share) { done_ = std::max(done_, share); }

  [[nodiscard]] GoOn Asked() const {
    return [this] { return go_on_(done_); };
  }

  // Sessions that start at known places are related where their paths say that they have seen the same.
  bool JoinByStarts() {
    for (const auto& [a, b] : Pairs()) {
      if (!graph_.start_known(a) || !graph_.start_known(b) || RelationsBetween(a, b) > 0) continue;
      const SiteGraph before = graph_;
      const std::vector<Tie> starts{{0, 0}};
      const auto found = SearchNearby(a, b, starts);
      if (!go_on_(done_)) return false;
      if (!Try(a, b, found)) return false;
      if (!IsTrusted(a, b)) TakeBack(before);
    }
    return true;
  }

  bool JoinByPlaces() {
    std::vector<Pair> pairs = Pairs();
    // A robot that is joined is to be told so at once; the pairs that it makes worth a search wait for the next job.
    std::erase_if(pairs, [this](const Pair& pair) { return !IsToBeSearched(pair); });
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      Done(kShareOfPlaces * static_cast<double>(i) / static_cast<double>(pairs.size()));
      if (IsToBeSearched(pairs[i]) && !JoinPair(pairs[i])) return false;  // Others may have been joined meanwhile.
    }
    for (SessionMap& map : maps_) map.ForgetPlaces();
    Done(kShareOfPlaces);
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
    const auto places =
        AgreeingPlaces(a, maps_[a], b, maps_[b], options_.loop, search_ != SiteSearch::kAll, Asked(), book_);
    if (!go_on_(done_)) return false;
    if (places.empty()) return true;
    const SiteGraph before = graph_;
    if (!Try(a, b, places)) return false;
    const auto found = SearchNearby(a, b, TiesOf(a, b));
    if (!go_on_(done_) || !Try(a, b, found)) return false;
    if (!IsTrusted(a, b)) TakeBack(before);
    return true;
  }

  // Relations between all sessions that lie in one frame, searched anew along the solved paths.
  bool Refine() {
    auto relations_before = static_cast<double>(began_with_);
    std::vector<SessionRelation> solved_with;
    distrusts_ = false;
    for (int round = 0; round < kRounds; ++round) {
      Done(kShareOfPlaces + (1.0 - kShareOfPlaces) * round / kRounds);
      std::vector<SessionRelation> all;
      const std::vector<Pair> pairs = Pairs();
      for (const auto& [a, b] : pairs) {
        if (!graph_.Together(a, b)) continue;
        const auto found = SearchNearby(a, b, TiesOf(a, b));
        if (!go_on_(done_)) return false;
        all.insert(all.end(), found.begin(), found.end());
      }
      // The paths that were solved with these relations show the same ones again: another round would change nothing.
      if (round > 0 && all == solved_with) break;
      for (const auto& [a, b] : pairs) graph_.RemoveBetween(a, b);
      graph_.Add(all);
      solved_with = std::move(all);
      if (!SolveAndWithdraw()) return false;
      bool removed = false;
      for (const auto& [a, b] : pairs) {
        if (RelationsBetween(a, b) == 0 || IsTrusted(a, b)) continue;
        graph_.RemoveBetween(a, b);
        removed = true;
      }
      distrusts_ = distrusts_ || removed;
      if (removed && !Solve()) return false;
      const auto relations_now = static_cast<double>(graph_.relations().size());
      if (relations_now <= kEnoughMore * relations_before) break;
      relations_before = relations_now;
    }
    return true;
  }

  // Sessions that jobs have joined may lie at a wrong place (rival_places.h).
  bool LookForRivals() {
    std::size_t searches = kRivalSearches;
    auto pairs = Pairs();
    std::erase_if(pairs, [this](const Pair& pair) { return told_[pair.a] && told_[pair.b]; });
    // The searches do not suffice for all. What the book has grown by since the last job decides who is the first.
    if (!pairs.empty())
      std::rotate(pairs.begin(), pairs.begin() + static_cast<int>(book_.size() % pairs.size()), pairs.end());
    bool moved = false;
    for (const Pair& pair : pairs) {
      if (!graph_.Together(pair.a, pair.b) || ContradictingShare({&pair, 1}) < kContradicted) continue;
      const std::size_t before = book_.measured();
      const auto rivals = RivalsOf(graph_, maps_, pair.a, pair.b, searches, options_.loop, Asked(), book_);
      if (!go_on_(done_)) return false;
      searches -= std::min(searches, book_.measured() - before);
      if (rivals.empty()) continue;
      const auto outvote = OutvotePresent(pair, rivals);
      if (!outvote) return false;
      moved = moved || *outvote;
    }
    for (SessionMap& map : maps_) map.ForgetPlaces();
    return !moved || Refine();
  }

  // Moves what has to be moved so that two sessions lie as these relations between them say, if scans contradict how
  // they lie now, and this explains more and is contradicted less. Whether it did so; nothing: cancelled.
  std::optional<bool> OutvotePresent(const Pair& pair, std::span<const SessionRelation> rivals) {
    const WeakestCut cut = WeakestCutBetween(graph_, pair.a, pair.b, told_);
    std::vector<Pair> across = Pairs();
    std::erase_if(across, [&cut](const Pair& one) { return cut.moves[one.a] == cut.moves[one.b]; });
    const double contradicting = ContradictingShare(across);
    if (contradicting < kContradicted) return false;
    const SiteGraph before = graph_;
    for (const auto& [a, b] : across) graph_.RemoveBetween(a, b);
    if (!Solve()) return std::nullopt;
    graph_.Add(rivals);
    if (!SolveAndWithdraw()) return std::nullopt;
    RelationBook aside;  // What holds now has to stay in the book if this does not.
    std::vector<SessionRelation> all;
    for (const auto& [a, b] : across) {
      if (!graph_.Together(a, b)) continue;
      const auto found = SearchNearby(a, b, TiesOf(a, b), &aside);
      if (!go_on_(done_)) return std::nullopt;
      all.insert(all.end(), found.begin(), found.end());
    }
    for (const auto& [a, b] : across) graph_.RemoveBetween(a, b);
    graph_.Add(all);
    if (!SolveAndWithdraw()) return std::nullopt;
    std::size_t squares = 0;
    for (const auto& [a, b] : across) squares += IsTrusted(a, b) ? ExplainedSquares(graph_, a, b) : 0;
    const double contradicts = ContradictingShare(across);
    const bool better = contradicts < kMuchLess * contradicting && squares > cut.squares;
    if (better && graph_.Together(pair.a, pair.b)) return true;
    TakeBack(before);
    return false;
  }

  // Of what sessions of these pairs have both seen.
  [[nodiscard]] double ContradictingShare(std::span<const Pair> pairs) {
    VisibilityCounts all;
    for (const auto& [a, b] : pairs)
      if (graph_.Together(a, b)) all += AgreementBetween(a, b).counts;
    return all.known() == 0 ? 0.0 : static_cast<double>(all.contradicted) / all.known();
  }

  // Whether no two sessions in one frame contradict each other, also those that are related through others only.
  [[nodiscard]] bool FitsAllTogether() {
    return std::ranges::all_of(Pairs(), [this](const Pair& pair) {
      return !graph_.Together(pair.a, pair.b) || !Contradicts(AgreementBetween(pair.a, pair.b));
    });
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
      if (!Solve()) return false;
      if (graph_.WithdrawOutvoted() == 0) return true;
    }
    return Solve();
  }

  void TakeBack(const SiteGraph& before) {
    graph_ = before;
    agreements_.clear();
  }

  bool Solve() {
    agreements_.clear();
    return graph_.Solve(Asked());
  }

  [[nodiscard]] std::size_t RelationsBetween(std::size_t a, std::size_t b) const {
    return static_cast<std::size_t>(std::ranges::count_if(graph_.relations(), [a, b](const SessionRelation& one) {
      return one.from.session == a && one.to.session == b;
    }));
  }

  // Along the paths as they were solved last: of each pair it is asked for again and again.
  [[nodiscard]] const SessionAgreement& AgreementBetween(std::size_t a, std::size_t b) {
    const auto [known, added] = agreements_.try_emplace({a, b});
    if (added) {
      const PosePath path_a = AsPosePath(graph_.path(a)), path_b = AsPosePath(graph_.path(b));
      known->second = AgreementOf({a, maps_[a], path_a}, {b, maps_[b], path_b}, options_);
    }
    return known->second;
  }

  // Whether the relations between two sessions may bend the map.
  [[nodiscard]] bool IsTrusted(std::size_t a, std::size_t b) {
    if (RelationsBetween(a, b) < kMinRelations) return false;
    const SessionAgreement& agreement = AgreementBetween(a, b);
    return agreement.places >= kMinComparedPlaces && !Contradicts(agreement);
  }

  // `aside`: a book for what is not to be noted in that of the site.
  [[nodiscard]] std::vector<SessionRelation> SearchNearby(std::size_t a, std::size_t b, std::span<const Tie> ties,
                                                          RelationBook* aside = nullptr) {
    const PosePath path_a = AsPosePath(graph_.path(a)), path_b = AsPosePath(graph_.path(b));
    RelationBook& book = aside == nullptr ? book_ : *aside;
    return FindRelationsNearby({a, maps_[a], path_a}, {b, maps_[b], path_b}, ties, options_, Asked(), book);
  }

  [[nodiscard]] std::vector<Tie> TiesOf(std::size_t a, std::size_t b) const {
    return TiesBetween(graph_, a, b, options_.loop.max_doubt_m);
  }

  static constexpr double kShareOfPlaces = 0.5;  // Of the work.

  std::deque<SessionMap>& maps_;
  SiteGraph graph_;
  const std::vector<bool> told_;
  const SiteOptions& options_;
  const SiteSearch search_;
  const std::function<bool(double)>& go_on_;
  RelationBook& book_;
  std::map<std::pair<std::size_t, std::size_t>, SessionAgreement> agreements_;
  std::size_t began_with_ = 0;  // Relations that were believed before.
  bool distrusts_ = false;      // The last Refine has removed the relations of a pair.
  double done_ = 0.0;
};

}  // namespace

std::optional<std::vector<SmoothedSession>> SmoothSessions(std::span<const SiteSession> sessions,
                                                           const SiteOptions& options,
                                                           const std::function<bool(double)>& go_on, SiteSearch search,
                                                           RelationBook* book) {
  RelationBook own_book;
  std::deque<SessionMap> maps;
  std::vector<const SessionMap*> known;
  std::vector<bool> start_known, told;
  for (const SiteSession& session : sessions) {
    auto own_path = SmoothedPath(session.snapshot, [&go_on] { return go_on(0.0); });
    if (!own_path) return std::nullopt;
    const std::uint64_t id = book == nullptr ? maps.size() + 1 : session.id;
    known.push_back(&maps.emplace_back(id, session.snapshot, *std::move(own_path), options));
    start_known.push_back(session.start_known);
    told.push_back(session.start_known && !session.start_found);
  }
  Smoothing smoothing(maps, SiteGraph(known, std::move(start_known), options.pose_graph), std::move(told), options,
                      search, go_on, book == nullptr ? own_book : *book);
  if (options.pose_graph.enabled && !smoothing.Run()) return std::nullopt;
  std::vector<SmoothedSession> results;
  for (std::size_t s = 0; s < maps.size(); ++s) results.push_back(smoothing.ResultOf(s));
  if (search != SiteSearch::kRobots) return results;
  std::vector<PosePath> online(maps.size());
  for (std::size_t s = 0; s < maps.size(); ++s) online[s] = AsPosePath(sessions[s].snapshot.online_path);
  for (std::size_t s = 0; s < maps.size(); ++s) results[s].agreement_before = smoothing.AgreementBefore(s, online);
  return results;
}

}  // namespace cairn::slam
