#include "server/ops/service_notifier.h"

#include <systemd/sd-daemon.h>

#include <cstdint>

namespace cairn::server {

void ServiceNotifier::Ready(const std::string& status) const {
  static_cast<void>(sd_notify(0, ("READY=1\nSTATUS=" + status).c_str()));
}

void ServiceNotifier::Alive() const {
  static_cast<void>(sd_notify(0, "WATCHDOG=1"));
}

void ServiceNotifier::Status(const std::string& text) const {
  static_cast<void>(sd_notify(0, ("STATUS=" + text).c_str()));
}

void ServiceNotifier::Stopping() const {
  static_cast<void>(sd_notify(0, "STOPPING=1"));
}

std::optional<std::chrono::microseconds> ServiceNotifier::watchdog() const {
  std::uint64_t microseconds = 0;
  if (sd_watchdog_enabled(0, &microseconds) <= 0) return std::nullopt;
  return std::chrono::microseconds(microseconds);
}

}  // namespace cairn::server
