// What the server says about robots, maps and jobs, asked again and again by one thread, however many people look: four
// times a second while somebody does, else every two seconds. A server that is gone is asked on; what it said last
// stays, marked as old. Bounded: kMaxSites sites with kMaxSamples figures each.
// Thread rule: every method from any thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "client/lib/query_client.h"
#include "client/web/stray_streams.h"
#include "common/mutex.h"
#include "common/wire/bus.h"

namespace cairn::web {

inline constexpr std::size_t kMaxSites = 64;
inline constexpr std::size_t kMaxSamples = 300;  // Five minutes.

// The scans of a site in one second, for plots.
struct FlowSample {
  std::int64_t time_ms = 0;  // Of this machine's clock, since 1970.
  double used_per_s = 0.0;
  double dropped_per_s = 0.0;
  double latency_p50_ms = 0.0;  // Of the robot with the highest one.
  double latency_p99_ms = 0.0;
};
using Flow = std::vector<FlowSample>;

struct ServerView {
  std::uint64_t number = 0;  // Grows with each view.
  bool connected = false;
  std::int64_t answered_ms = 0;  // When the server answered last, by this machine's clock since 1970; 0: never.
  std::string version;
  client::StatusAnswer status;
  std::vector<MapInfo> maps;
  std::vector<Job> jobs;
  std::map<std::string, std::shared_ptr<const Flow>> flows;  // By site.
  std::shared_ptr<const Ros2Report> ros2;                    // Null where the server serves no ROS 2 robots.
  std::vector<StrayStream> strays;                           // Robots that have no session.

  [[nodiscard]] std::set<std::string> Sites() const;
  [[nodiscard]] const MapInfo* Map(const std::string& site) const;
};

class ServerWatch {
 public:
  // `bus` outlives the watch.
  [[nodiscard]] static Result<std::unique_ptr<ServerWatch>> Create(wire::Bus& bus);
  ~ServerWatch();

  [[nodiscard]] std::shared_ptr<const ServerView> view() const;
  // Waits until there is a view after this number, at most so long, and returns the newest.
  [[nodiscard]] std::shared_ptr<const ServerView> WaitForNewer(std::uint64_t number, std::chrono::milliseconds most);

  // One person more looks, until the returned value is gone.
  [[nodiscard]] std::shared_ptr<void> Look();
  // Asks at once: something was changed by a command.
  void AskNow();

 private:
  using Clock = std::chrono::steady_clock;
  struct Counts {
    std::uint64_t used = 0;
    std::uint64_t dropped = 0;
  };

  ServerWatch(std::unique_ptr<client::QueryClient> queries, std::unique_ptr<StrayStreams> strays)
      : queries_(std::move(queries)), strays_(std::move(strays)) {}
  void Run();
  [[nodiscard]] ServerView Ask();
  void AddLists(ServerView& view);
  void AddFlows(ServerView& view);
  void Publish(ServerView&& view);

  const std::unique_ptr<client::QueryClient> queries_;
  const std::unique_ptr<StrayStreams> strays_;
  // Of the thread.
  std::map<std::string, Counts> counted_;
  Clock::time_point sampled_{};
  std::map<std::string, std::shared_ptr<const Flow>> flows_;
  Clock::time_point listed_{};  // When maps and jobs were asked for.

  mutable Mutex mutex_;
  CondVar changed_;
  std::shared_ptr<const ServerView> view_ CAIRN_GUARDED_BY(mutex_) = std::make_shared<ServerView>();
  int looking_ CAIRN_GUARDED_BY(mutex_) = 0;
  bool asked_for_ CAIRN_GUARDED_BY(mutex_) = false;
  bool stopping_ CAIRN_GUARDED_BY(mutex_) = false;
  std::thread thread_;  // Last: it uses everything above.
};

}  // namespace cairn::web
