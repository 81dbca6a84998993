// What running work sees of its job: whether to go on, and where to say how far it is.
// Thread rule: the worker calls; Cancel may come from any thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>

namespace cairn::server {

class JobControl {
 public:
  explicit JobControl(std::function<void(double)> on_progress) : on_progress_(std::move(on_progress)) {}

  void Cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  [[nodiscard]] bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  // 0..1.
  void Progress(double progress) const { on_progress_(progress); }

 private:
  const std::function<void(double)> on_progress_;
  std::atomic<bool> cancelled_{false};
};

// What finished work leaves on its job.
struct JobOutcome {
  double cost_before = 0.0;
  double cost_after = 0.0;
  std::uint32_t map_version = 0;
  std::string message;
};

}  // namespace cairn::server
