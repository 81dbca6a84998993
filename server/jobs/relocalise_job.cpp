#include "server/jobs/relocalise_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <memory>
#include <numeric>
#include <thread>
#include <utility>
#include <vector>

#include "server/maps/localising_tiles.h"
#include "server/slam/loops/unique_pose.h"
#include "server/slam/site/session_map.h"
#include "server/slam/smoothing/smoothed_map.h"

namespace cairn::server {
namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kPublishWithin = std::chrono::seconds(2);
// A waiting job checks this often whether it was cancelled or its time has passed.
constexpr auto kLookAgain = std::chrono::milliseconds(50);
// So long a robot that was lost just now may take to send its next scan.
constexpr auto kFirstScan = std::chrono::seconds(2);
// The robot gets the map around the place that was found: as far as lidars see, from all of the last metres.
constexpr double kMapAroundM = 50.0;
// Shares of the progress.
constexpr double kCollected = 0.1;
constexpr double kSearched = 0.9;

// A robot that is joined where somebody says that it is: what it has seen may contradict the map as little as where a
// job joins robots by itself (slam/site).
constexpr double kCompareEveryM = 1.0;
constexpr int kMinComparedPoints = 20;
constexpr double kMaxContradictingShare = 0.10;
constexpr double kBadPlaceShare = 1.0 / 3.0;
constexpr double kMaxBadPlacesShare = 0.15;

std::string TextOf(const Pose2& pose) {
  return fmt::format("x {:.2f} m, y {:.2f} m, {:.0f} deg", pose.x, pose.y, pose.theta * 180.0 / kPi);
}

std::string SecondBest(const slam::RankedPlaces& ranked) {
  if (ranked.places.size() < 2) return "no other place has half of its score";
  return fmt::format("the second best place has {:.0f} % of its score", 100.0 * ranked.ambiguity());
}

std::string MessageAbout(const std::string& robot, const slam::RankedPlaces& ranked, double max_rival) {
  const std::string not_changed = "nothing was changed";
  if (ranked.places.empty() && ranked.complete)
    return robot + " was found nowhere: no place of the map explains what it sees; " + not_changed;
  if (!ranked.found && !ranked.complete)
    return robot + " was not found, because the search had to be given up; " + not_changed;
  const std::string best = TextOf(ranked.places.front().T_map_robot) + " (" + SecondBest(ranked) + ")";
  if (ranked.found) return robot + " was found at " + best;
  if (ranked.ambiguity() >= max_rival)
    return fmt::format(
        "{} may be at {} places, the best one is {}: {}; `cairn robot relocalise {} --here x,y,theta` decides", robot,
        ranked.places.size(), best, not_changed, robot);
  return robot + " may be at " + best + ", but not all that it sees agrees with the map there: " + not_changed;
}

// The last metres of a robot that is not lost in its own map.
std::vector<slam::RecentScan> LastScans(const slam::MapperSnapshot& snapshot, const slam::SiteOptions& options) {
  if (snapshot.keyframes.empty() || snapshot.online_path.size() != snapshot.keyframes.size()) return {};
  const slam::SessionMap seen(0, snapshot, snapshot.online_path, options);
  return seen.ScansAround(seen.size() - 1, slam::kStretchM);
}

// Whether what was seen along the path contradicts the map.
bool Contradicts(const slam::SessionMap& seen, const std::vector<Pose2>& path, const slam::SearchedMap& map) {
  slam::VisibilityCounts all;
  std::size_t places = 0, bad = 0;
  double next_m = 0.0;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    if (seen.travelled_m(k) < next_m || !seen.localized(k)) continue;
    next_m = seen.travelled_m(k) + kCompareEveryM;
    const auto counts = map.Compare(*seen.trail().keyframes()[k].scan, *seen.trail().points(k), path[k]);
    if (counts.known() < kMinComparedPoints) continue;
    all += counts;
    ++places;
    bad += counts.contradicted > kBadPlaceShare * counts.known() ? 1 : 0;
  }
  return all.contradicted > kMaxContradictingShare * all.known() ||
         static_cast<double>(bad) > kMaxBadPlacesShare * static_cast<double>(places);
}

