// Sends the server's state to the service manager (systemd): ready, alive, stopping. Does nothing if no
// service manager started the process. Thread rule: any thread.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace cairn::server {

class ServiceNotifier {
 public:
  void Ready(const std::string& status) const;
  void Alive() const;
  // One line that the service manager shows beside the service (systemctl status).
  void Status(const std::string& text) const;
  void Stopping() const;
  // The longest allowed time between two calls of Alive; nothing if no watchdog is configured.
  [[nodiscard]] std::optional<std::chrono::microseconds> watchdog() const;
};

}  // namespace cairn::server
