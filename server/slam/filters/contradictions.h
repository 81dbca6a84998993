// Counts how often in a row the world contradicts a belief. A filter that cannot explain several revisits one after the
// other means nothing any more and says so; one that is explained ends the count.
#pragma once

#include <cstdint>

namespace cairn::slam {

class Contradictions {
 public:
  explicit Contradictions(std::int64_t limit) : limit_(limit) {}
  void Add(bool explained) { streak_ = explained ? 0 : streak_ + 1; }
  [[nodiscard]] bool diverged() const { return streak_ >= limit_; }

 private:
  std::int64_t limit_;
  std::int64_t streak_ = 0;
};

}  // namespace cairn::slam