tl::unexpected<Status> Cancelled() {
  return Fail(StatusCode::kCancelled, "cancelled");
}

// What robots have drawn since the last publication belongs to the map in which the robot is looked for.
void PublishNow(Site& site) {
  const auto done = std::make_shared<std::promise<void>>();
  const auto published = done->get_future();
  site.Publish();
  site.Probe([done] { done->set_value(); });
  static_cast<void>(published.wait_for(kPublishWithin));
}

}  // namespace

Result<LookedFor> LookForRobot(const std::string& robot, std::span<const slam::RecentScan> scans,
                               const slam::SearchedMap& map, const slam::SiteOptions& options,
                               const JobControl& control, const std::optional<Pose2>& T_map_said) {
  if (scans.empty())
    return Fail(StatusCode::kFailedPrecondition, robot + " has sent no scan by which it could be looked for");
  slam::PlaceSearch search(options.place, options.loop, options.self_check, options.align);
  if (T_map_said) {
    if (const auto near = search.FindNear(map, scans, *T_map_said)) {
      LookedFor looked{.outcome = {.message = robot + " was found where somebody said: " + TextOf(near->T_map_robot)},
                       .found = near};
      looked.outcome.places = {{scans.back().scan->stamp, near->T_map_robot, 1.0}};
      return looked;
    }
  }
  std::size_t searches = 0;
  const auto go_on = [&] {
    const double share = static_cast<double>(searches++) / static_cast<double>(kMostHypotheses + 1);
    control.Progress(kCollected + (kSearched - kCollected) * std::min(1.0, share));
    return !control.cancelled();
  };
  const slam::RankedPlaces ranked = search.Rank(map, scans, kMostHypotheses, go_on);
  if (control.cancelled()) return Cancelled();
  LookedFor looked{.outcome = {}, .found = ranked.found};
  looked.outcome.message = MessageAbout(robot, ranked, options.loop.max_rival);
  const double sum = std::accumulate(ranked.places.begin(), ranked.places.end(), 0.0,
                                     [](double total, const auto& one) { return total + one.score; });
  for (const slam::RankedPlaces::Place& one : ranked.places)
    looked.outcome.places.push_back({scans.back().scan->stamp, one.T_map_robot, one.score / sum});
  return looked;
}

