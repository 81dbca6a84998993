// The blank-separated fields of one log line, read strictly in order. The first field that does not fit sets the
// problem; all later reads return zero, so that a parser can read all fields and check once at the end.
#pragma once

#include <string>
#include <string_view>

#include "common/geometry/pose2.h"
#include "common/sensor/stamp.h"

namespace cairn {

class LogFields {
 public:
  explicit LogFields(std::string_view line) : rest_(line) {}

  [[nodiscard]] std::string_view Word(std::string_view what);
  [[nodiscard]] double Real(std::string_view what);  // Finite.
  [[nodiscard]] float Range();                       // NaN and infinity are ordinary sensor answers.
  [[nodiscard]] int Count(std::string_view what, int min, int max);
  [[nodiscard]] Pose2 Pose(std::string_view what);  // x y theta; theta is wrapped.
  [[nodiscard]] Stamp StampSeconds();
  void SkipReal(std::string_view what) { static_cast<void>(Real(what)); }
  // Sets the problem if anything is left.
  void End();

  [[nodiscard]] std::size_t bytes_left() const { return rest_.size(); }
  [[nodiscard]] const std::string& problem() const { return problem_; }

 private:
  void Complain(std::string_view what, std::string_view text);

  std::string_view rest_;
  std::string problem_;
};

// The text as a complaint may show it: printable, and not longer than a few words.
[[nodiscard]] std::string Shown(std::string_view text);

}  // namespace cairn
