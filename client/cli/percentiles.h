// Keeps samples and computes their percentiles. Memory is bounded: from `kMax` samples on, a new one replaces the
// oldest. Use it from one thread at a time.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace cairn::client {

class Percentiles {
 public:
  static constexpr std::size_t kMax = 1'000'000;

  void Add(double sample) {
    if (samples_.size() < kMax) {
      samples_.push_back(sample);
    } else {
      samples_[next_++ % kMax] = sample;
    }
  }

  void Add(const Percentiles& other) {
    for (const double sample : other.samples_) Add(sample);
  }

  [[nodiscard]] std::size_t count() const { return samples_.size(); }

  [[nodiscard]] std::size_t CountAbove(double limit) const {
    return static_cast<std::size_t>(
        std::count_if(samples_.begin(), samples_.end(), [limit](double sample) { return sample > limit; }));
  }

  // Nearest rank; 0 without samples. `share` 0..1.
  [[nodiscard]] double At(double share) const {
    if (samples_.empty()) return 0.0;
    std::vector<double> sorted = samples_;
    const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(sorted.size())));
    const auto nth = sorted.begin() + static_cast<std::ptrdiff_t>(std::clamp<std::size_t>(rank, 1, sorted.size()) - 1);
    std::nth_element(sorted.begin(), nth, sorted.end());
    return *nth;
  }

 private:
  std::vector<double> samples_;
  std::size_t next_ = 0;
};

}  // namespace cairn::client
