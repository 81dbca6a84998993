// What a recorder has received and not yet written. Bounded by bytes: where the disk is too slow, what arrives is left
// out and counted, scans first; a quarter of the room is kept for everything else, which is small. Thread-safe.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <utility>
#include <variant>
#include <vector>

#include "common/mutex.h"
#include "common/service/job.h"
#include "common/service/ledger.h"
#include "common/service/map_info.h"
#include "common/service/pose_report.h"
#include "common/service/session.h"
#include "common/service/stream.h"

namespace cairn::client {

struct RecordEvent {
  std::int64_t time = 0;  // When it was received, in nanoseconds since 1970.
  std::variant<ScanSample, OdometrySample, PoseReport, SessionState, Ledger, Job, MapInfo> value;

  // In memory, about.
  [[nodiscard]] std::size_t bytes() const {
    constexpr std::size_t kTexts = 256;
    const auto* const scan = std::get_if<ScanSample>(&value);
    return sizeof(RecordEvent) + (scan == nullptr ? kTexts : scan->scan.ranges_m.size() * sizeof(float));
  }
};

class RecordQueue {
 public:
  struct LeftOut {
    std::uint64_t scans = 0, others = 0;
  };

  explicit RecordQueue(std::size_t most_bytes) : most_bytes_(most_bytes) {}

  void Push(RecordEvent&& event) CAIRN_EXCLUDES(mutex_) {
    const bool is_scan = std::holds_alternative<ScanSample>(event.value);
    const std::size_t bytes = event.bytes();
    const MutexLock lock(mutex_);
    if (bytes_ + bytes > (is_scan ? most_bytes_ / 4 * 3 : most_bytes_)) {
      ++(is_scan ? left_out_.scans : left_out_.others);
      return;
    }
    bytes_ += bytes;
    events_.push_back(std::move(event));
    filled_.NotifyOne();
  }

  // Everything that is there, in its order; waits for something at most so long. What is taken counts until the next
  // call: it is being written.
  [[nodiscard]] std::vector<RecordEvent> Take(std::chrono::milliseconds most) CAIRN_EXCLUDES(mutex_) {
    const auto deadline = std::chrono::steady_clock::now() + most;
    const MutexLock lock(mutex_);
    bytes_ -= std::exchange(taken_bytes_, 0);
    while (events_.empty() && filled_.WaitUntil(mutex_, deadline)) {
    }
    taken_bytes_ = bytes_;
    return std::exchange(events_, {});
  }

  [[nodiscard]] LeftOut left_out() const CAIRN_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return left_out_;
  }

 private:
  const std::size_t most_bytes_;
  mutable Mutex mutex_;
  CondVar filled_;
  std::vector<RecordEvent> events_ CAIRN_GUARDED_BY(mutex_);
  std::size_t bytes_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::size_t taken_bytes_ CAIRN_GUARDED_BY(mutex_) = 0;
  LeftOut left_out_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::client
