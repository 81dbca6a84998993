// How far a long task is: one line redrawn in place on a terminal, a new line now and then elsewhere.
// Not a clock: the caller says how much time has passed. One thread at a time.
#pragma once

#include <ostream>
#include <string>

namespace cairn::client {

class ProgressLine {
 public:
  // `terminal`: the stream is one (IsTerminal()); `quiet`: show nothing.
  ProgressLine(std::ostream& out, bool terminal, bool quiet) : out_(out), terminal_(terminal), quiet_(quiet) {}

  // `share` 0..1, negative where the end is not known. Redraws at most 10 times a second (every 5 s elsewhere).
  void Show(double seconds, double share, const std::string& text);
  // Shows the last state in any case and ends the line.
  void Finish(double seconds, double share, const std::string& text);

 private:
  void Draw(double share, const std::string& text);

  std::ostream& out_;
  const bool terminal_;
  const bool quiet_;
  double last_s_ = -1e9;
  std::size_t last_width_ = 0;
};

// True where standard error is a terminal.
[[nodiscard]] bool ErrorIsTerminal();

}  // namespace cairn::client
