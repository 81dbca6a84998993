// The services that ROS 2 programs call (README.md, "Services"): the map of each site and, where ros2.commands allows
// it, commands, with names and types of slam_toolbox and of Nav2's map_server. A map is answered by the thread of the
// maps (map_wishes.h); a command goes to the desk as a native one does (command_calls.h), and what it does is told by
// the door, which calls CommandCalls::Tick on the same thread. Requests that find no room
// are answered as failed, or left out where the type has no word for that. Thread rule: Take and the counts from any
// thread, the rest on the thread of the bus, or while it does not run.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "common/ros2/services.h"
#include "common/wire/ros2/bus.h"
#include "server/outbound.h"
#include "server/ros2/command_calls.h"
#include "server/ros2/map_wishes.h"
#include "server/ros2/ros2_options.h"

namespace cairn::server {

// What the server can do, whoever asks.
struct ServerAbilities {
  bool keeps_sites = false;  // It has a directory of saved sites, and deletes sites.
  bool makes_sites = false;  // A robot that names an unknown site makes it.
};

// The results as ROS numbers them.
[[nodiscard]] std::uint8_t LoadMapResult(const Status& status);
[[nodiscard]] std::uint8_t SaveMapResult(const Status& status);

class Ros2Services {
 public:
  using Clock = CommandCalls::Clock;
  struct Doors {
    // Passes a request for a map on; false if there is no room for it.
    std::function<bool(MapWish&&)> want_map;
    // The robots of this site open new sessions.
    std::function<void(const std::string& site)> begin_anew;
  };

  // `commands` outlives the services.
  Ros2Services(ros2::Bus& bus, const Ros2Options& options, const ServerAbilities& abilities, CommandCalls& commands,
               Doors doors);

  void Take(const OutboundValue& value) CAIRN_EXCLUDES(news_mutex_);
  void Tick(Clock::time_point now) CAIRN_EXCLUDES(news_mutex_);
  // Ends all services. REQUIRES: the bus does not run.
  void Close();

  // Requests that found no room; that were not decoded; answers that were not delivered.
  [[nodiscard]] std::uint64_t overflow() const { return overflow_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t malformed() const { return malformed_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t unanswered() const { return unanswered_.load(std::memory_order_relaxed); }

 private:
  using Endpoints = std::vector<std::unique_ptr<ros2::Subscription>>;
  struct Site {
    std::string name;
    std::string topic_part;
    Endpoints endpoints;
  };
  // A request, with what answers it.
  template <typename S>
  struct Asked {
    ros2::Caller caller;
    std::shared_ptr<ros2::Answers<S>> answers;

    [[nodiscard]] std::uint64_t asker() const;
  };
  // Robots, one after the other.
  struct Round {
    std::uint64_t asker = 0;
    RequestKind kind = RequestKind::kPing;
    std::vector<std::string> robots;
    std::size_t next = 0;
    bool all = true;
  };

  [[nodiscard]] std::optional<std::pair<NameId, std::optional<std::string>>> NextNews() CAIRN_EXCLUDES(news_mutex_);
  void OpenSite(NameId site_id, const std::string& name);
  void EndSite(NameId site_id);
  void OfferAll(NameId site_id, Site& site);
  void OfferMap(NameId site_id, const std::string& service, Endpoints& endpoints);
  void OfferCommands(NameId site_id, Site& site);
  void OfferLoad();
  template <typename S>
  void Offer(const std::string& service, Endpoints& endpoints,
             std::function<void(typename S::Request&&, const Asked<S>&)> serve);
  // Sends the answer, or keeps it for a moment if nobody reads it yet.
  template <typename S>
  void Answer(const Asked<S>& asked, const typename S::Response& response);
  template <typename S>
  bool Send(const Asked<S>& asked, const typename S::Response& response);
  void SendLater();
  void CountMalformed();

  // What commands do (ros2_service_commands.cpp).
  void Load(ros2::LoadMap::Request&& request, const Asked<ros2::LoadMap>& asked);
  void Save(NameId site_id, const std::string& name, std::uint64_t asker, std::function<void(const Status&)> done);
  void TogglePause(NameId site_id, const Asked<ros2::Pause>& asked);
  void Reset(NameId site_id, const ros2::Reset::Request& request, const Asked<ros2::Reset>& asked);
  void EndAndDelete(const std::string& site, const Asked<ros2::Reset>& asked);
  void Delete(const std::string& site, int tries, const Asked<ros2::Reset>& asked);
  // Gets the sessions of the site that have not ended, or nothing if they cannot be known.
  using Sessions = std::optional<std::vector<SessionState>>;
  void WithSessions(const std::string& site, std::uint64_t asker, std::function<void(Sessions)> then);
  void ForEach(const std::shared_ptr<Round>& round, std::function<void(bool all)> then);

  ros2::Bus& bus_;
  const Ros2Options options_;
  const ServerAbilities abilities_;
  const Doors doors_;
  CommandCalls& commands_;
  Endpoints of_server_;
  std::map<NameId, Site> sites_;
  Clock::time_point now_{};  // Of the last Tick; the first one comes before the first request.
  // Answers that nobody reads yet; each says whether it has been sent.
  struct Undelivered {
    Clock::time_point deadline;
    std::function<bool()> send;
  };
  std::list<Undelivered> undelivered_;
  // Writers of answers that may have to be sent again, although their service is gone.
  struct Lingering {
    Clock::time_point until;
    std::shared_ptr<const void> writer;
  };
  std::list<Lingering> lingering_;
  std::uint64_t ended_refused_ = 0;  // Of endpoints that are gone.
  std::atomic<std::uint64_t> overflow_{0}, malformed_{0}, unanswered_{0};

  Mutex news_mutex_;
  // The sites that exist, by their names, or do not any more (nothing), since the last Tick.
  std::map<NameId, std::optional<std::string>> news_ CAIRN_GUARDED_BY(news_mutex_);
};

}  // namespace cairn::server
