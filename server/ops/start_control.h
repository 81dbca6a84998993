// The start of a server, as other threads see it: whether it goes on, and that it is to be given up. Restoring may take
// long where journals have to be processed again. Thread-safe.
#pragma once

#include <atomic>
#include <cstdint>

namespace cairn::server {

class StartControl {
 public:
  // A piece of the work is done.
  void Advance() { advanced_.fetch_add(1, std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t advanced() const { return advanced_.load(std::memory_order_relaxed); }
  void GiveUp() { given_up_ = true; }
  [[nodiscard]] bool given_up() const { return given_up_; }

 private:
  std::atomic<std::uint64_t> advanced_ = 0;
  std::atomic<bool> given_up_ = false;
};

}  // namespace cairn::server
