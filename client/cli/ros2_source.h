// Receives what the ROS 2 robots of a server publish, into the queue of a recorder, as the samples that robots of
// Cairn's would send. Which robots these are, and on which domain, it asks the server now and then (`cairn ros2
// doctor`); it joins that domain as a reader only. Thread rule: every method from any thread.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>

#include "client/cli/record_queue.h"
#include "client/cli/ros2_samples.h"
#include "client/lib/query_client.h"
#include "common/mutex.h"
#include "common/service/ros2_report.h"
#include "common/wire/ros2/bus.h"

namespace cairn::client {

class Ros2Source {
 public:
  // `bus` and `queue` outlive the source. `robots`: the robots that are wanted; empty: all.
  [[nodiscard]] static Result<std::unique_ptr<Ros2Source>> Create(wire::Bus& bus, RecordQueue& queue,
                                                                  std::set<NameId> robots);
  ~Ros2Source();
  Ros2Source(const Ros2Source&) = delete;
  Ros2Source& operator=(const Ros2Source&) = delete;

  // Why the domain of the ROS 2 robots cannot be joined; empty where it can, or where there is none.
  [[nodiscard]] std::string problem() const;

 private:
  struct Kept {
    ros2::Qos qos;
    std::unique_ptr<ros2::Subscription> subscription;
  };
  using Subscriptions = std::map<std::string, Kept>;  // By topic, as ROS shows it.
  struct Robot {
    Robot(const std::string& name, const ros2::FrameTree& shared) : samples(name, shared) {}
    Ros2Samples samples;
    Subscriptions subscriptions;  // Last: their callbacks use the samples.
  };

  Ros2Source(wire::Bus& bus, RecordQueue& queue, std::set<NameId> robots, std::unique_ptr<QueryClient> queries);
  void Ask(const std::stop_token& stop);
  void Join(std::int64_t domain);
  // The rest runs on the thread of the ROS 2 bus.
  void Tick();
  void Follow(const Ros2Namespace& one);
  void TakeShared(const ros2::Transforms& message, const ros2::Origin& origin, bool fixed);
  template <typename Message, typename Take>
  void Keep(Subscriptions& subscriptions, const std::string& topic, const ros2::Qos& qos, Take take);
  template <typename Sample>
  void Push(Sample&& sample);

  wire::Bus& native_;
  RecordQueue& queue_;
  const std::set<NameId> wanted_;
  mutable Mutex mutex_;
  CondVar stopping_;
  std::optional<Ros2Report> news_ CAIRN_GUARDED_BY(mutex_);  // The newest report, until the next tick.
  std::string problem_ CAIRN_GUARDED_BY(mutex_);

  // Of the asking thread.
  const std::unique_ptr<QueryClient> queries_;
  std::unique_ptr<ros2::Bus> bus_;

  // Of the bus's thread. What is subscribed to goes before the frames that the callbacks use.
  ros2::FrameTree shared_frames_;
  std::map<std::string, Robot> robots_;  // By namespace.
  Subscriptions shared_;

  std::jthread receiving_;
  std::jthread asking_;  // Last: it uses everything above.
};

}  // namespace cairn::client
