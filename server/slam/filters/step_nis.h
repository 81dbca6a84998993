// Sums the squared Mahalanobis distances of one step's innovations. After EndStep the sum of the last step
// can be read until the next step adds or ends.
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
