// Sums the squared Mahalanobis distances of a step's innovations; what the last step came to stays readable.
#pragma once

namespace cairn::slam {

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

 private:
  double sum_ = 0.0;
  int numbers_ = 0;
  bool open_ = false;
};

}  // namespace cairn::slam
