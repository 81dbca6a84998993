#include "server/robots/session_estimator.h"

#include <utility>
#include <variant>

namespace cairn::server {
namespace {

using Clock = std::chrono::steady_clock;

PoseReport ReportOf(const slam::ScanOutcome& outcome, const SessionState& session, std::uint32_t epoch,
                    std::uint64_t sequence) {
  PoseReport report;
  report.robot_id = session.robot_id;
  report.robot = session.robot;
  report.site = session.site;
  report.stamp = outcome.stamp;
  report.scan_sequence = sequence;
  report.T_map_robot = outcome.T_map_robot;
  report.covariance = outcome.covariance;
  report.T_map_odom = outcome.T_map_odom;
  report.localized = outcome.localized;
  report.score = outcome.score;
  report.reason = outcome.reason;
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

SessionEstimator::SessionEstimator(const EstimatorSetup& setup, const RobotsOptions& options, SessionRecord& record,
                                   SessionOutputs outputs)
    : landmark_period_(1.0 / options.landmark_rate_hz),
      record_(record),
      outputs_(std::move(outputs)),
      identity_(record.snapshot()),
      epoch_(record.epoch()),
      pipeline_(setup.mapper, setup.T_map_robot_start, slam::SerialFor,
                {.used = [this](const Scan& scan, const slam::ScanOutcome& outcome) { Used(scan, outcome); },
                 .dropped = [this](const Scan& scan, DropReason reason) { Dropped(scan, reason); }}) {}

void SessionEstimator::Handle(RobotEvent&& event) {
  std::visit([this](auto&& alternative) { On(std::move(alternative)); }, std::move(event));
}

void SessionEstimator::On(ScanArrival&& arrival) {
  if (ended_) {
    record_.ScanDropped(arrival.stream.sensor_id, arrival.scan->sequence, DropReason::kSessionEnded);
    return;
  }
  waiting_.emplace(arrival.scan.get(), Waiting{arrival.stream.sensor_id, arrival.received});
  pipeline_.Add(std::move(arrival.scan));
}

void SessionEstimator::On(OdometryArrival&& arrival) {
  if (ended_ || !pipeline_.Add(arrival.odometry)) record_.OdometryDropped();
}

void SessionEstimator::Used(const Scan& scan, const slam::ScanOutcome& outcome) {
  const Waiting waiting = TakeWaiting(scan);
  const PoseReport report = ReportOf(outcome, identity_.status.session, epoch_, scan.sequence);
  outputs_.send(report);
  const std::chrono::duration<double, std::milli> latency = Clock::now() - waiting.received;
  record_.ScanUsed(waiting.sensor_id, report, outcome.keyframe, latency.count());
  if (outcome.keyframe) {
    GridChange change = TakeGridChange();
    if (!change.chunks.empty()) outputs_.grid_changed(std::move(change));
    RefreshLandmarks(false);
  }
}

void SessionEstimator::Dropped(const Scan& scan, DropReason reason) {
  record_.ScanDropped(TakeWaiting(scan).sensor_id, scan.sequence, reason);
}

SessionEstimator::Waiting SessionEstimator::TakeWaiting(const Scan& scan) {
  const auto node = waiting_.extract(&scan);
  return node.empty() ? Waiting{} : node.mapped();
}

GridChange SessionEstimator::TakeGridChange() {
  GridChange change{.session = identity_.id, .chunks = {}};
  const auto& chunks = pipeline_.mapper().grid().chunks();
  for (const slam::ChunkKey& key : pipeline_.mapper().TakeDirtyChunks()) {
    const auto found = chunks.find(key);
    change.chunks.emplace_back(key, found == chunks.end() ? nullptr : found->second);
  }
  return change;
}

slam::OccupancyGrid::Chunks SessionEstimator::PublishedChunks() {
  // Chunks may be shared only after they were taken as changed: from then on the mapper writes to copies.
  GridChange change = TakeGridChange();
  if (!change.chunks.empty()) outputs_.grid_changed(std::move(change));
  return pipeline_.mapper().grid().chunks();
}

void SessionEstimator::RefreshLandmarks(bool at_once) {
  const auto now = Clock::now();
  if (!at_once && now - landmarks_refreshed_ < landmark_period_) return;
  landmarks_refreshed_ = now;
  record_.SetLandmarks(ReportsOf(pipeline_.mapper().landmarks(), identity_.status.session.robot));
}

void SessionEstimator::On(Correction&& correction) {
  slam::Mapper& mapper = pipeline_.mapper();
  Adopted adopted{.session = identity_.id,
                  .displaced = {PublishedChunks(), mapper.keyframe_count()},
                  .change = {.session = identity_.id, .chunks = {}}};
  mapper.AdoptGrid(slam::OccupancyGrid(mapper.grid().options(), std::move(correction.grid.chunks)),
                   correction.grid.keyframes);
  static_cast<void>(mapper.TakeDirtyChunks());  // From here on the mapper writes to copies.
  for (const auto& [key, chunk] : mapper.grid().chunks()) adopted.change.chunks.emplace_back(key, chunk);
  for (const auto& [key, chunk] : adopted.displaced.chunks) {
    if (!mapper.grid().chunks().contains(key)) adopted.change.chunks.emplace_back(key, nullptr);
  }
  epoch_ = correction.epoch;
  record_.SetEpoch(epoch_);
  correction.done(std::move(adopted));
}

void SessionEstimator::On(SnapshotWanted&& wanted) {
  wanted.done({.session = identity_.id,
               .robot = identity_.status.session.robot,
               .snapshot = pipeline_.mapper().Snapshot(),
               .grid_options = pipeline_.mapper().grid().options()});
}

void SessionEstimator::On(Finish&& finish) {
  if (!ended_) {
    pipeline_.Finish();
    RefreshLandmarks(true);
    ended_ = finish.final;
  }
  if (finish.done) finish.done();
}

void SessionEstimator::On(Probe&& probe) {
  probe.done();
}

}  // namespace cairn::server