Result<JobOutcome> RelocaliseJob::Run(const Job& job, const JobControl& control) const {
  const auto session = roster_.FindOrFail(job.robot);
  if (!session) return tl::unexpected(session.error());
  const auto site = atlas_.Find(job.site);
  if (site == nullptr || (*session)->record().state().site != job.site)
    return Fail(StatusCode::kNotFound, "robot '" + job.robot + "' is not in the site '" + job.site + "' any more");
  const auto material = Collect(**session, control);
  if (!material) return tl::unexpected(material.error());
  PublishNow(*site);
  const auto map = MapOf(*site);
  if (!map) return tl::unexpected(map.error());
  if (!job.places.empty()) return JoinWhereSaid(job, *material, *map, control);

  const bool fragment = !material->start_known;
  if (!material->lost.lost && !fragment)
    return JobOutcome{.message = job.robot + " is not lost any more: nothing was changed"};
  const auto scans = material->lost.lost ? material->lost.scans : LastScans(material->snapshot, site_);
  // A fragment has a frame of its own.
  const auto T_map_said = fragment ? std::nullopt : material->lost.T_map_said;
  auto looked = LookForRobot(job.robot, scans, *map->grid, site_, control, T_map_said);
  if (!looked) return tl::unexpected(looked.error());
  PlaceFound found{.place = std::nullopt, .places = looked->outcome.places};
  if (looked->found) {
    const Pose2& T_map_robot = looked->found->T_map_robot;
    found.place = PlaceSuggested{scans.back().scan->stamp, T_map_robot, map->tiles};
    found.place->map.tiles =
        TilesNear(map->tiles.tiles, map->tiles.resolution_m, T_map_robot.translation(), kMapAroundM);
    found.map = KnownGridOf(found.place->map.tiles, map->tiles.resolution_m, map->tiles.epoch, material->place_search,
                            material->near_m);
  }
  const auto taken = Tell(**session, std::move(found), control);
  if (!taken) return tl::unexpected(taken.error());
  std::string& message = looked->outcome.message;
  if (!looked->found) return std::move(looked->outcome);
  if (*taken) {
    message += ": its next scans have to confirm it";
  } else if (fragment) {
    message += ": nothing was changed, because it is not joined with the map of its site; `cairn robot relocalise " +
               job.robot + " --here x,y,theta` joins it";
  } else if ((*session)->record().localises()) {
    message += ": nothing was changed, because it is only localised and looks for itself in this map";
  } else if ((*session)->record().phase() != SessionPhase::kActive) {
    message += ": nothing was changed, because it is not connected, and its next scans would have to confirm it";
  } else {
    message +=
        ": nothing was changed, because it has sent no scan, was found or lost anew, has itself found another place, "
        "or has got a new map meanwhile";
  }
  return std::move(looked->outcome);
}

Result<RelocaliseJob::SiteMap> RelocaliseJob::MapOf(const Site& site) const {
  const auto snapshot = site.snapshot();
  const MapInfo& info = snapshot->info;
  SiteMap map{{false, TilesToLocaliseIn(*snapshot), info.resolution_m, info.epoch}, nullptr};
  map.grid = KnownGridOf(map.tiles.tiles, info.resolution_m, info.epoch, site_.place, site_.self_check.near_m,
                         &roster_.known_grids());
  if (map.grid == nullptr)
    return Fail(StatusCode::kFailedPrecondition, "the map of site '" + info.site + "' is too large for a search");
  if (map.grid->Index()->surfaces.empty())
    return Fail(StatusCode::kFailedPrecondition, "site '" + info.site + "' has no map in which a robot can be found");
  return map;
}

// A robot that was lost just now may not have sent a scan since.
Result<SessionMaterial> RelocaliseJob::Collect(Session& session, const JobControl& control) const {
  const auto begin = Clock::now();
  for (;;) {
    auto material = AskForMaterial(session, control);
    if (!material) return material;
    const bool waits = material->lost.lost && !material->lost.since_lost &&
                       session.record().phase() == SessionPhase::kActive && Clock::now() - begin < kFirstScan;
    if (!waits) return material;
    std::this_thread::sleep_for(kLookAgain);
  }
}

Result<SessionMaterial> RelocaliseJob::AskForMaterial(Session& session, const JobControl& control) const {
  const auto answers = std::make_shared<BoundedChannel<SessionMaterial>>(1);
  const auto answer = [answers](SessionMaterial&& material) {
    static_cast<void>(answers->TryPush(std::move(material)));
  };
  // If the session's queue is full, it does not answer, and the job fails at the deadline.
  static_cast<void>(session.Post(SnapshotWanted{answer}));
  return WaitFor(*answers, control);
}

Result<bool> RelocaliseJob::Tell(Session& session, PlaceFound&& found, const JobControl& control) const {
  const auto answers = std::make_shared<BoundedChannel<bool>>(1);
  found.done = [answers](bool taken) { static_cast<void>(answers->TryPush(bool{taken})); };
  static_cast<void>(session.Post(std::move(found)));
  return WaitFor(*answers, control);
}

