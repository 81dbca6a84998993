// A robot's connection to the server: opens a session, sends scans and odometry no faster than the server settles them,
// and reports the server's ledgers and poses. It keeps the samples that are not safe on the server yet, and sends them
// again after the server or the client was not reachable. Scans that the server refused are counted in the ledger and
// not sent again.
// If the server does not know the session (for example because it was started again without its state), the client
// opens a new session by itself. This begins at the robot's present pose, and the samples that were not safe are sent
// again in it. Where the pose is not known, because the robot was not localized, its odometry began anew, or scans are
// missing for some time, in which somebody may have carried it, the new session has no start pose.
// If what the client sends does not arrive for two seconds although a server is there, or nothing is received from that
// server, the session is `stale`: damaged or forged messages can make a reader or a writer ignore its peer for good.
// The client then joins the domain again, as another participant, and continues the same session; what had arrived is
// not counted twice. An overloaded server does not make a session stale: its ledger says what has arrived, and it
// answers requests, however late it settles scans. Thread rule: every method from any thread; callbacks run on threads
// of the wire or of the client and must return soon. If the client is destroyed without End, the session is suspended,
// and another client of the same robot can continue it.
#pragma once

#include <atomic>
#include <deque>
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
    // A new session has replaced one that the server no longer knows. The start is the identity if the robot was not
    // localized: then the request says none.
    std::function<void(SessionToken session, const Pose2& T_map_robot_start)> restarted;
  };

  // `bus` must outlive the client. Draws a client id and a session, and repeats the request until the server answers.
  // If the server refuses, its reason is the error; where that is kUnavailable or kResourceExhausted, only once the
  // request was repeated until the timeout. kUnavailable: no server answers. `request.sensors` names at least one
  // stream.
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
  // Waits until the server will not need anything of what was sent again (kDeadlineExceeded): scans and odometry are on
  // its disk, or settled if it stores nothing. A program that ends earlier may leave a server that is killed at this
  // moment without its last samples.
  [[nodiscard]] Result<void> WaitSafe(double timeout_s);
  // Ends the session for good, and waits until the server confirms it.
  [[nodiscard]] Result<void> End(double timeout_s = 2.0);

  [[nodiscard]] ClientId id() const { return client_; }
  // `stale` and the reason in `status` where the session stands still; see above.
  [[nodiscard]] SessionState session() const;
  [[nodiscard]] bool connected() const;  // Whether a server is there right now.
  [[nodiscard]] std::optional<PoseReport> pose() const;
  [[nodiscard]] std::optional<Ledger> ledger() const;  // The ledger of the first sensor.
  [[nodiscard]] std::optional<Ledger> ledger(const std::string& sensor) const;
  [[nodiscard]] std::uint64_t resent() const { return resent_.load(std::memory_order_relaxed); }
  [[nodiscard]] int restarted() const { return restarted_.load(std::memory_order_relaxed); }  // New sessions opened.
  [[nodiscard]] int renewed() const { return renewed_.load(std::memory_order_relaxed); }      // Times it joined again.
  // Number of samples that were dropped before they were safe, because too many had to be kept; and why the spill file
  // did not take them.
  [[nodiscard]] std::uint64_t displaced() const;
  [[nodiscard]] std::string spill_error() const;
  [[nodiscard]] std::uint64_t spilled_bytes() const;  // In the spill file, which has no name.

 private:
  struct Stream {
    explicit Stream(std::uint64_t size) : window(size) {}
    ScanWindow window;
    std::optional<Ledger> ledger;
    std::uint64_t sent = 0;                            // The highest number that was put on the wire.
    std::uint64_t arrived = 0;                         // The highest one that the server says it has received.
    std::chrono::steady_clock::time_point moved{};     // When `arrived` changed, or had been all that was sent.
    std::chrono::steady_clock::time_point advanced{};  // When `arrived` changed.
    bool first = false;                                // The next ledger is the first one since the client joined anew.
  };
  using Clock = std::chrono::steady_clock;
  // What connects the client with the servers of the domain.
  struct Wire {
    int number = 0;                  // Counts the wires of this client.
    std::unique_ptr<wire::Bus> own;  // Null for the first, which uses the caller's.
    wire::Bus* bus = nullptr;
    std::unique_ptr<wire::Publication<SessionRequest>> session;
    std::unique_ptr<wire::Publication<ScanSample>> scans;
    std::unique_ptr<wire::Publication<OdometrySample>> odometry;
    std::vector<std::unique_ptr<wire::Subscription>> subscriptions;
  };
  // Odometry belongs to the robot and not to one of its lasers, so its stream has a name of its own.
  static constexpr char kOdometrySensor[] = "odometry";

  RobotClient(SessionRequest request, Callbacks callbacks, const RobotClientOptions& options);
  [[nodiscard]] Result<void> Advertise(Wire& wire);
  [[nodiscard]] Result<void> Subscribe(Wire& wire);
  template <typename Value>
  [[nodiscard]] Result<void> SubscribeTo(Wire& wire, void (RobotClient::*on_value)(Value&&),
                                         wire::SubscriptionEvents events = {});
  [[nodiscard]] Result<void> Connect(wire::Bus& bus);
  [[nodiscard]] Result<void> AwaitSession(const wire::Bus& bus, double timeout_s);
  void OnSession(SessionState&& state);
  void KeepMapFrame(const SessionState& state) CAIRN_REQUIRES(mutex_);
  void OnRefusal(SessionRefusal&& refusal);
  void OnLedger(Ledger&& ledger);
  void OnPose(PoseReport&& report);
  void OnMatched(int servers);

  [[nodiscard]] std::uint64_t GoneThrough(NameId sensor_id, const Stream& stream) const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] Result<void> AwaitRoom(NameId sensor_id, const Stream& stream) CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool Answered() const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool IsSafe(const Stream& stream) const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool MustTellFrame() const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool Streaming() const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool ReadyToReopen() const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] std::optional<Pose2> StartOfNextSession() const CAIRN_REQUIRES(mutex_);
  void WatchOdometry(const Odometry& odometry) CAIRN_REQUIRES(mutex_);
  // Whether the odometry at the two stamps is that of one drive, as far as this client has seen it.
  [[nodiscard]] bool IsOneDrive(Stamp a, Stamp b) const CAIRN_REQUIRES(mutex_);
  Result<void> SendNow(const StreamedSample& sample) CAIRN_REQUIRES(sending_);
  Result<void> AddAndSend(StreamedSample&& sample, Stream& stream) CAIRN_REQUIRES(sending_);
  void Ask();
  void Reopen();
  void Pump();
  void Watch();
  // robot_client_recovery.cpp.
  [[nodiscard]] std::shared_ptr<Wire> CurrentWire() const;
  void Sent(NameId sensor_id, std::uint64_t number) CAIRN_REQUIRES(mutex_);
  static void Arrived(Stream& stream, std::uint64_t through);
  [[nodiscard]] std::string Silence(Clock::time_point now) CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool Moving() const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool RenewalDue(Clock::time_point now) CAIRN_REQUIRES(mutex_);
  // Whether every sample has settled.
  [[nodiscard]] bool Settled() const CAIRN_REQUIRES(mutex_);
  void StartOver(Clock::time_point now) CAIRN_REQUIRES(mutex_);
  void Recover();
  void Renew();
  void DropRetired();

  const ClientId client_;
  const std::string robot_;
  const NameId robot_id_;
  const Callbacks callbacks_;
  const RobotClientOptions options_;
  std::atomic<std::uint64_t> resent_ = 0;
  std::atomic<int> restarted_ = 0;
  std::atomic<int> renewed_ = 0;

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
  std::optional<Status> over_ CAIRN_GUARDED_BY(mutex_);     // Why the session ended for good.
  std::optional<Status> not_yet_ CAIRN_GUARDED_BY(mutex_);  // The last refusal that means: repeat the request.
  std::optional<PoseReport> pose_ CAIRN_GUARDED_BY(mutex_);
  std::optional<Odometry> start_odometry_ CAIRN_GUARDED_BY(mutex_);  // When the session was opened.
  // The last two samples of odometry, and the stamps at which it began anew, the oldest first.
  std::deque<Odometry> newest_odometry_ CAIRN_GUARDED_BY(mutex_);
  std::deque<Stamp> began_anew_ CAIRN_GUARDED_BY(mutex_);
  bool start_unknown_ CAIRN_GUARDED_BY(mutex_) = false;  // The robot was not localized when this session was opened.
  bool scans_used_ CAIRN_GUARDED_BY(mutex_) = false;     // A server has used scans of this session.
  Clock::time_point asked_ CAIRN_GUARDED_BY(mutex_);
  std::uint64_t told_frame_ CAIRN_GUARDED_BY(mutex_) = 0;  // Of the newest request that was published.
  Clock::time_point refused_ CAIRN_GUARDED_BY(mutex_);     // When reopening began.
  Clock::time_point progress_ CAIRN_GUARDED_BY(mutex_);
  // Largest number of scans that were sent again and have not settled. At first fewer than fit into the server's queue
  // and the writer's history. Doubled with each time that all is sent again and nothing has settled: the server may
  // wait for odometry that stands behind these scans.
  static constexpr std::uint64_t kFirstPace = 32, kLastPace = 4096;
  std::uint64_t pace_ CAIRN_GUARDED_BY(mutex_) = kFirstPace / 2;
  bool stopping_ CAIRN_GUARDED_BY(mutex_) = false;

  // Recovery.
  std::string stale_ CAIRN_GUARDED_BY(mutex_);                // Why the session stands still; empty: it does not.
  Clock::time_point answered_at_ CAIRN_GUARDED_BY(mutex_);    // Last time the session was open, or no server was there.
  Clock::time_point connected_at_ CAIRN_GUARDED_BY(mutex_);   // Last time a server was there.
  Clock::time_point sent_at_ CAIRN_GUARDED_BY(mutex_);        // Last sample put on the wire,
  Clock::time_point sending_since_ CAIRN_GUARDED_BY(mutex_);  // and the first one after which there was no pause.
  Clock::time_point called_stale_ CAIRN_GUARDED_BY(mutex_);   // By the server, since when.
  Clock::time_point renewed_at_ CAIRN_GUARDED_BY(mutex_);
  Clock::duration renewal_pause_ CAIRN_GUARDED_BY(mutex_){};
  std::uint64_t refused_at_renewal_ CAIRN_GUARDED_BY(mutex_) = 0;

  std::atomic<int> current_ = 0;  // The wire whose values count.
  std::shared_ptr<Wire> wire_ CAIRN_GUARDED_BY(mutex_);
  std::vector<std::shared_ptr<Wire>> retired_;  // Those before, until the server has answered. The watcher's.
  std::thread watcher_;
};

}  // namespace cairn::client
