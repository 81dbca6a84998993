// cairn-study correction: the graph of a site has been solved, and its keyframes have moved. How long is it until the
// last of eight robots has been told, and until the map has changed as a whole; and how long do their scans wait
// meanwhile, which go on arriving as fast as robots send them? And do a robot's pose, its path and the tiles of the map
// then agree? Through the sessions and the site of the server, without
// the middleware. Times are wall-clock times, so no other program should run on the machine. --only: a number of
// keyframes instead of 10,000, of all robots together.
#include <algorithm>
#include <asio/thread_pool.hpp>
#include <atomic>
#include <chrono>
#include <future>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "common/map/occupancy_image.h"
#include "common/mutex.h"
#include "server/maps/site.h"
#include "server/robots/session.h"
#include "tests/studies/correction/told_places.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

using Clock = std::chrono::steady_clock;
using Site = server::Site;

constexpr int kRobots = 8;
constexpr double kMostToldS = 1.0;
constexpr double kMostMoveM = 0.3;         // So far is looked for what fits better.
constexpr std::size_t kCompareEvery = 10;  // Keyframes.

double SecondsBetween(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

sim::Fleet MakeFleet(std::uint64_t seed) {
  auto place = sim::OpenSurroundings("storey");
  if (!place) throw std::invalid_argument(place.error().message);
  sim::FleetOptions options;
  options.robots = kRobots;
  options.scan_hz = 5.0;
  options.seed = seed;
  auto fleet = sim::Fleet::Create(*std::move(place), options);
  if (!fleet) throw std::invalid_argument(fleet.error().message);
  return std::move(*fleet);
}

// A session, which stands between the site and itself to see when it has been told. Thread rule: any thread.
class ToldRobot : public server::GridOwner {
 public:
  ToldRobot(int number, const std::string& name, const Pose2& start, const slam::MapperOptions& options,
            asio::thread_pool& pool, const std::shared_ptr<Site>& site)
      : name_(name), token_(static_cast<ClientId>(number) + 1) {
    server::EstimatorSetup estimator;
    estimator.mapper = options;
    estimator.T_map_robot_start = start;
    SessionRequest request;
    request.robot = name;
    request.site = "study";
    request.sensors = {"laser"};
    request.client = request.session = token_;
    server::SessionSetup setup;
    setup.id = static_cast<server::SessionId>(number) + 1;
    setup.request = request;
    setup.estimator = estimator;
    server::SessionOutputs outputs;
    outputs.send = [this](const server::OutboundValue& value) {
      if (const auto* const pose = std::get_if<PoseReport>(&value)) Posed(pose->scan_sequence);
      return true;
    };
    outputs.grid_changed = [site](server::GridChange&& change) { site->Change(std::move(change)); };
    session_ = std::make_shared<server::Session>(setup, server::RobotsOptions{}, pool, std::move(outputs));
    if (!session_->record().AddSensors(request.sensors)) throw std::logic_error("a session takes one laser");
  }

  void SetMapEpoch(std::uint32_t epoch) override { session_->SetMapEpoch(epoch); }
  void Adopt(server::Correction&& correction) override {
    correction.done = [this, done = std::move(correction.done)](server::Adopted&& adopted) {
      told_ = Clock::now();
      done(std::move(adopted));
    };
    session_->Adopt(std::move(correction));
  }
  [[nodiscard]] Clock::time_point told() const { return told_; }

  void Take(LogRecord&& record) {
    if (auto* const odometry = std::get_if<Odometry>(&record)) {
      session_->Take(server::OdometryArrival{{HashName(name_), HashName("odometry"), token_}, *odometry, false});
      return;
    }
    auto scan = std::make_shared<const Scan>(std::get<Scan>(std::move(record)));
    const Clock::time_point now = Clock::now();
    {
      const MutexLock lock(mutex_);
      sent_.emplace(scan->sequence, now);
    }
    static_cast<void>(session_->Take(
        server::ScanArrival{{HashName(name_), HashName("laser"), token_}, std::move(scan), std::nullopt, now}));
  }
  // Waits until few of its scans wait.
  void AwaitFew() const {
    while (Waiting() > 16) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  // The longest time from a scan to its pose since the last call, in ms.
  [[nodiscard]] double TakeLongestMs() {
    const MutexLock lock(mutex_);
    return 1e3 * std::exchange(longest_s_, 0.0);
  }
  [[nodiscard]] std::uint64_t keyframes() const {
    return session_->record().snapshot().status.ledgers.front().keyframes;
  }
  [[nodiscard]] slam::MapperSnapshot Snapshot() const {
    std::promise<slam::MapperSnapshot> taken;
    const bool asked = session_->Post(server::SnapshotWanted{
        [&taken](server::SessionMaterial&& material) { taken.set_value(std::move(material.snapshot)); }});
    if (!asked) throw std::runtime_error("a session has no room for a question");
    return taken.get_future().get();
  }
  [[nodiscard]] server::SessionId id() const { return session_->id(); }
  [[nodiscard]] PoseReport pose() const { return session_->record().snapshot().status.pose; }

 private:
  void Posed(std::uint64_t sequence) {
    const MutexLock lock(mutex_);
    const auto sent = sent_.find(sequence);
    if (sent == sent_.end()) return;
    longest_s_ = std::max(longest_s_, SecondsBetween(sent->second, Clock::now()));
    sent_.erase(sent_.begin(), std::next(sent));  // Also those that were dropped before.
  }
  [[nodiscard]] std::size_t Waiting() const {
    const MutexLock lock(mutex_);
    return sent_.size();
  }

  const std::string name_;
  const SessionToken token_;
  std::shared_ptr<server::Session> session_;
  std::atomic<Clock::time_point> told_{};
  mutable Mutex mutex_;
  std::map<std::uint64_t, Clock::time_point> sent_ CAIRN_GUARDED_BY(mutex_);  // Scans without a pose yet.
  double longest_s_ CAIRN_GUARDED_BY(mutex_) = 0.0;
};

using Robots = std::vector<std::shared_ptr<ToldRobot>>;

// Waits for what the sessions still do, before those to whom they report are gone.
struct AwaitPool {
  explicit AwaitPool(asio::thread_pool& threads) : pool(threads) {}
  AwaitPool(const AwaitPool&) = delete;
  AwaitPool& operator=(const AwaitPool&) = delete;
  ~AwaitPool() { pool.join(); }

  asio::thread_pool& pool;
};

// What the solver returns: in place of a smoothed graph the true poses, moved a little, so that it shows where tiles
// and paths lie beside each other, and not where the drives of several robots do.
std::vector<std::vector<Pose2>> Solved(const std::vector<slam::MapperSnapshot>& snapshots, const sim::Fleet& fleet) {
  const Pose2 T_moved_map{0.1, -0.05, 0.0};
  std::vector<std::vector<Pose2>> paths;
  for (std::size_t i = 0; i < snapshots.size(); ++i) {
    std::vector<Pose2>& path = paths.emplace_back();
    path.reserve(snapshots[i].keyframes.size());
    const Trajectory& truth = fleet.truth(static_cast<int>(i));
    for (const auto& keyframe : snapshots[i].keyframes) {
      const auto T_map_true = PoseOn(truth, keyframe.scan.stamp(), 1.0);
      if (!T_map_true) throw std::runtime_error("a keyframe has no true pose");
      path.push_back(T_moved_map * *T_map_true);
    }
  }
  return paths;
}

struct Times {
  double drawn_s = 0.0, told_s = 0.0, switched_s = 0.0;
};

// What a job does from the solved graph on.
Times Correct(const std::vector<slam::MapperSnapshot>& snapshots, const std::vector<std::vector<Pose2>>& paths,
              const Robots& robots, Site& site, const slam::GridOptions& options) {
  const Clock::time_point solved = Clock::now();
  server::MapVersion version;
  for (std::size_t i = 0; i < robots.size(); ++i) {
    slam::OccupancyGrid grid(options);
    for (std::size_t k = 0; k < paths[i].size(); ++k)
      if (snapshots[i].keyframes[k].localized) grid.Draw(*snapshots[i].keyframes[k].scan, paths[i][k]);
    server::RobotGrid part;
    part.chunks = grid.Share();
    part.keyframes = snapshots[i].made();
    part.path = std::make_shared<const std::vector<Pose2>>(paths[i]);
    part.numbers = std::make_shared<const std::vector<std::uint64_t>>(snapshots[i].numbers);
    version.parts.emplace(robots[i]->id(), std::move(part));
  }
  Times times;
  times.drawn_s = SecondsBetween(solved, Clock::now());
  std::promise<Result<std::uint32_t>> added, enabled;
  site.AddVersion(std::move(version), [&](Result<std::uint32_t> number) { added.set_value(std::move(number)); });
  const auto number = added.get_future().get();
  if (!number) throw std::runtime_error(number.error().message);
  site.Enable(*number, [&](Result<std::uint32_t> result) { enabled.set_value(std::move(result)); });
  const auto result = enabled.get_future().get();
  if (!result) throw std::runtime_error(result.error().message);
  times.switched_s = SecondsBetween(solved, Clock::now());
  for (const auto& robot : robots) times.told_s = std::max(times.told_s, SecondsBetween(solved, robot->told()));
  return times;
}

// Hands on what the fleet sends, as fast as it drives, until `ended` says so. The map is published twice a second.
template <typename Ended>
void Stream(sim::Fleet& fleet, const Robots& robots, Site& site, const Ended& ended) {
  const auto stamp_of = [](const LogRecord& record) {
    return std::visit([](const auto& one) { return one.stamp; }, record);
  };
  sim::FleetRecord next = fleet.Next();
  const Stamp first = stamp_of(next.record);
  const Clock::time_point begin = Clock::now();
  Clock::time_point published = begin;
  while (!ended(SecondsBetween(begin, Clock::now()))) {
    std::this_thread::sleep_until(begin + std::chrono::nanoseconds(stamp_of(next.record) - first));
    robots[static_cast<std::size_t>(next.robot)]->Take(std::move(next.record));
    next = fleet.Next();
    if (Clock::now() - published < std::chrono::milliseconds(500)) continue;
    published = Clock::now();
    site.Publish();
  }
}

double LongestMs(const Robots& robots) {
  double longest_ms = 0.0;
  for (const auto& robot : robots) longest_ms = std::max(longest_ms, robot->TakeLongestMs());
  return longest_ms;
}

OccupancyImage MapOf(Site& site, std::uint32_t& epoch) {
  std::promise<void> published;
  site.Publish([&published] { published.set_value(); });
  published.get_future().wait();
  const auto snapshot = site.snapshot();
  epoch = snapshot->info.epoch;
  std::vector<Tile> tiles;
  snapshot->tiles.ForEach(0, [&tiles](const server::TileSet::TilePtr& tile) { tiles.push_back(*tile); });
  auto image = AssembleTiles(tiles, snapshot->info.resolution_m);
  if (!image) throw std::runtime_error(image.error().message);
  return *std::move(image);
}

struct Agreement {
  double pose_m = 0.0, path_m = 0.0;  // How far scans lie beside the tiles: the last ones, and those along the paths.
  double old_path_m = 0.0;            // The same of the paths before the correction.
  int epochs = 0;                     // Poses of another epoch than the tiles.
};

// What the robots are told now, beside the tiles that are published now. The robots send nothing meanwhile.
Agreement Compare(const std::vector<slam::MapperSnapshot>& before, const Robots& robots, Site& site) {
  // Each answers after all that it was sent.
  std::vector<slam::MapperSnapshot> snapshots;
  snapshots.reserve(robots.size());
  for (const auto& robot : robots) snapshots.push_back(robot->Snapshot());
  std::uint32_t epoch = 0;
  const OccupancyImage map = MapOf(site, epoch);
  Agreement agreement;
  for (std::size_t i = 0; i < robots.size(); ++i) {
    const slam::MapperSnapshot& now = snapshots[i];
    const PoseReport pose = robots[i]->pose();
    if (pose.map_epoch != epoch) ++agreement.epochs;
    std::vector<SeenFrom> along, old, last;
    for (std::size_t k = 0; k < now.keyframes.size(); k += kCompareEvery) {
      if (!now.keyframes[k].localized) continue;
      along.push_back({now.keyframes[k].scan.Share(), now.full_path[k]});
      if (k < before[i].full_path.size()) old.push_back({now.keyframes[k].scan.Share(), before[i].full_path[k]});
    }
    // The last pose belongs to a scan that need not be a keyframe: that of the last keyframe is as far beside it as the
    // path says.
    const Trajectory poses = now.FullTrajectory();
    if (!poses.empty() && !now.keyframes.empty() && poses.back().stamp == pose.stamp) {
      const Pose2 T_last_keyframe = Between(poses.back().T_map_robot, now.full_path.back());
      last.push_back({now.keyframes.back().scan.Share(), pose.T_map_robot * T_last_keyframe});
    }
    agreement.path_m = std::max(agreement.path_m, LargestMove(map, along, kMostMoveM));
    agreement.old_path_m = std::max(agreement.old_path_m, LargestMove(map, old, kMostMoveM));
    agreement.pose_m = std::max(agreement.pose_m, LargestMove(map, last, kMostMoveM));
  }
  return agreement;
}

void Drive(sim::Fleet& fleet, const Robots& robots, Site& site, std::uint64_t keyframes, Report& report) {
  std::uint64_t made = 0, told = 0;
  for (std::size_t records = 0; made < keyframes; ++records) {
    sim::FleetRecord next = fleet.Next();
    const auto& robot = robots[static_cast<std::size_t>(next.robot)];
    robot->Take(std::move(next.record));
    robot->AwaitFew();
    if (records % 5000 != 0) continue;
    site.Publish();
    made = 0;
    for (const auto& one : robots) made += one->keyframes();
    if (made / 2000 > told) report.Progress(Count(static_cast<long long>(made)) + " keyframes");
    told = made / 2000;
  }
}

void StudyCorrection(StudyContext& context) {
  Report& report = context.report;
  slam::MapperOptions options;
  options.seed = static_cast<std::int64_t>(context.seed);
  options.retire.enabled = false;  // All keyframes stay, so that there are so many.
  const std::uint64_t wanted = context.only.empty() ? context.Pick(10000, 400) : std::stoull(context.only);
  sim::Fleet fleet = MakeFleet(context.seed);
  asio::thread_pool pool(2);
  server::Outbound outbound(64);
  outbound.Watch([](const server::OutboundValue&) { return true; });
  const auto site = std::make_shared<Site>("study", options.grid.resolution_m, server::MapsOptions{}, pool, outbound);
  Robots robots;
  const AwaitPool await(pool);
  for (int i = 0; i < kRobots; ++i) {
    robots.push_back(std::make_shared<ToldRobot>(i, fleet.name(i), fleet.T_map_robot_start(i), options, pool, site));
    Site::Member member;
    member.session = robots.back()->id();
    member.robot = HashName(fleet.name(i));
    member.owner = robots.back();
    site->Join(std::move(member));
  }
  Drive(fleet, robots, *site, wanted, report);

  std::vector<slam::MapperSnapshot> snapshots;
  std::size_t keyframes = 0;
  for (const auto& robot : robots) keyframes += snapshots.emplace_back(robot->Snapshot()).full_path.size();
  static_cast<void>(LongestMs(robots));
  Stream(fleet, robots, *site, [](double seconds) { return seconds > 5.0; });
  const double before_ms = LongestMs(robots);
  const std::vector<std::vector<Pose2>> paths = Solved(snapshots, fleet);
  auto correcting =
      std::async(std::launch::async, [&] { return Correct(snapshots, paths, robots, *site, options.grid); });
  Stream(fleet, robots, *site,
         [&](double /*seconds*/) { return correcting.wait_for(std::chrono::seconds(0)) == std::future_status::ready; });
  const Times times = correcting.get();
  Stream(fleet, robots, *site, [](double seconds) { return seconds > 1.0; });
  const double during_ms = LongestMs(robots);
  const Agreement agreement = Compare(snapshots, robots, *site);

  Table table({"keyframes", "robots", "drawn (s)", "all robots told (s)", "map changed (s)",
               "longest from scan to pose before (ms)", "meanwhile (ms)"});
  table.Add({Count(static_cast<long long>(keyframes)), Count(kRobots), Number(times.drawn_s, 2),
             Number(times.told_s, 2), Number(times.switched_s, 2), Number(before_ms, 0), Number(during_ms, 0)});
  report.Text(
      "Times from the solved graph on: all parts of the map have been drawn along it, by one thread; the last robot "
      "has "
      "taken over its path, its past poses and its part of the map; the map of the site has changed as a whole. To be "
      "told within 1 s.");
  report.Add(table, "correction");
  report.Expect(times.told_s <= kMostToldS,
                "the last robot was told " + Number(times.told_s, 2) + " s after the graph was solved");

  Table places(
      {"told beside the tiles, poses (m)", "paths (m)", "paths before the correction (m)", "poses of another epoch"});
  places.Add({Number(agreement.pose_m, 3), Number(agreement.path_m, 3), Number(agreement.old_path_m, 3),
              Count(agreement.epochs)});
  report.Text(
      "How far the walls that a scan sees, at the place that its robot is told, lie beside those that the tiles of the "
      "same epoch show: the shortest move by whole cells with which no other one puts 5 % more of its beams on "
      "occupied cells. The largest of all robots; of every tenth keyframe along the paths. To be one cell at most. The "
      "paths before the correction show that the figure sees a map that has moved by 0.11 m.");
  report.Add(places, "agreement");
  const double cell_m = 1.001 * options.grid.resolution_m;
  report.Expect(agreement.pose_m <= cell_m, "a pose lies beside the tiles by more than a cell");
  report.Expect(agreement.path_m <= cell_m, "a path lies beside the tiles by more than a cell");
  report.Expect(agreement.epochs == 0, "a robot is told a pose of another epoch than that of the tiles");
  report.Expect(agreement.old_path_m > cell_m, "the comparison does not see that the map has moved");
}

const Registration kRegistered{"correction", "a solved graph goes back to the robots: how soon, and what it costs them",
                               StudyCorrection};

}  // namespace
}  // namespace cairn::studies
