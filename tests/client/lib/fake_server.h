// A server as clients see it, without an estimator: sessions, ledgers, a pose for every scan, and answers. What it does
// not do (settle, answer) can be switched off, to see how clients wait.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "common/wire/bus.h"

namespace cairn::test {

class FakeServer {
 public:
  explicit FakeServer(const wire::WireOptions& options, Generation generation = 1);
  ~FakeServer();

  // A stopped server receives scans but settles none; resuming settles all it has.
  void SetSettling(bool settling);
  void SetLocalized(bool localized);  // Whether its poses are.
  // Poses are not kept for late readers: a test that waits for the pose of one scan waits for this first.
  [[nodiscard]] bool HasPoseReader() const { return poses_->matched() > 0; }
  // The server says that it stores; nothing is on disk until SetDurableThrough.
  void SetDurable(bool durable);
  void SetDurableThrough(std::uint64_t sequence);
  // Begins a later generation that knows its sessions and the scans that were durable, and nothing else.
  void Restart(Generation generation);
  void SetAnswering(bool answering);
  void IgnorePings(int count);  // So many pings are not answered.
  void SayStale();              // That nothing of a stream arrives.
  // Of all that is sent from now on; 1 at first.
  void SetGeneration(Generation generation);
  void IgnoreSessions(int count);  // So many session requests are not answered.
  void RefuseSessions(int count, const Status& why);
  // Scans with this number are lost on their way, once.
  void LoseOnce(std::uint64_t sequence);

  // Questions about the newest pose of the robot, or about the map, are answered with the last one from then on.
  void Publish(const PoseReport& pose);
  void Publish(const MapInfo& info);
  void Publish(const TileSample& sample);

  // The sessions asked for, in order of the requests.
  [[nodiscard]] std::vector<SessionRequest> sessions() const;
  [[nodiscard]] std::vector<std::uint64_t> received() const;  // Numbers in order of arrival, duplicates left out.
  [[nodiscard]] ScanSample last_scan() const;
  [[nodiscard]] int odometry_received() const;
  [[nodiscard]] std::vector<RequestKind> asked() const;
  [[nodiscard]] std::vector<std::uint64_t> pings() const;  // The numbers of those that have arrived.
  [[nodiscard]] std::uint64_t datagrams_refused() const { return bus_->datagrams_refused(); }

  static constexpr std::uint64_t kMapFrame = 77;
  // Tile queries are answered with so many parts of one tile of 50 KB each, which hold no image; those about the site
  // `drawn` with one tile of occupied cells.
  static constexpr std::uint32_t kTileParts = 40;
  // Sites have map versions 1 to kMapVersions. The last one is enabled at first.
  static constexpr std::uint32_t kMapVersions = 3;
  static constexpr int kAnswersUntilJobEnds = 3;  // A job runs until it was asked for so often.

 private:
  void OnSession(SessionRequest&& request);
  void OnScan(ScanSample&& sample);
  void OnRequest(Request&& request);
  [[nodiscard]] std::vector<MapInfo> published_maps() const;
  [[nodiscard]] MapInfo MapOf(const std::string& site);
  void Report(const StreamId& stream) CAIRN_REQUIRES(mutex_);

  struct Account {
    StreamId stream;
    std::set<std::uint64_t> seen;
    std::uint64_t settled = 0;
  };

  mutable Mutex mutex_;
  bool settling_ CAIRN_GUARDED_BY(mutex_) = true;
  std::atomic<bool> localized_ = true;
  bool durable_ CAIRN_GUARDED_BY(mutex_) = false;
  bool stale_ CAIRN_GUARDED_BY(mutex_) = false;
  std::uint64_t durable_through_ CAIRN_GUARDED_BY(mutex_) = 0;
  bool answering_ CAIRN_GUARDED_BY(mutex_) = true;
  int ignored_pings_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::vector<std::uint64_t> pings_ CAIRN_GUARDED_BY(mutex_);
  std::set<std::uint64_t> to_lose_ CAIRN_GUARDED_BY(mutex_);
  Generation generation_ CAIRN_GUARDED_BY(mutex_);
  int sessions_to_ignore_ CAIRN_GUARDED_BY(mutex_) = 0;
  int sessions_to_refuse_ CAIRN_GUARDED_BY(mutex_) = 0;
  Status why_refused_ CAIRN_GUARDED_BY(mutex_);
  std::vector<SessionRequest> asked_sessions_ CAIRN_GUARDED_BY(mutex_);
  std::map<std::string, SessionRequest> owners_ CAIRN_GUARDED_BY(mutex_);
  std::map<NameId, Account> accounts_ CAIRN_GUARDED_BY(mutex_);
  std::vector<std::uint64_t> received_ CAIRN_GUARDED_BY(mutex_);
  ScanSample last_scan_ CAIRN_GUARDED_BY(mutex_);
  int odometry_received_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::vector<RequestKind> asked_ CAIRN_GUARDED_BY(mutex_);
  std::uint32_t enabled_version_ CAIRN_GUARDED_BY(mutex_) = kMapVersions;
  std::map<std::uint64_t, int> asked_for_job_ CAIRN_GUARDED_BY(mutex_);
  std::map<std::string, PoseReport> published_poses_ CAIRN_GUARDED_BY(mutex_);  // The last one of each robot.
  std::map<std::string, MapInfo> published_maps_ CAIRN_GUARDED_BY(mutex_);

  std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<wire::Publication<SessionState>> sessions_;
  std::unique_ptr<wire::Publication<SessionRefusal>> refusals_;
  std::unique_ptr<wire::Publication<Ledger>> ledgers_;
  std::unique_ptr<wire::Publication<PoseReport>> poses_;
  std::unique_ptr<wire::Publication<MapInfo>> maps_;
  std::unique_ptr<wire::Publication<TileSample>> tiles_;
  std::unique_ptr<wire::Publication<Reply>> replies_;
  std::vector<std::unique_ptr<wire::Subscription>> subscriptions_;  // Last: their callbacks use everything above.
};

}  // namespace cairn::test
