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

// In steps, so that a stop is noticed.
bool ConnectionStream::Wait(short events, Clock::time_point until) const {
  constexpr std::chrono::milliseconds kStep{100};
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - Clock::now());
    if (left.count() <= 0 || stopping_) return false;
    pollfd ready{.fd = socket_, .events = events, .revents = 0};
    const int count = poll(&ready, 1, static_cast<int>(std::min(left, kStep).count()));
    if (count > 0) return true;
    if (count < 0 && errno != EINTR) return false;
  }
}

bool ConnectionStream::WaitForRequest() {
  if (begin_ == end_ && !Wait(POLLIN, Clock::now() + options_.idle_time)) return false;
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
    return -1;
  }
  if (begin_ == end_) {
    if (!Wait(POLLIN, request_ends_)) return -1;
    const ssize_t count = recv(socket_, buffer_.data(), buffer_.size(), 0);
    if (count <= 0) return count;
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
