// The interface of a job for its running work: it tells whether the job was cancelled and takes reports of
// progress.
// Thread rule: used on the worker's thread; Cancel may be called from any thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "common/service/pose_report.h"

namespace cairn::server {

class JobControl {
 public:
  explicit JobControl(std::function<void(double)> on_progress) : on_progress_(std::move(on_progress)) {}

  void Cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  [[nodiscard]] bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  // Reports the progress, 0..1.
  void Progress(double progress) const { on_progress_(progress); }

 private:
  const std::function<void(double)> on_progress_;
  std::atomic<bool> cancelled_{false};
};

// The result of finished work, stored in its job.
struct JobOutcome {
  double cost_before = 0.0;
  double cost_after = 0.0;
  std::uint32_t map_version = 0;
  std::string message;
  std::vector<PoseHypothesis> places = {};  // See Job.
};

}  // namespace cairn::server
