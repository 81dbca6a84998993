#include "client/cli/progress_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

namespace cairn::client {

void ProgressLine::Show(double seconds, double share, const std::string& text) {
  constexpr double kTerminalPeriod_s = 0.1, kPlainPeriod_s = 5.0;
  if (quiet_ || seconds - last_s_ < (terminal_ ? kTerminalPeriod_s : kPlainPeriod_s)) return;
  last_s_ = seconds;
  Draw(share, text);
}

void ProgressLine::Finish(double seconds, double share, const std::string& text) {
  if (quiet_) return;
  last_s_ = seconds;
  Draw(share, text);
  if (terminal_) out_ << "\n";
  out_.flush();
}

void ProgressLine::Draw(double share, const std::string& text) {
  constexpr int kBarWidth = 28;
  std::string line;
  if (share >= 0.0) {
    const double bounded = std::clamp(share, 0.0, 1.0);
    const int full = static_cast<int>(std::lround(bounded * kBarWidth));
    if (terminal_) line += fmt::format("[{}{}] ", std::string(full, '#'), std::string(kBarWidth - full, '.'));
    line += fmt::format("{:3.0f} %  ", bounded * 100);
  }
  line += text;
  if (!terminal_) {
    out_ << line << "\n";
  } else {
    const std::size_t width = line.size();
    line.resize(std::max(width, last_width_), ' ');  // Wipes what a longer line left.
    last_width_ = width;
    out_ << "\r" << line;
  }
  out_.flush();
}

bool ErrorIsTerminal() {
  return isatty(STDERR_FILENO) == 1;
}

}  // namespace cairn::client
