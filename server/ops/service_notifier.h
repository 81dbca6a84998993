// What the service manager (systemd) is told: ready, alive, stopping. Says nothing where there is no service manager.
// Thread rule: any thread.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace cairn::server {

class ServiceNotifier {
 public:
  void Ready(const std::string& status) const;
  void Alive() const;
  void Stopping() const;
  // How often Alive is wanted at least; nothing where no watchdog is set.
  [[nodiscard]] std::optional<std::chrono::microseconds> watchdog() const;
};

}  // namespace cairn::server
