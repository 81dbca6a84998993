#include "server/slam/scan_pipeline.h"

#include <utility>

namespace cairn::slam {

ScanPipeline::ScanPipeline(const MapperOptions& options, const Pose2& T_map_robot_start, ParallelFor parallel_for,
                           Sink sink)
    : options_(options),
      parallel_for_(std::move(parallel_for)),
      sink_(std::move(sink)),
      mapper_(options, T_map_robot_start, static_cast<std::uint64_t>(options.seed)),
      pairing_(options.pairing,
               {.paired =
                    [this](PairedScan&& pair) {
                      if (mapper_.full()) return sink_.dropped(*pair.scan, DropReason::kSessionFull);
                      std::shared_ptr<const Scan> scan = pair.at_stamp;
                      if (scan->stamp != pair.stamp) {
                        auto restamped = std::make_shared<Scan>(*scan);
                        restamped->stamp = pair.stamp;
                        scan = std::move(restamped);
                      }
                      mapper_.ExpectOdometry(pair.has_odometry);
                      const RollingScan rolling{pair.scan, std::move(pair.during)};
                      const ScanOutcome outcome =
                          mapper_.Process(std::move(scan), pair.T_odom_robot, parallel_for_, pair.passage,
                                          rolling.odometry.empty() ? nullptr : &rolling, pair.rate);
                      pairing_.SetLag(mapper_.learned_lag_s());
                      sink_.used(*pair.scan, outcome);
                    },
                .dropped = [this](const Scan& scan, DropReason reason) { sink_.dropped(scan, reason); }}) {}

void ScanPipeline::Add(std::shared_ptr<const Scan> scan) {
  pairing_.Add(std::move(scan));
}

void ScanPipeline::Add(const Odometry& odometry) {
  pairing_.Add(odometry);
}

void ScanPipeline::Finish() {
  pairing_.Finish();
}

Checkpoint ScanPipeline::Save() const {
  StateWriter archive;
  mapper_.Save(archive);
  archive(pairing_);
  return {options_, std::move(archive)};
}

Result<void> ScanPipeline::Load(std::string_view bytes) {
  return LoadPieces(bytes, {}).map([](const auto&) {});
}

Result<std::vector<std::shared_ptr<const void>>> ScanPipeline::LoadPieces(std::string_view main,
                                                                          std::span<const std::string_view> pieces) {
  const Result<OpenedCheckpoint> opened = OpenCheckpoint(main, options_);
  if (!opened) return tl::unexpected(opened.error());
  StateReader archive(opened->state, pieces, opened->format);
  Mapper mapper(options_, {}, 0);
  mapper.Load(archive);
  // The pairing is read twice, at first into one that is not used, so that a failure changes nothing.
  StateReader again = archive;
  OdometryPairing trial(options_.pairing, {});
  archive(trial);
  if (!archive.done())
    return Fail(StatusCode::kDataLoss,
                std::string("the checkpoint is damaged: ") + (archive.ok() ? "more than the state" : archive.failed()));
  again(pairing_);
  mapper_ = std::move(mapper);
  mapper_.ExpectOdometry(!pairing_.without_odometry());
  return again.values();
}

}  // namespace cairn::slam
