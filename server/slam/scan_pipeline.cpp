#include "server/slam/scan_pipeline.h"

#include <algorithm>
#include <utility>

namespace cairn::slam {

std::optional<DropReason> RefusalOf(const Scan& scan) {
  if (ValidateScan(scan)) return std::nullopt;
  if (scan.ranges_m.size() > static_cast<std::size_t>(kMaxBeams)) return DropReason::kTooManyBeams;
  const bool any_usable = std::any_of(scan.ranges_m.begin(), scan.ranges_m.end(), [&scan](float range_m) {
    return ClassifyRange(range_m, scan.range_min_m, scan.range_max_m) != BeamClass::kInvalid;
  });
  if (scan.ranges_m.empty()) return DropReason::kEmpty;
  // Bad limits make every range look unusable: the geometry is then what is wrong. One good beam tells them apart.
  Scan one_beam = scan;
  one_beam.ranges_m.assign(1, static_cast<float>(0.5 * (scan.range_min_m + scan.range_max_m)));
  return !any_usable && ValidateScan(one_beam) ? DropReason::kEmpty : DropReason::kBadGeometry;
}

ScanPipeline::ScanPipeline(const MapperOptions& options, const Pose2& T_map_robot_start, ParallelFor parallel_for,
                           Sink sink)
    : parallel_for_(std::move(parallel_for)),
      sink_(std::move(sink)),
      mapper_(options, T_map_robot_start, static_cast<std::uint64_t>(options.seed)),
      pairing_(options.pairing,
               {.paired =
                    [this](PairedScan&& pair) {
                      const ScanOutcome outcome = mapper_.Process(pair.scan, pair.T_odom_robot, parallel_for_);
                      sink_.used(*pair.scan, outcome);
                    },
                .dropped = [this](const Scan& scan, DropReason reason) { sink_.dropped(scan, reason); }}) {}

void ScanPipeline::Add(std::shared_ptr<const Scan> scan) {
  pairing_.Add(std::move(scan));
}

bool ScanPipeline::Add(const Odometry& odometry) {
  return pairing_.Add(odometry);
}

void ScanPipeline::Finish() {
  pairing_.Finish();
}

}  // namespace cairn::slam
