// The quantiles of the newest delays of one kind, such as from a change until it is on the disk. A plain value of a
// fixed size that its owner guards; Add allocates nothing and throws nothing.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>

namespace cairn {

class DelayMeter {
 public:
  struct Quantiles {
    double p50_ms = 0.0;
    double p99_ms = 0.0;
  };

  void Add(std::chrono::duration<double, std::milli> delay) noexcept {
    newest_ms_[next_] = static_cast<float>(delay.count());
    next_ = (next_ + 1) % kKept;
    count_ = std::min(count_ + 1, kKept);
  }

  // Both 0 where there was none. Sorts: where threads wait for the owner's lock, a copy should be asked.
  [[nodiscard]] Quantiles quantiles() const {
    if (count_ == 0) return {};
    std::array<float, kKept> sorted = newest_ms_;
    std::sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(count_));
    return {sorted[(count_ - 1) / 2], sorted[(count_ - 1) * 99 / 100]};
  }

 private:
  static constexpr std::size_t kKept = 4096;
  std::array<float, kKept> newest_ms_{};
  std::size_t count_ = 0;
  std::size_t next_ = 0;
};

}  // namespace cairn
