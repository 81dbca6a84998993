// What a filter counts for its FilterHealth.
#pragma once

#include <cstdint>

namespace cairn::slam {

// Counts the consecutive revisits that a filter cannot explain. When their number reaches the limit, the
// filter counts as diverged. A revisit that the filter explains resets the count.
class Contradictions {
 public:
  explicit Contradictions(std::int64_t limit) : limit_(limit) {}
  void Add(bool explained) { streak_ = explained ? 0 : streak_ + 1; }
  [[nodiscard]] bool diverged() const { return streak_ >= limit_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.streak_);
  }

 private:
  std::int64_t limit_;
  std::int64_t streak_ = 0;
};

// Sums the squared Mahalanobis distances of one step's innovations. After EndStep the sum of the last step
// can be read until the next step adds or ends.
class StepNis {
 public:
  void Add(double nis, int numbers) {
    if (!open_) *this = {};
    open_ = true;
    sum_ += nis;
    numbers_ += numbers;
  }
  void EndStep() {
    if (!open_) *this = {};
    open_ = false;
  }
  [[nodiscard]] double sum() const { return sum_; }
  [[nodiscard]] int numbers() const { return numbers_; }

  template <typename Archive>
  static void Members(Archive& archive, auto& self) {
    archive(self.sum_, self.numbers_, self.open_);
  }

 private:
  double sum_ = 0.0;
  int numbers_ = 0;
  bool open_ = false;
};

}  // namespace cairn::slam
