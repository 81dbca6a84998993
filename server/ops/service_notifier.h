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
  // The start goes on, and may take so much longer from now on.
  void Starting(const std::string& status, std::chrono::seconds longer) const;
  void Alive() const;
  // One line that the service manager shows beside the service (systemctl status).
  void Status(const std::string& text) const;
  void Stopping() const;
  // The start has failed. Returns whether a service manager started the process.
  [[nodiscard]] bool Failed(const std::string& why) const;
  // The longest allowed time between two calls of Alive; nothing if no watchdog is configured.
  [[nodiscard]] std::optional<std::chrono::microseconds> watchdog() const;
};

// The line beside the service: that the store fails, else what was lost, else what the service does. It is sent when it
// changes. Not thread-safe: one owner.
class ServiceStatus {
 public:
  // `serving` is the line that Ready has sent.
  ServiceStatus(const ServiceNotifier& notifier, std::string serving);
  // Shown from now on; empty: nothing was lost.
  void Losses(const std::string& text);
  // Shown until the reason is empty again, because the store works.
  void Degraded(const std::string& reason);

 private:
  void Show();

  const ServiceNotifier& notifier_;
  const std::string serving_;
  std::string losses_;
  std::string degraded_;
  std::string shown_;
};

}  // namespace cairn::server
