// One connection as cpp-httplib reads and writes it, with bounds that the library does not have: bytes and time of a
// whole request. One thread.
#pragma once

#include <httplib.h>

#include <array>
#include <atomic>
#include <chrono>
#include <string>

#include "common/http/http_server.h"

namespace cairn {

class ConnectionStream final : public httplib::Stream {
 public:
  // `stopping` outlives it: where it becomes true, waiting ends.
  ConnectionStream(int socket, const HttpOptions& options, const std::atomic<bool>& stopping);

  // Waits for the first byte of a request, at most the idle time, and no longer than until `ending`
  // becomes true. False: none came.
  [[nodiscard]] bool WaitForRequest(const std::atomic<bool>& ending);

  // Whether a next request can be read: false after one that was cut off, too late or too large.
  [[nodiscard]] bool intact() const { return intact_; }

  [[nodiscard]] bool is_readable() const override;
  [[nodiscard]] bool is_writable() const override;
  ssize_t read(char* to, std::size_t size) override;
  ssize_t write(const char* from, std::size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  [[nodiscard]] socket_t socket() const override { return socket_; }

 private:
  using Clock = std::chrono::steady_clock;

  // Until then, or until one of the two becomes true.
  [[nodiscard]] bool Wait(short events, Clock::time_point until, const std::atomic<bool>& ending) const;
  [[nodiscard]] bool Wait(short events, Clock::time_point until) const { return Wait(events, until, stopping_); }

  const int socket_;
  const HttpOptions& options_;
  const std::atomic<bool>& stopping_;
  Clock::time_point request_ends_{};
  std::size_t bytes_left_ = 0;  // That this request may still have.
  bool answered_ = false;       // Something of an answer was sent.
  bool intact_ = true;
  std::array<char, 4096> buffer_{};
  std::size_t begin_ = 0, end_ = 0;  // What of the buffer was not read yet.
};

}  // namespace cairn
