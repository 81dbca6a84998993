// A network namespace of Linux with loopback and one TAP device: a machine of its own, as far as the network goes. What
// leaves the device comes as Ethernet frames to whoever holds frames(). The system removes namespace and device when
// the last thread, process and file descriptor of it is gone, so nothing is left to clean up after a crash.
// Needs CAP_SYS_ADMIN, CAP_NET_ADMIN and /dev/net/tun. Thread-safe.
#pragma once

#include <future>
#include <string>
#include <utility>

#include "common/status.h"

namespace cairn::test {

class NetworkNamespace {
 public:
  // `address`: IPv4, of the device; the network has 24 bits. kPermissionDenied: the system does not allow it, and why.
  [[nodiscard]] static Result<NetworkNamespace> Create(const std::string& address);
  NetworkNamespace(NetworkNamespace&& other) noexcept
      : namespace_(std::exchange(other.namespace_, -1)), frames_(std::exchange(other.frames_, -1)) {}
  NetworkNamespace& operator=(NetworkNamespace&&) = delete;
  ~NetworkNamespace();

  // A file of non-blocking reads and writes, one frame each.
  [[nodiscard]] int frames() const { return frames_; }

  // Runs `act` inside, on a thread of its own, and throws what it throws. Threads and processes that it starts stay
  // inside.
  template <typename Act>
  void Inside(const Act& act) const {
    std::async(std::launch::async, [this, &act] {
      Enter();
      act();
    }).get();
  }

 private:
  NetworkNamespace() = default;
  void Enter() const;

  int namespace_ = -1;
  int frames_ = -1;
};

}  // namespace cairn::test
