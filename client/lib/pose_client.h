// Follows the poses that the server publishes for one robot. Not a history: it receives only what is published while it
// exists, and where the reader is slow, the oldest waiting poses are dropped. Poses of an earlier generation of the
// server than one seen before are ignored. Where nothing arrives although the server has new poses, it joins the
// domain anew (SilenceWatch). (QueryClient::Path has all poses.)
// Thread rule: every method from any thread, but Next not from a callback of the wire.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "client/lib/query_client.h"
#include "client/lib/silence_watch.h"
#include "common/bounded_channel.h"
#include "common/mutex.h"
#include "common/service/pose_report.h"
#include "common/wire/bus.h"

namespace cairn::client {

class PoseClient {
 public:
  static constexpr std::size_t kMaxWaiting = 4096;

  [[nodiscard]] static Result<std::unique_ptr<PoseClient>> Create(wire::Bus& bus, const std::string& robot);
  ~PoseClient();

  // The oldest pose that waits, or the next one that arrives; nothing if none arrives within the timeout.
  [[nodiscard]] std::optional<PoseReport> Next(double timeout_s);
  // Poses dropped because kMaxWaiting others were waiting.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  [[nodiscard]] int renewed() const;  // Times it joined anew.

 private:
  struct Wire {
    std::unique_ptr<wire::Bus> own;  // Null for the first, which uses the caller's.
    std::unique_ptr<wire::Subscription> poses;
  };
  struct Newest {
    Generation generation = 0;
    Stamp stamp = 0;
    bool operator==(const Newest&) const = default;
  };

  PoseClient(wire::Bus& bus, const std::string& robot);
  [[nodiscard]] Result<std::unique_ptr<Wire>> Connect(wire::Bus& bus, int number);
  void OnPose(int number, PoseReport&& pose);
  [[nodiscard]] bool Behind(QueryClient& queries);
  void Renew();

  wire::Bus& bus_;
  const std::string robot_;
  const NameId robot_id_;
  BoundedChannel<PoseReport> waiting_{kMaxWaiting};
  std::atomic<std::uint64_t> dropped_ = 0;
  mutable Mutex mutex_;
  Newest arrived_ CAIRN_GUARDED_BY(mutex_);
  int number_ CAIRN_GUARDED_BY(mutex_) = 0;  // The number of the wire whose poses count.
  Newest answered_;                          // What the watch was told last.
  SilenceWatch watch_;
  // Last: its callback uses everything above.
  std::unique_ptr<Wire> wire_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::client
