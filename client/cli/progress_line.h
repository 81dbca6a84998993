// Shows the progress of a long task: on a terminal as one line that is redrawn in place, elsewhere as a new line now
// and then. It reads no clock: the caller passes the seconds since the start. Use it from one thread at a time.
#pragma once

#include <ostream>
#include <string>

namespace cairn::client {

class ProgressLine {
 public:
  // `terminal`: whether the stream is a terminal. `quiet`: nothing is shown.
  ProgressLine(std::ostream& out, bool terminal, bool quiet) : out_(out), terminal_(terminal), quiet_(quiet) {}

  // `share` is the part that is done, 0..1, or negative if the total is not known. Redraws at most 10 times a second
  // (every 5 s elsewhere).
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
