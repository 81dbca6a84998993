// Receives everything of the native domain that a recorder may write, into a queue (robots on ROS 2: ros2_source.h). It
// only reads: no server or robot is asked for anything, except that where nothing arrives although the server has new
// poses, it joins the domain anew (SilenceWatch). Thread rule: every method from any thread.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <vector>

#include "client/cli/record_queue.h"
#include "client/lib/query_client.h"
#include "client/lib/silence_watch.h"
#include "common/mutex.h"
#include "common/wire/bus.h"

namespace cairn::client {

struct RecordSourceOptions {
  bool samples = true;      // Scans and odometry. With DDS Security, a viewer may not read them.
  std::set<NameId> robots;  // Samples of these; empty: of all.
};

class RecordSource {
 public:
  // `bus` and `queue` outlive the source. kPermissionDenied: the permissions do not allow it.
  [[nodiscard]] static Result<std::unique_ptr<RecordSource>> Create(wire::Bus& bus, RecordQueue& queue,
                                                                    const RecordSourceOptions& options);
  ~RecordSource();

  [[nodiscard]] int scan_writers() const;  // Robots' streams of scans that it receives.
  [[nodiscard]] int renewed() const;       // Times it joined anew.

 private:
  struct Wire {
    std::unique_ptr<wire::Bus> own;  // Null for the first, which uses the caller's.
    std::vector<std::unique_ptr<wire::Subscription>> subscriptions;
    wire::Subscription* scans = nullptr;  // One of them; null without samples.
  };
  using NewestPoses = std::map<NameId, std::pair<Generation, Stamp>>;  // By robot.

  RecordSource(wire::Bus& bus, RecordQueue& queue, const RecordSourceOptions& options);
  [[nodiscard]] Result<std::unique_ptr<Wire>> Connect(wire::Bus& bus, int number);
  template <typename Value>
  [[nodiscard]] Result<void> Subscribe(wire::Bus& bus, int number, Wire& wire);
  template <typename Value>
  void OnValue(int number, Value&& value);
  [[nodiscard]] bool Behind(QueryClient& queries);
  void Renew();

  wire::Bus& bus_;
  RecordQueue& queue_;
  const RecordSourceOptions options_;
  mutable Mutex mutex_;
  NewestPoses arrived_ CAIRN_GUARDED_BY(mutex_);
  int number_ CAIRN_GUARDED_BY(mutex_) = 0;  // The number of the wire whose values count.
  NewestPoses answered_;                     // What the watch was told last; of its thread.
  SilenceWatch watch_;
  // Last: its callbacks use everything above.
  std::unique_ptr<Wire> wire_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::client
