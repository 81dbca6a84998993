// One robot's way from streams to estimates: validated scans and odometry in any interleaving go in, get paired by
// stamp, and reach the mapper in order. cairnd's sessions and cairn-offline both drive this class, so the same streams
// give the same trajectory with and without DDS. Not thread-safe: one owner.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "server/slam/mapper.h"
#include "server/slam/scan/odometry_pairing.h"

namespace cairn::slam {

// Why a scan must not reach an estimator (ValidateScan's verdict as a ledger reason); nothing where it may.
[[nodiscard]] std::optional<DropReason> RefusalOf(const Scan& scan);

class ScanPipeline {
 public:
  // Called from within Add and Finish, in stamp order; every scan added ends in exactly one of the two.
  struct Sink {
    std::function<void(const Scan&, const ScanOutcome&)> used;
    std::function<void(const Scan&, DropReason)> dropped;
  };

  // The random engine starts from options.seed.
  ScanPipeline(const MapperOptions& options, const Pose2& T_map_robot_start, ParallelFor parallel_for, Sink sink);
  ScanPipeline(const ScanPipeline&) = delete;
  ScanPipeline& operator=(const ScanPipeline&) = delete;

  // REQUIRES: RefusalOf(*scan) is empty.
  void Add(std::shared_ptr<const Scan> scan);
  // REQUIRES: ValidateOdometry accepts it. False where its stamp is refused.
  bool Add(const Odometry& odometry);
  // No more odometry will come: scans still waiting for it are settled.
  void Finish();

  [[nodiscard]] Mapper& mapper() { return mapper_; }
  [[nodiscard]] const Mapper& mapper() const { return mapper_; }

 private:
  ParallelFor parallel_for_;
  Sink sink_;
  Mapper mapper_;
  OdometryPairing pairing_;
};

}  // namespace cairn::slam
