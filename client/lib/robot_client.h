// A robot's connection to the server: opens a session, sends scans and odometry no faster than the server settles them,
// and reports the server's ledgers and poses. It keeps the samples that are not safe on the server yet, and sends them
// again after the server or the client was not reachable. Scans that the server refused are counted in the ledger and
// not sent again.
// If the server does not know the session (for example because it was started again without its state), the client
// opens a new session by itself. This begins at the robot's present pose, and the samples that were not safe are sent
// again in it. Thread rule: every method from any thread; callbacks run on threads of the wire or of the client and
// must return soon. If the client is destroyed without End, the session is suspended, and another client of the same
// robot can continue it.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "client/lib/backlog.h"
#include "client/lib/scan_window.h"
#include "common/mutex.h"
#include "common/service/pose_report.h"
#include "common/wire/bus.h"

namespace cairn::client {

struct RobotClientOptions {
  std::uint64_t window = 32;                            // For each sensor (ScanWindow); 0: Publish never waits.
  double send_timeout_s = 5.0;                          // How long Publish waits for room before it gives up.
  double resend_after_s = 2.0;                          // If the ledger stands still for so long, sends again.
  std::size_t max_kept_bytes = std::size_t{64} << 20U;  // Memory for samples that are not safe yet.
  std::string spill_file;                               // For samples beyond this; if empty, the oldest are dropped.
};

class RobotClient {
 public:
  struct Callbacks {
    std::function<void(const Ledger&)> ledger;
    std::function<void(const PoseReport&)> pose;
    std::function<void(const SessionState&)> session;
    // A new session has replaced one that the server no longer knows.
    std::function<void(SessionToken session, const Pose2& T_map_robot_start)> restarted;
  };

  // Draws a client id and a session, and repeats the request until the server answers. If the server refuses, its
  // reason is the error. kUnavailable: no server answers. `request.sensors` names at least one stream.
  [[nodiscard]] static Result<std::unique_ptr<RobotClient>> Open(wire::Bus& bus, SessionRequest request,
                                                                 double timeout_s, Callbacks callbacks = {},
                                                                 const RobotClientOptions& options = {});
  ~RobotClient();

  // Numbers the sample and keeps it until the server has stored it; while no server listens, it is sent later. With a
  // window, a scan first waits for room in the stream's window. kUnavailable: no room within send_timeout_s, and the
  // scan was not taken; try the same scan again. kFailedPrecondition: the session has ended. kAlreadyExists: another
  // client has taken it over. The default sensor is the first one of the request.
  [[nodiscard]] Result<void> Publish(const Scan& scan);
  [[nodiscard]] Result<void> Publish(const Scan& scan, const std::string& sensor);
  [[nodiscard]] Result<void> Publish(const Odometry& odometry);

  // Waits until the server has settled every scan sent (kDeadlineExceeded).
  [[nodiscard]] Result<void> WaitSettled(double timeout_s);
  // Ends the session for good, and waits until the server confirms it.
  [[nodiscard]] Result<void> End(double timeout_s = 2.0);

  [[nodiscard]] ClientId id() const { return client_; }
  [[nodiscard]] SessionState session() const;
  [[nodiscard]] bool connected() const { return scans_->matched() > 0; }  // Whether a server listens right now.
  [[nodiscard]] std::optional<PoseReport> pose() const;
  [[nodiscard]] std::optional<Ledger> ledger() const;  // The ledger of the first sensor.
  [[nodiscard]] std::optional<Ledger> ledger(const std::string& sensor) const;
  [[nodiscard]] std::uint64_t resent() const { return resent_.load(std::memory_order_relaxed); }
  [[nodiscard]] int restarted() const { return restarted_.load(std::memory_order_relaxed); }  // New sessions opened.
  // Number of samples that were dropped before they were safe, because too many had to be kept; and why the spill file
  // did not take them.
  [[nodiscard]] std::uint64_t displaced() const;
  [[nodiscard]] std::string spill_error() const;

 private:
  struct Stream {
    explicit Stream(std::uint64_t size) : window(size) {}
    ScanWindow window;
    std::optional<Ledger> ledger;
  };
  using Clock = std::chrono::steady_clock;
  // Odometry belongs to the robot and not to one of its lasers, so its stream has a name of its own.
  static constexpr char kOdometrySensor[] = "odometry";

  RobotClient(SessionRequest request, Callbacks callbacks, const RobotClientOptions& options);
  [[nodiscard]] Result<void> Connect(wire::Bus& bus);
  [[nodiscard]] Result<void> AwaitSession(const wire::Bus& bus, double timeout_s);
  void OnSession(SessionState&& state);
  void OnRefusal(SessionRefusal&& refusal);
  void OnLedger(Ledger&& ledger);
  void OnPose(PoseReport&& report);
  void OnMatched(int servers);

  [[nodiscard]] Result<void> AwaitRoom(const Stream& stream) CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool Answered() const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool Streaming() const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool ReadyToReopen() const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] Pose2 StartOfNextSession() const CAIRN_REQUIRES(mutex_);
  Result<void> SendNow(const StreamedSample& sample) CAIRN_REQUIRES(sending_);
  Result<void> AddAndSend(StreamedSample&& sample, Stream& stream) CAIRN_REQUIRES(sending_);
  void Ask();
  void Reopen();
  void Pump();
  void Watch();

  const ClientId client_;
  const NameId robot_id_;
  const Callbacks callbacks_;
  const RobotClientOptions options_;
  std::atomic<std::uint64_t> resent_ = 0;
  std::atomic<int> restarted_ = 0;

  Mutex sending_;  // Held while samples are sent, so that they leave in order. Taken before mutex_.
  mutable Mutex mutex_;
  CondVar changed_;
  SessionRequest request_ CAIRN_GUARDED_BY(mutex_);            // The one last published.
  std::map<NameId, Stream> streams_ CAIRN_GUARDED_BY(mutex_);  // Sensors and odometry; fixed after construction.
  Backlog backlog_ CAIRN_GUARDED_BY(mutex_);
  std::size_t sent_before_ CAIRN_GUARDED_BY(mutex_) = 0;  // How many of the next samples were sent before.
  Generation generation_ CAIRN_GUARDED_BY(mutex_) = 0;    // The highest received.
  std::optional<SessionState> state_ CAIRN_GUARDED_BY(mutex_);
  bool answered_ CAIRN_GUARDED_BY(mutex_) = false;  // The server that answered is still there.
  bool reopening_ CAIRN_GUARDED_BY(mutex_) = false;
  std::optional<Status> over_ CAIRN_GUARDED_BY(mutex_);  // Why the session ended for good.
  std::optional<PoseReport> pose_ CAIRN_GUARDED_BY(mutex_);
  std::optional<Pose2> T_odom_robot_start_ CAIRN_GUARDED_BY(mutex_);  // Odometry when the session was opened.
  Clock::time_point asked_ CAIRN_GUARDED_BY(mutex_);
  Clock::time_point refused_ CAIRN_GUARDED_BY(mutex_);  // When reopening began.
  Clock::time_point progress_ CAIRN_GUARDED_BY(mutex_);
  bool stopping_ CAIRN_GUARDED_BY(mutex_) = false;

  std::unique_ptr<wire::Publication<SessionRequest>> session_;
  std::unique_ptr<wire::Publication<ScanSample>> scans_;
  std::unique_ptr<wire::Publication<OdometrySample>> odometry_;
  std::vector<std::unique_ptr<wire::Subscription>> subscriptions_;
  std::thread watcher_;
};

}  // namespace cairn::client
