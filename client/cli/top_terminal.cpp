#include "client/cli/top_terminal.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>

#include "client/cli/interrupt.h"

namespace cairn::client {
namespace {

using Clock = std::chrono::steady_clock;

TerminalSize SizeOfTerminal() {
  winsize size{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0) return {};
  return {size.ws_row, size.ws_col};
}

// While it lives, keys are read one by one and not shown. It does not live while the server is asked, so that a second
// Ctrl-C, which ends the program at once, leaves the terminal as it was.
class SingleKeys {
 public:
  SingleKeys() {
    // A program in the background would be stopped by this.
    if (isatty(STDIN_FILENO) == 0 || tcgetpgrp(STDIN_FILENO) != getpgrp()) return;
    if (tcgetattr(STDIN_FILENO, &before_) != 0) return;
    termios keys = before_;
    keys.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    keys.c_cc[VMIN] = 1;
    keys.c_cc[VTIME] = 0;
    active_ = tcsetattr(STDIN_FILENO, TCSANOW, &keys) == 0;
  }
  ~SingleKeys() {
    if (active_) tcsetattr(STDIN_FILENO, TCSANOW, &before_);
  }
  SingleKeys(const SingleKeys&) = delete;
  SingleKeys& operator=(const SingleKeys&) = delete;

  // Waits for at most this long, or until a signal comes. Returns whether the key q was typed, or the terminal is gone.
  [[nodiscard]] bool WaitForQuit(std::chrono::milliseconds time) const {
    pollfd input{.fd = active_ ? STDIN_FILENO : -1, .events = POLLIN, .revents = 0};
    if (poll(&input, 1, static_cast<int>(time.count())) <= 0) return false;
    char key = 0;
    return read(STDIN_FILENO, &key, 1) != 1 || key == 'q' || key == 'Q';
  }

 private:
  termios before_{};
  bool active_ = false;
};

// From the upper left corner on, so that nothing flickers. Each line is cleared before it is written: after it, the
// cursor may still stand on its last character.
void Draw(std::ostream& out, const std::string& text) {
  std::string drawn = "\x1b[H\x1b[K";
  for (const char byte : text) {
    drawn += byte;
    if (byte == '\n') drawn += "\x1b[K";
  }
  out << drawn << "\x1b[J" << std::flush;
}

}  // namespace

bool DrawUntil(std::ostream& out, const std::function<std::string(const TerminalSize&)>& text, Clock::time_point time) {
  constexpr std::chrono::milliseconds kStep{50};
  TerminalSize size = SizeOfTerminal();
  Draw(out, text(size));
  const SingleKeys keys;
  while (!Interrupted()) {
    const auto now = Clock::now();
    if (now >= time) return true;
    // One more, so that the last step does not end too early.
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(time - now) + std::chrono::milliseconds(1);
    if (keys.WaitForQuit(std::min(left, kStep))) return false;
    if (const TerminalSize changed = SizeOfTerminal(); changed != size) {
      size = changed;
      Draw(out, text(size));
    }
  }
  return false;
}

}  // namespace cairn::client
