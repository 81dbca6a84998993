#include "common/http/connection_stream.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>

namespace cairn {

ConnectionStream::ConnectionStream(int socket, const HttpOptions& options, const std::atomic<bool>& stopping)
    : socket_(socket), options_(options), stopping_(stopping) {}

// In steps, so that an end is noticed. What is there already is taken also then.
bool ConnectionStream::Wait(short events, Clock::time_point until, const std::atomic<bool>& ending) const {
  constexpr std::chrono::milliseconds kStep{100};
  for (;;) {
    if (stopping_) return false;
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - Clock::now());
    const auto wait = ending ? std::chrono::milliseconds(0) : std::clamp(left, std::chrono::milliseconds(0), kStep);
    pollfd ready{.fd = socket_, .events = events, .revents = 0};
    const int count = poll(&ready, 1, static_cast<int>(wait.count()));
    if (count > 0) return true;
    if (count < 0 && errno != EINTR) return false;
    if (ending || left.count() <= 0) return false;
  }
}

bool ConnectionStream::WaitForRequest(const std::atomic<bool>& ending) {
  if (begin_ == end_ && !Wait(POLLIN, Clock::now() + options_.idle_time, ending)) return false;
  request_ends_ = Clock::now() + options_.request_time;
  bytes_left_ = options_.max_request_bytes;
  answered_ = false;
  return true;
}

bool ConnectionStream::is_readable() const {
  return begin_ < end_ || Wait(POLLIN, request_ends_);
}

bool ConnectionStream::is_writable() const {
  char byte = 0;
  const ssize_t seen = recv(socket_, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
  const bool left = seen == 0 || (seen < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR);
  return !left && Wait(POLLOUT, Clock::now() + options_.request_time);
}

ssize_t ConnectionStream::read(char* to, std::size_t size) {
  if (bytes_left_ == 0) {
    constexpr std::string_view kTooLarge =
        "HTTP/1.1 431 Request Header Fields Too Large\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";
    if (!answered_) write(kTooLarge.data(), kTooLarge.size());
    intact_ = false;
    return -1;
  }
  if (begin_ == end_) {
    const ssize_t count = Wait(POLLIN, request_ends_) ? recv(socket_, buffer_.data(), buffer_.size(), 0) : -1;
    if (count <= 0) {
      intact_ = false;
      return count;
    }
    begin_ = 0;
    end_ = static_cast<std::size_t>(count);
  }
  const std::size_t count = std::min({size, end_ - begin_, bytes_left_});
  std::memcpy(to, buffer_.data() + begin_, count);
  begin_ += count;
  bytes_left_ -= count;
  return static_cast<ssize_t>(count);
}

ssize_t ConnectionStream::write(const char* from, std::size_t size) {
  answered_ = true;
  if (!Wait(POLLOUT, Clock::now() + options_.request_time)) return -1;
  // Without waiting: a client that takes nothing more would hold the thread for ever.
  return send(socket_, from, size, MSG_NOSIGNAL | MSG_DONTWAIT);
}

// Nobody asks for addresses here.
void ConnectionStream::get_remote_ip_and_port(std::string& ip, int& port) const {
  ip.clear();
  port = 0;
}

void ConnectionStream::get_local_ip_and_port(std::string& ip, int& port) const {
  ip.clear();
  port = 0;
}

}  // namespace cairn
