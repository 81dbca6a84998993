// Counts the consecutive revisits that a filter cannot explain. When their number reaches the limit, the
// filter counts as diverged. A revisit that the filter explains resets the count.
#pragma once

#include <cstdint>

namespace cairn::slam {

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

}  // namespace cairn::slam
