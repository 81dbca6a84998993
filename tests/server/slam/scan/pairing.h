// An OdometryPairing that keeps what it pairs and drops.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "server/slam/scan/odometry_pairing.h"

namespace cairn::slam::test {

struct Pairing {
  explicit Pairing(const PairingOptions& options = {})
      : pairing(options, {[this](PairedScan&& p) {
                            pairs.push_back({p.scan->stamp, p.T_odom_robot});
                            passages.push_back(p.passage);
                            rates.push_back(p.rate);
                            with_odometry.push_back(p.has_odometry);
                            grows &= pairs.size() == 1 || p.stamp > estimator_time;
                            estimator_time = p.stamp;
                          },
                          [this](const Scan& scan, DropReason reason) { drops.emplace_back(scan.stamp, reason); }}) {}

  void ScanAt(Stamp stamp, std::uint64_t sequence = 0) {
    auto scan = std::make_shared<Scan>();
    scan->stamp = stamp;
    scan->sequence = sequence;
    pairing.Add(std::move(scan));
  }
  // False if this sample, or one held back before it, was refused.
  bool OdometryAt(Stamp stamp, double x, std::uint64_t sequence = 0) {
    const std::uint64_t refused = pairing.odometry_refused();
    pairing.Add(Odometry{sequence, stamp, {x, 0, 0}});
    return pairing.odometry_refused() == refused;
  }

  struct Paired {
    Stamp stamp;
    Pose2 T_odom_robot;
    bool operator==(const Paired&) const = default;
  };
  std::vector<Paired> pairs;
  std::vector<Passage> passages;    // Of each pair,
  std::vector<Pose2> rates;         // PairedScan::rate
  std::vector<bool> with_odometry;  // and PairedScan::has_odometry.
  std::vector<std::pair<Stamp, DropReason>> drops;
  bool grows = true;  // The estimator's time, from pair to pair.
  Stamp estimator_time = 0;
  OdometryPairing pairing;
};

inline constexpr Stamp kSecond = kNanosPerSecond;

}  // namespace cairn::slam::test
