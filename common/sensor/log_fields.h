// The text of logs: lines of a file, and the fields of a line.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "common/geometry/pose2.h"
#include "common/sensor/stamp.h"

namespace cairn {

// Lines of a text file of any size in bounded memory: a line longer than the bound is reported, not stored.
class LogLines {
 public:
  static constexpr std::size_t kMaxLength = 4u << 20;

  explicit LogLines(const std::filesystem::path& path);
  [[nodiscard]] bool is_open() const { return file_.is_open(); }

  // The next line without its end; false at the end of the file. The view lives until the next call.
  [[nodiscard]] bool Next(std::string_view& line);
  [[nodiscard]] int number() const { return number_; }       // 1-based, of the line last returned.
  [[nodiscard]] bool too_long() const { return too_long_; }  // The line last returned was cut: do not parse it.
  [[nodiscard]] bool failed() const { return failed_; }      // Reading failed, e.g. because the path is a directory.

 private:
  bool Fill();

  std::ifstream file_;
  std::string buffer_;
  std::size_t begin_ = 0;
  int number_ = 0;
  bool too_long_ = false;
  bool failed_ = false;
};

// The blank-separated fields of one log line, read strictly in order. The first field that does not fit sets the
// problem; all later reads return zero, so that a parser can read all fields and check once at the end.
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
