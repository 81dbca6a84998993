// A robot's side of its session: opens it, streams scans and odometry no faster than the server settles them, keeps
// what the server may need again, and sends that again after either side was away. Reports the server's ledger and
// poses. Scans that the server refused are counted in the ledger and not sent again. Thread rule:
// every method from any thread; callbacks run on the wire's threads and must return soon. Destroying it without End
// leaves the session suspended, to be taken up by a client of the same robot.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "client/lib/scan_window.h"
#include "common/mutex.h"
#include "common/service/pose_report.h"
#include "common/wire/bus.h"

namespace cairn::client {

struct RobotClientOptions {
  ScanWindowOptions window;     // One window per sensor.
  double send_timeout_s = 5.0;  // How long Publish waits for room before it gives up.
  double resend_after_s = 2.0;  // Without progress of the ledger, unsettled scans are sent again.
};

class RobotClient {
 public:
  struct Callbacks {
    std::function<void(const Ledger&)> ledger;
    std::function<void(const PoseReport&)> pose;
    std::function<void(const SessionState&)> session;
  };

  // Sends the request under a client id of its own and waits for the server's answer. Where the server refuses,
  // its reason is the error; kUnavailable means that no server answers. `request.sensors` names at least one stream.
  [[nodiscard]] static Result<std::unique_ptr<RobotClient>> Open(wire::Bus& bus, SessionRequest request,
                                                                 double timeout_s, Callbacks callbacks = {},
                                                                 const RobotClientOptions& options = {});
  ~RobotClient();

  // Waits for room in the stream's window. A scan without sequence gets the next one. kUnavailable: no room within
  // send_timeout_s, try the same scan again; kFailedPrecondition: the session is over. The sensor is the request's
  // first, or the one named.
  [[nodiscard]] Result<void> Publish(const Scan& scan);
  [[nodiscard]] Result<void> Publish(const Scan& scan, const std::string& sensor);
  [[nodiscard]] Result<void> Publish(const Odometry& odometry);

  // Waits until the server has settled every scan sent (kDeadlineExceeded).
  [[nodiscard]] Result<void> WaitSettled(double timeout_s);
  // Ends the session for good, and waits until the server confirms it.
  [[nodiscard]] Result<void> End(double timeout_s = 2.0);

  [[nodiscard]] ClientId id() const { return request_.client; }
  [[nodiscard]] SessionState session() const;
  [[nodiscard]] bool connected() const { return scans_->matched() > 0; }  // Whether a server listens right now.
  [[nodiscard]] std::optional<PoseReport> pose() const;
  [[nodiscard]] std::optional<Ledger> ledger() const;  // The ledger of the first sensor.
  [[nodiscard]] std::optional<Ledger> ledger(const std::string& sensor) const;
  [[nodiscard]] std::uint64_t resent() const { return resent_.load(std::memory_order_relaxed); }

 private:
  struct Stream {
    explicit Stream(const ScanWindowOptions& options) : window(options) {}
    ScanWindow window;
    std::optional<Ledger> ledger;
  };

  RobotClient(SessionRequest request, Callbacks callbacks, const RobotClientOptions& options);
  [[nodiscard]] Result<void> Connect(wire::Bus& bus);
  [[nodiscard]] Result<void> AwaitSession(const wire::Bus& bus, double timeout_s);
  void OnSession(SessionState&& state);
  void OnLedger(Ledger&& ledger);
  void OnPose(PoseReport&& report);
  [[nodiscard]] Result<void> AwaitRoom(const Stream& stream) CAIRN_REQUIRES(mutex_);
  void Resend();
  void Watch();

  SessionRequest request_;
  const NameId robot_id_;
  const Callbacks callbacks_;
  const RobotClientOptions options_;
  std::atomic<std::uint64_t> resent_ = 0;

  Mutex sending_;  // Held while scans are sent, so that resent ones do not overtake new ones. Taken before mutex_.
  mutable Mutex mutex_;
  CondVar changed_;
  std::map<NameId, Stream> streams_ CAIRN_GUARDED_BY(mutex_);  // By sensor; fixed after construction.
  std::optional<SessionState> state_ CAIRN_GUARDED_BY(mutex_);
  std::optional<PoseReport> pose_ CAIRN_GUARDED_BY(mutex_);
  std::uint64_t odometry_sequence_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::chrono::steady_clock::time_point progress_ CAIRN_GUARDED_BY(mutex_);
  bool resend_ CAIRN_GUARDED_BY(mutex_) = false;
  bool stopping_ CAIRN_GUARDED_BY(mutex_) = false;

  std::unique_ptr<wire::Publication<SessionRequest>> session_;
  std::unique_ptr<wire::Publication<ScanSample>> scans_;
  std::unique_ptr<wire::Publication<OdometrySample>> odometry_;
  std::vector<std::unique_ptr<wire::Subscription>> subscriptions_;
  std::thread watcher_;
};

}  // namespace cairn::client
