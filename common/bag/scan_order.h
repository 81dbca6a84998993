// Puts the scans of all lidars of one robot into one order of stamps, as the server does with those that robots send:
// an estimator uses no scan that is older than the one before. A scan waits until each other lidar has a scan that is
// not older; a lidar whose last scan is more than a second older than the newest is not waited for. Scans of the same
// moment get stamps that are a microsecond apart. Those of a single lidar pass at once and unchanged. Bounded: at most
// kMostHeld scans wait. Not thread-safe.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "common/sensor/scan.h"

namespace cairn::bag {

class ScanOrder {
 public:
  static constexpr std::size_t kMostHeld = 64;
  // Returns whether more is wanted; after false, it is not called again.
  using Sink = std::function<bool(Scan&&, std::size_t lidar)>;

  ScanOrder(std::size_t lidars, Sink sink) : newest_(lidars), sink_(std::move(sink)) {}

  // Both return whether more is wanted.
  bool Add(Scan&& scan, std::size_t lidar);
  bool Finish();  // No more scans will come.

 private:
  struct Held {
    Scan scan;
    std::size_t lidar = 0;
  };
  [[nodiscard]] bool MayGo(const Held& held) const;
  bool PassFirst();

  std::vector<std::optional<Stamp>> newest_;  // By lidar.
  std::optional<Stamp> before_first_;         // Earlier than the first scan of all.
  std::multimap<Stamp, Held> held_;
  std::optional<std::pair<std::size_t, Stamp>> last_;  // The lidar and the stamp of the last scan that passed.
  Sink sink_;
  bool goes_on_ = true;
};

}  // namespace cairn::bag
