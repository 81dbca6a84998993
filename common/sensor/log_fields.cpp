#include "common/sensor/log_fields.h"

#include <algorithm>
#include <cmath>

#include "common/options/number_text.h"

namespace cairn {

LogLines::LogLines(const std::filesystem::path& path) : file_(path, std::ios::binary) {}

// Appends one block to the buffer; false at the end of the file.
bool LogLines::Fill() {
  constexpr std::size_t kBlock = 256u << 10;
  buffer_.erase(0, begin_);
  begin_ = 0;
  const std::size_t old_size = buffer_.size();
  buffer_.resize(old_size + kBlock);
  file_.read(buffer_.data() + old_size, kBlock);
  const auto count = static_cast<std::size_t>(file_.gcount());
  buffer_.resize(old_size + count);
  failed_ = failed_ || file_.bad();
  return count > 0;
}

bool LogLines::Next(std::string_view& line) {
  too_long_ = false;
  std::size_t searched = begin_;
  for (;;) {
    const std::size_t end = buffer_.find('\n', searched);
    if (end != std::string::npos) {
      line = std::string_view(buffer_).substr(begin_, end - begin_);
      begin_ = end + 1;
      break;
    }
    if (buffer_.size() - begin_ > kMaxLength) {
      too_long_ = true;
      begin_ = buffer_.size();  // Forget what was read; go on to the line's end.
    }
    const std::size_t pending = buffer_.size() - begin_;
    if (!Fill()) {
      if (pending == 0 && !too_long_) return false;
      line = std::string_view(buffer_).substr(begin_);
      begin_ = buffer_.size();
      break;
    }
    searched = pending;
  }
  if (too_long_) line = {};
  ++number_;
  return true;
}

std::string Shown(std::string_view text) {
  constexpr std::size_t kLongest = 24;
  std::string shown;
  for (const char c : text.substr(0, kLongest)) shown += c >= ' ' && c <= '~' ? c : '?';
  return text.size() > kLongest ? shown + "..." : shown;
}

void LogFields::Complain(std::string_view what, std::string_view text) {
  if (!problem_.empty()) return;
  problem_ = std::string(what) + (text.empty() ? " is missing" : " is not valid: '" + Shown(text) + "'");
}

std::string_view LogFields::Word(std::string_view what) {
  constexpr std::string_view kBlanks = " \t\r";
  const std::size_t begin = std::min(rest_.find_first_not_of(kBlanks), rest_.size());
  const std::size_t end = std::min(rest_.find_first_of(kBlanks, begin), rest_.size());
  const std::string_view word = rest_.substr(begin, end - begin);
  rest_.remove_prefix(end);
  if (word.empty()) Complain(what, word);
  return word;
}

double LogFields::Real(std::string_view what) {
  if (!problem_.empty()) return 0.0;
  const std::string_view word = Word(what);
  double value = 0.0;
  if (ParseNumber(word, value) && std::isfinite(value)) return value;
  Complain(what, word);
  return 0.0;
}

float LogFields::Range() {
  if (!problem_.empty()) return 0.0F;
  const std::string_view word = Word("a range");
  float value = 0.0F;
  if (ParseNumber(word, value)) return value;
  Complain("a range", word);
  return 0.0F;
}

int LogFields::Count(std::string_view what, int min, int max) {
  if (!problem_.empty()) return 0;
  const std::string_view word = Word(what);
  int value = 0;
  if (ParseNumber(word, value) && value >= min && value <= max) return value;
  Complain(what, word);
  return 0;
}

Pose2 LogFields::Pose(std::string_view what) {
  const std::string name(what);
  Pose2 pose{Real(name + " x"), Real(name + " y"), 0.0};
  const double theta = Real(name + " theta");
  constexpr double kMaxTheta = 1e6;  // Beyond, a wrapped angle is noise.
  if (std::abs(theta) > kMaxTheta) Complain(name + " theta", std::to_string(theta));
  pose.theta = problem_.empty() ? WrapAngle(theta) : 0.0;
  return pose;
}

Stamp LogFields::StampSeconds() {
  if (!problem_.empty()) return 0;
  const std::string_view word = Word("stamp");
  if (const auto stamp = ParseStamp(word)) return *stamp;
  Complain("stamp", word);
  return 0;
}

void LogFields::End() {
  if (!problem_.empty()) return;
  constexpr std::string_view kBlanks = " \t\r";
  const std::size_t begin = rest_.find_first_not_of(kBlanks);
  if (begin != std::string_view::npos)
    problem_ = "more fields than the message has: '" + Shown(rest_.substr(begin)) + "'";
}

}  // namespace cairn