template <typename Answer>
Result<Answer> RelocaliseJob::WaitFor(BoundedChannel<Answer>& answers, const JobControl& control) const {
  const auto deadline = Clock::now() + std::chrono::duration<double>(options_.snapshot_timeout_s);
  for (;;) {
    if (control.cancelled()) return Cancelled();
    if (auto answer = answers.PopFor(kLookAgain)) return *std::move(answer);
    if (Clock::now() > deadline)
      return Fail(StatusCode::kDeadlineExceeded, "the robot did not answer in time (jobs.snapshot_timeout_s)");
  }
}

Result<JobOutcome> RelocaliseJob::JoinWhereSaid(const Job& job, const SessionMaterial& material, const SiteMap& map,
                                                const JobControl& control) const {
  const auto refuse = [&job](const std::string& why) {
    return Fail(StatusCode::kFailedPrecondition, "nothing was changed: " + job.robot + " " + why);
  };
  if (material.start_known) return refuse("is joined with the map of its site already");
  if (!material.joinable)
    return refuse("is run with a filter that cannot continue in a map in which a job has found it");
  if (material.lost.lost) return refuse("is lost in what it has mapped itself, and has to be found there first");
  const slam::MapperSnapshot& snapshot = material.snapshot;
  const auto scans = LastScans(snapshot, site_);
  if (scans.empty()) return refuse("has sent no scan by which it could be joined");
  slam::PlaceSearch search(site_.place, site_.loop, site_.self_check, site_.align);
  const auto place = search.FindNear(*map.grid, scans, job.places.front().T_map_robot);
  if (!place) return refuse("does not see what the map shows near the pose given, or the map shows too little there");

  const Pose2 T_map_own = place->T_map_robot * scans.back().T_track_robot.Inverse();
  std::vector<Pose2> path;
  for (const Pose2& T_own_robot : snapshot.online_path) path.push_back(T_map_own * T_own_robot);
  if (Contradicts(slam::SessionMap(0, snapshot, snapshot.online_path, site_), path, *map.grid))
    return refuse("would contradict the map elsewhere, with what it has seen before");
  std::size_t steps = 0;
  const double all = static_cast<double>(std::max<std::size_t>(1, slam::SmoothingSteps(snapshot, true)));
  auto drawn = slam::MapAlong(snapshot, std::move(path), material.grid_options, [&] {
    control.Progress(kCollected + (kSearched - kCollected) * std::min(1.0, static_cast<double>(steps++) / all));
    return !control.cancelled();
  });
  if (!drawn) return Cancelled();

  JobOutcome outcome{.message = job.robot + " was joined at " + TextOf(place->T_map_robot)};
  outcome.places = {{scans.back().scan->stamp, place->T_map_robot, 1.0}};
  MapVersion version;
  version.info.job = job.id;
  version.info.note = "joined where somebody said: " + job.robot;
  version.parts[material.session] = {.chunks = drawn->grid.Share(),
                                     .keyframes = snapshot.made(),
                                     .path = std::make_shared<const std::vector<Pose2>>(std::move(drawn->path)),
                                     .numbers = std::make_shared<const std::vector<std::uint64_t>>(snapshot.numbers)};
  const auto site = atlas_.Find(job.site);
  if (site == nullptr || site->snapshot()->info.epoch != map.tiles.epoch)
    return Fail(StatusCode::kAborted, "the map has changed meanwhile: nothing was changed; try again");
  const auto number = smooth_.Await(job.site, control, [&](Site& to, Site::Done done, Site::Wanted wanted) {
    to.AddVersion(std::move(version), std::move(done), std::move(wanted));
  });
  if (!number) return tl::unexpected(number.error());
  outcome.map_version = *number;
  const auto enabled = smooth_.Await(job.site, control, [&](Site& to, Site::Done done, Site::Wanted wanted) {
    to.Enable(*number, std::move(done), std::move(wanted), Site::EnabledBy::kSaid);
  });
  if (!enabled) return tl::unexpected(enabled.error());
  return outcome;
}

}  // namespace cairn::server
