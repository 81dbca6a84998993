#include "server/robots/session_estimator.h"

#include <algorithm>
#include <string>
#include <utility>
#include <variant>

#include "server/maps/localising_tiles.h"
#include "server/maps/stored_grid.h"

namespace cairn::server {
namespace {

using Clock = std::chrono::steady_clock;

// How often landmarks are copied for queries: a landmark hardly moves in less time.
constexpr auto kLandmarkPeriod = std::chrono::milliseconds(500);

// A start that is wrong by what a robot drives in about a second is corrected by the match.
constexpr std::uint64_t kMostMissing = 10, kLatestNs = kNanosPerSecond;

PoseReport ReportOf(const Scan& scan, const slam::ScanOutcome& outcome, const SessionState& session, SessionToken token,
                    std::uint32_t epoch, bool fragment) {
  PoseReport report;
  report.robot_id = session.robot_id;
  report.robot = session.robot;
  report.site = session.site;
  report.stamp = scan.stamp;
  report.session = token;
  report.scan_sequence = scan.sequence;
  report.T_map_robot = outcome.T_map_robot;
  report.covariance = outcome.covariance;
  report.T_map_odom = outcome.T_map_odom;
  report.localized = outcome.localized;
  report.score = outcome.score;
  report.reason = outcome.reason;
  if (fragment && report.localized) {
    report.localized = false;
    report.reason = PoseReason::kNotJoined;
  }
  report.map_epoch = epoch;
  return report;
}

std::vector<LandmarkReport> ReportsOf(const std::vector<slam::Landmark>& landmarks, const std::string& robot) {
  std::vector<LandmarkReport> reports;
  reports.reserve(landmarks.size());
  for (const slam::Landmark& landmark : landmarks) {
    reports.push_back({.id = landmark.id,
                       .robot = robot,
                       .corner = landmark.corner,
                       .p_map = landmark.p_map,
                       .direction_rad = landmark.direction_rad,
                       .covariance = landmark.covariance,
                       .sightings = landmark.sightings});
  }
  return reports;
}

}  // namespace

SessionEstimator::SessionEstimator(const EstimatorSetup& setup, SessionRecord& record, SessionOutputs outputs)
    : record_(record),
      outputs_(std::move(outputs)),
      identity_(record.snapshot()),
      epoch_(record.epoch()),
      began_as_fragment_(setup.fragment),
      fragment_(setup.fragment),
      options_(setup.mapper),
      known_grids_(setup.known_grids),
      map_begun_(setup.map_begun),
      pipeline_(setup.mapper, setup.T_map_robot_start, slam::SerialFor,
                {.used = [this](const Scan& scan, const slam::ScanOutcome& outcome) { Used(scan, outcome); },
                 .dropped = [this](const Scan& scan, DropReason reason) { Dropped(scan, reason); }}) {
  TellJoining();
}

void SessionEstimator::Handle(RobotEvent&& event) {
  std::visit([this](auto&& alternative) { On(std::move(alternative)); }, std::move(event));
}

void SessionEstimator::Discard(RobotEvent&& event) {
  if (const auto* const arrival = std::get_if<ScanArrival>(&event)) {
    // A scan that has moved on into the estimator is one of those that wait there.
    if (arrival->scan != nullptr) {
      Store(ScanRefused{arrival->stream, arrival->scan->sequence, DropReason::kSessionEnded});
      record_.ScanDropped(arrival->stream, arrival->scan->sequence, DropReason::kSessionEnded);
    }
  } else if (const auto* const odometry = std::get_if<OdometryArrival>(&event)) {
    record_.OdometryDropped(odometry->stream.session, odometry->odometry.sequence, DropReason::kSessionEnded);
  } else if (auto* const wanted = std::get_if<SnapshotWanted>(&event)) {
    wanted->done({.session = identity_.id,
                  .robot = identity_.status.session.robot,
                  .snapshot = {},
                  .grid_options = pipeline_.mapper().grid().options()});
  } else if (auto* const found = std::get_if<PlaceFound>(&event)) {
    found->done(false);
  } else if (auto* const finish = std::get_if<Finish>(&event)) {
    if (finish->done) finish->done();
  }
}

void SessionEstimator::DropWaiting() {
  for (const auto& [scan, waiting] : waiting_)
    record_.ScanDropped(waiting.stream, waiting.sequence, DropReason::kSessionEnded);
  waiting_.clear();
}

void SessionEstimator::On(ScanArrival&& arrival) {
  if (ended_) return Discard(std::move(arrival));
  if (!first_sequence_ && !record_.begun()) {
    first_sequence_ = arrival.scan->sequence;
    first_stamp_ = arrival.scan->stamp;
  }
  DoubtStartInNewMap(*arrival.scan);  // Journaled before the scan, so that no restart can come between the two.
  Store(ScanTaken{arrival.stream, arrival.scan});
  ComesFrom(arrival.stream.session);
  waiting_.emplace(arrival.scan.get(), Waiting{arrival.stream, arrival.scan->sequence, arrival.received});
  pipeline_.Add(std::move(arrival.scan));
}

void SessionEstimator::On(OdometryArrival&& arrival) {
  if (ended_) return Discard(std::move(arrival));
  Store(OdometryTaken{arrival.stream, arrival.odometry, OdometryUse::kTaken});
  ComesFrom(arrival.stream.session);
  const std::uint64_t refused_before = pipeline_.odometry_refused();
  pipeline_.Add(arrival.odometry);
  const Odometry& odometry = arrival.odometry;
  if (pipeline_.odometry_refused() == refused_before) {
    record_.OdometryUsed(arrival.stream.session, odometry.sequence, odometry.stamp);
  } else {
    record_.OdometryDropped(arrival.stream.session, odometry.sequence, DropReason::kStampWentBack);
  }
}

void SessionEstimator::ComesFrom(SessionToken session) {
  if (std::exchange(session_, session) != session) pipeline_.NewClient();
}

void SessionEstimator::Store(JournalEntry entry) {
  if (replaying_ || !outputs_.store) return;
  static_cast<void>(outputs_.store(std::move(entry)));
}

void SessionEstimator::Used(const Scan& scan, const slam::ScanOutcome& outcome) {
  DoubtLateStart(scan);
  const auto waiting = waiting_.find(&scan);
  const auto known_epoch = pipeline_.mapper().known_map_epoch();
  PoseReport report =
      ReportOf(scan, outcome, identity_.status.session, session_, epoch_, fragment_ && !known_epoch.has_value());
  if (known_epoch && *known_epoch != epoch_ && report.localized) {  // Its pose is one in another map.
    report.localized = false;
    report.reason = PoseReason::kLost;
  }
  if (outcome.keyframe) Drive(outcome.T_map_robot);
  // Before the pose is added, which lies on the new path already.
  if (pipeline_.mapper().path_changed_at() != path_changed_at_) FollowPath({});
  if (suggested_ && !pipeline_.mapper().has_suggestion()) suggested_.reset();  // Its map takes memory.
  if (!replaying_) outputs_.send(report);
  const std::chrono::duration<double, std::milli> latency = Clock::now() - waiting->second.received;
  record_.ScanUsed(waiting->second.stream, report, outcome.stamp, outcome.keyframe, latency.count());
  if (outcome.keyframe) record_.SetLearned(pipeline_.mapper().learned());
  waiting_.erase(waiting);  // Only now: whatever fails before leaves it among those to be dropped.
  if (outcome.keyframe && !replaying_) {
    GridChange change = TakeGridChange();
    if (!change.chunks.empty()) outputs_.grid_changed(std::move(change));
    RefreshLandmarks(false);
  }
  if (!replaying_) RefreshHypotheses(report, known_epoch.has_value());
}

void SessionEstimator::Dropped(const Scan& scan, DropReason reason) {
  const auto waiting = waiting_.find(&scan);
  record_.ScanDropped(waiting->second.stream, scan.sequence, reason);
  waiting_.erase(waiting);
}

GridChange SessionEstimator::TakeGridChange() {
  slam::Mapper& mapper = pipeline_.mapper();
  return {
      .session = identity_.id, .chunks = mapper.TakeGridChange(), .drawn = Drawn(), .looks = mapper.TakeGridLooks()};
}

DrawnPath SessionEstimator::Drawn() const {
  slam::Mapper::DrawnKeyframes drawn = pipeline_.mapper().drawn_keyframes();
  if (drawn.path.empty()) return {};
  return {std::make_shared<const std::vector<Pose2>>(std::move(drawn.path)),
          std::make_shared<const std::vector<std::uint64_t>>(std::move(drawn.numbers))};
}

slam::OccupancyGrid::Chunks SessionEstimator::PublishedChunks() {
  // The changes since the last report must be reported first.
  GridChange change = TakeGridChange();
  if (!change.chunks.empty()) outputs_.grid_changed(std::move(change));
  return pipeline_.mapper().ShareGrid();
}

void SessionEstimator::RefreshLandmarks(bool at_once) {
  const auto now = Clock::now();
  if (!at_once && now - landmarks_refreshed_ < kLandmarkPeriod) return;
  landmarks_refreshed_ = now;
  if (fragment_) return record_.SetLandmarks({});  // They lie in a frame of their own.
  record_.SetLandmarks(ReportsOf(pipeline_.mapper().landmarks(), identity_.status.session.robot));
}

void SessionEstimator::On(Correction&& correction) {
  DrawToTheEnd();
  Store(CorrectionTaken{correction.epoch, correction.generation, ToStored(correction.grid)});
  Adopted adopted{
      .session = identity_.id, .displaced = DisplacedGrid(), .change = {.session = identity_.id, .chunks = {}}};
  const bool changed = AdoptGrid(correction.epoch, correction.grid);
  switch_completed_ = std::move(correction.completed);
  adopted.change = TakeGridChange();
  if (!changed) adopted.change.chunks.assign(adopted.displaced.chunks.begin(), adopted.displaced.chunks.end());
  adopted.fragment = fragment_;
  correction.done(std::move(adopted));
}

void SessionEstimator::On(EpochChange&& change) {
  if (change.epoch == epoch_) return;
  if (!ended_) Store(EpochChanged{change.epoch});
  SetEpoch(change.epoch);
}

void SessionEstimator::SetEpoch(std::uint32_t epoch) {
  if (epoch != epoch_) {  // What a job has found are places in the map before.
    pipeline_.mapper().ForgetSuggestion();
    if (!looked_for_.empty()) record_.SetHypotheses({});
    looked_for_.clear();
  }
  epoch_ = epoch;
  record_.SetEpoch(epoch_);
  const auto known = pipeline_.mapper().known_map_epoch();
  if (known && *known != epoch_) record_.LoseLast();
}

void SessionEstimator::Drive(const Pose2& T_map_robot) {
  if (T_map_keyframe_) driven_m_ += (T_map_robot.translation() - T_map_keyframe_->translation()).norm();
  T_map_keyframe_ = T_map_robot;
  TellJoining();
}

void SessionEstimator::TellJoining() {
  const bool joinable = pipeline_.mapper().follows_paths();
  std::string why = fragment_ ? start_refused_ : std::string();
  if (fragment_ && why.empty() && !joinable)
    why =
        "not joined with the map of its site: the filter that it is run with cannot continue in a map in which a job "
        "has found it; open its session with a start pose in this map";
  record_.SetJoining({fragment_, driven_m_, std::move(why), joinable});
}

void SessionEstimator::On(SnapshotWanted&& wanted) {
  wanted.done({.session = identity_.id,
               .robot = identity_.status.session.robot,
               .snapshot = pipeline_.mapper().Snapshot(),
               .grid_options = pipeline_.mapper().grid().options(),
               .start_known = !fragment_,
               .start_found = !fragment_ && (began_as_fragment_ || !start_refused_.empty()),
               .joinable = pipeline_.mapper().follows_paths(),
               .lost = pipeline_.mapper().SeenWhileLost(),
               .place_search = options_.recovery.place,
               .near_m = options_.self_check.near_m});
}

void SessionEstimator::On(RelocaliseWanted&& wanted) {
  if (ended_) return;
  Store(RelocaliseTaken{wanted.T_map_robot});
  if (wanted.receipt) wanted.receipt->Taken();
  pipeline_.mapper().Relocalise(wanted.T_map_robot);
  T_map_keyframe_.reset();
}

void SessionEstimator::On(LocaliseWanted&& wanted) {
  if (ended_ || (wanted.again && !pipeline_.mapper().localises())) return;
  LocaliseTaken taken;
  taken.maps_again = wanted.map == nullptr;
  if (wanted.map != nullptr) {
    taken.resolution_m = wanted.map->info.resolution_m;
    taken.epoch = wanted.map->info.epoch;
    taken.tiles = TilesToLocaliseIn(*wanted.map);
  }
  Store(taken);
  if (Localise(std::move(taken)) && wanted.receipt) wanted.receipt->Taken();
}

// In a map that can not be read or is too large, the robot is not found.
bool SessionEstimator::Localise(LocaliseTaken&& taken) {
  std::shared_ptr<const slam::KnownGrid> map;
  if (!taken.maps_again) {
    const auto known_grid = [&](std::span<const TileSet::TilePtr> tiles, double resolution_m) {
      return KnownGridOf(tiles, resolution_m, taken.epoch, options_.recovery.place, options_.self_check.near_m,
                         known_grids_.get());
    };
    map = known_grid(taken.tiles, taken.resolution_m);
    if (map == nullptr) map = known_grid({}, options_.grid.resolution_m);
  }
  // A robot that can not map again, because its place is not known or it is not joined, is localised on.
  const bool begins = map != nullptr && !pipeline_.mapper().localises();
  const bool done = (map != nullptr || !fragment_) && pipeline_.mapper().LocaliseIn(std::move(map), !fragment_);
  if (begins) record_.LoseLast();  // It has to be found in the map: until then it cannot map again either.
  record_.SetLocalises(pipeline_.mapper().localises());
  T_map_keyframe_.reset();
  return done;
}

void SessionEstimator::On(StartRefused&& refused) {
  if (ended_ || fragment_) return;
  Store(StartRefusal{refused.why});
  fragment_ = true;
  start_refused_ = std::move(refused.why);
  pipeline_.mapper().ForgetSuggestion();  // It is a place in the map of the others.
  record_.MovePath({}, true, fragment_);  // Nor was it localized before.
  TellJoining();
  if (outputs_.hidden && !replaying_) outputs_.hidden();
  RefreshLandmarks(true);
}

// Called with each scan that is used. The first one may be much later than the robot's start: those before it never
// arrived, or were dropped. Where there is a map, the robot may then be elsewhere in it. Repeated when the journal is
// read, which must come to the same result: so it depends on nothing but what the session itself has received, unless
// there was no map at the opening. Then the journal holds the decision.
void SessionEstimator::DoubtLateStart(const Scan& scan) {
  if (!first_sequence_) return;
  const bool late = IsLate(scan);
  first_sequence_.reset();
  if (late && (map_begun_ || OthersHaveBegun())) RefuseLateStart(scan);
}

// Others may have begun a map since the opening. Decided before the first scan is journaled, so that no restart can
// come between the two.
void SessionEstimator::DoubtStartInNewMap(const Scan& scan) {
  const bool numbered_late = !record_.begun() && *first_sequence_ > kMostMissing + 1;
  if (numbered_late && !map_begun_ && OthersHaveBegun()) RefuseLateStart(scan);
}

bool SessionEstimator::OthersHaveBegun() const {
  return !replaying_ && outputs_.map_begun && outputs_.map_begun();
}

bool SessionEstimator::IsLate(const Scan& scan) const {
  return *first_sequence_ > kMostMissing + 1 ||
         (scan.stamp > first_stamp_ && NanosBetween(first_stamp_, scan.stamp) > kLatestNs);
}

void SessionEstimator::RefuseLateStart(const Scan& scan) {
  // The filter line_match finds the robot in a map that it was given.
  if (options_.filter.kind == slam::FilterKind::kLineMatch) return;
  On(StartRefused{"none of the first " + std::to_string(scan.sequence - 1) +
                  " scans of its session was used, so nothing says that it is still where it was said to start"});
}

void SessionEstimator::On(Finish&& finish) {
  // A stored session is continued by the next server, as after a crash.
  const bool goes_on = !finish.final && record_.state().durable;
  if (!ended_ && !goes_on) {
    if (finish.final) Store(SessionFinished{true, finish.reason});
    pipeline_.Finish();
    if (finish.final) FitPath();
    RefreshLandmarks(true);
    ended_ = finish.final;
    if (ended_) pipeline_.mapper().ForgetSuggestion();
  }
  if (finish.done) finish.done();
}

}  // namespace cairn::server
