// Processes the streams of one robot: takes validated scans and odometry in any interleaving, pairs them by
// stamp, and passes them to the mapper in order. Both cairnd's sessions and cairn-offline use this class, so
// the same streams give the same trajectory with and without DDS. Not thread-safe: one owner.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "common/status.h"
#include "server/slam/checkpoint.h"
#include "server/slam/mapper.h"
#include "server/slam/scan/odometry_pairing.h"

namespace cairn::slam {

class ScanPipeline {
 public:
  // Called within Add and Finish. For every added scan exactly one of the two is called; `used` is called in the order
  // of the stamps. The stamp of the outcome is the estimator's time: the stamp of the scan, plus what the robot's clock
  // was set back by since the start.
  struct Sink {
    std::function<void(const Scan&, const ScanOutcome&)> used;
    std::function<void(const Scan&, DropReason)> dropped;
  };

  // The random engine starts from options.seed.
  ScanPipeline(const MapperOptions& options, const Pose2& T_map_robot_start, ParallelFor parallel_for, Sink sink);
  ScanPipeline(const ScanPipeline&) = delete;
  ScanPipeline& operator=(const ScanPipeline&) = delete;

  // REQUIRES: ValidateScan accepts it.
  void Add(std::shared_ptr<const Scan> scan);
  // REQUIRES: ValidateOdometry accepts it.
  void Add(const Odometry& odometry);
  // From now on both streams come from another client, which numbers from the beginning.
  void NewClient() { pairing_.NewClient(); }
  // Ends the streams: scans that still wait for odometry are used or dropped.
  void Finish();

  // Calls visit(scan) for every scan that waits for odometry or for its clock to be believed, in an order that saving
  // and loading keep.
  template <typename Visit>
  void ForEachWaiting(const Visit& visit) const {
    pairing_.ForEachWaiting(visit);
  }

  // The whole state, so that a pipeline with the same options that loads it goes on exactly as this one would: the same
  // poses, maps and random numbers. Takes a few milliseconds: what only grows (scans) is shared with the checkpoint,
  // and the time is spent in Checkpoint::Bytes, which may run on another thread.
  [[nodiscard]] Checkpoint Save() const;
  void Save(std::string& bytes) const { bytes = Save().Bytes(); }
  // Replaces the state by a saved one, which may come from a pipeline with another start pose. If the bytes are damaged
  // (kDataLoss), have another format or were made with other options (kFailedPrecondition), nothing changes.
  [[nodiscard]] Result<void> Load(std::string_view bytes);
  // The same for a checkpoint in parts (Checkpoint::Main). Returns the values of the pieces, in their order; a later
  // checkpoint shares those that it still needs.
  [[nodiscard]] Result<std::vector<std::shared_ptr<const void>>> LoadPieces(std::string_view main,
                                                                            std::span<const std::string_view> pieces);

  // Odometry samples refused so far for their stamps.
  [[nodiscard]] std::uint64_t odometry_refused() const { return pairing_.odometry_refused(); }
  [[nodiscard]] bool odometry_has_just_begun() const { return pairing_.odometry_has_just_begun(); }
  [[nodiscard]] Mapper& mapper() { return mapper_; }
  [[nodiscard]] const Mapper& mapper() const { return mapper_; }

 private:
  const MapperOptions options_;
  ParallelFor parallel_for_;
  Sink sink_;
  Mapper mapper_;
  OdometryPairing pairing_;
};

}  // namespace cairn::slam
