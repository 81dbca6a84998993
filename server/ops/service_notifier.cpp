#include "server/ops/service_notifier.h"

#include <systemd/sd-daemon.h>

#include <cstdint>
#include <utility>

namespace cairn::server {

void ServiceNotifier::Ready(const std::string& status) const {
  static_cast<void>(sd_notify(0, ("READY=1\nSTATUS=" + status).c_str()));
}

void ServiceNotifier::Starting(const std::string& status, std::chrono::seconds longer) const {
  const auto microseconds = std::chrono::microseconds(longer).count();
  static_cast<void>(
      sd_notify(0, ("EXTEND_TIMEOUT_USEC=" + std::to_string(microseconds) + "\nSTATUS=" + status).c_str()));
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

bool ServiceNotifier::Failed(const std::string& why) const {
  return sd_notify(0, ("STATUS=cannot start: " + why).c_str()) != 0;
}

std::optional<std::chrono::microseconds> ServiceNotifier::watchdog() const {
  std::uint64_t microseconds = 0;
  if (sd_watchdog_enabled(0, &microseconds) <= 0) return std::nullopt;
  return std::chrono::microseconds(microseconds);
}

ServiceStatus::ServiceStatus(const ServiceNotifier& notifier, std::string serving)
    : notifier_(notifier), serving_(std::move(serving)), shown_(serving_) {}

void ServiceStatus::Losses(const std::string& text) {
  losses_ = text;
  Show();
}

void ServiceStatus::Degraded(const std::string& reason) {
  degraded_ = reason;
  Show();
}

void ServiceStatus::Show() {
  std::string line = serving_;
  if (!losses_.empty()) line = "messages lost between DDS and the server: " + losses_;
  if (!degraded_.empty()) line = "degraded, what arrives now is not durable: " + degraded_;
  if (line == shown_) return;
  notifier_.Status(line);
  shown_ = std::move(line);
}

}  // namespace cairn::server
