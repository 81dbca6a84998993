// What the server says of robots and maps, on its way to ROS 2: for each scan used, while the robot is localized, its
// pose and the transform from map to odom; for each site its map, whole and as updates. A robot that is not localized
// gets neither, so that its transform grows old and whoever drives it stops. See never waits: poses wait in a bounded
// queue (the newest is left out when it is full), and of every tile only the newest version waits. Thread rule: See,
// Serve and Leave from any thread; two threads of its own publish.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/bounded_channel.h"
#include "common/mutex.h"
#include "common/wire/ros2/bus.h"
#include "server/outbound.h"
#include "server/ros2/failures.h"
#include "server/ros2/map_wishes.h"
#include "server/ros2/ros2_ingress.h"
#include "server/ros2/site_grid.h"

namespace cairn::server {

class Ros2Egress {
 public:
  Ros2Egress(ros2::Bus& bus, const Ros2Options& options);
  ~Ros2Egress();

  void Start();
  // Publishes what waits, and ends. See does nothing afterwards.
  void Finish();
  void See(const OutboundValue& value);
  // Makes the topics of a robot, or moves them.
  void Serve(const RobotAddress& address) CAIRN_EXCLUDES(mutex_);
  // Deletes the topics of a robot.
  void Leave(NameId robot_id) CAIRN_EXCLUDES(mutex_);

  // Has a request for the map of a site answered by the thread of the maps; false if there is no room for it. From any
  // thread.
  [[nodiscard]] bool WantMap(MapWish&& wish) { return wishes_.Add(std::move(wish)); }

  // Values that found no room, that the middleware did not accept, or whose publication ended with an exception.
  [[nodiscard]] std::uint64_t unpublished() const {
    return unpublished_.load(std::memory_order_relaxed) + poses_failed_.count() + maps_failed_.count();
  }
  // Sites whose map is too large for one message.
  [[nodiscard]] std::vector<std::string> problems() const CAIRN_EXCLUDES(mutex_);

 private:
  template <typename Message>
  using Publication = std::shared_ptr<ros2::Publication<Message>>;
  struct Robot {
    RobotAddress address;
    Publication<ros2::PoseWithCovariance> pose;
    Publication<ros2::Transforms> tf;
  };
  struct Site {
    SiteGrid grid;
    Publication<ros2::Grid> map;
    Publication<ros2::GridUpdate> updates;
    int listeners = 0;
  };
  // What waits for the thread of the maps.
  struct News {
    bool gone = false;  // The site was deleted, before what follows.
    std::optional<MapInfo> info;
    std::map<TileKey, TileSample> tiles;

    void MakeNewer(News&& newer);
  };

  void RunPoses();
  void Publish(const PoseReport& report);
  void RunMaps();
  // Takes over the news of the sites whose names are known.
  void TakeNews() CAIRN_EXCLUDES(news_mutex_);
  void PublishMaps();
  void AnswerWishes();
  Site& SiteOf(NameId site_id, const MapInfo& info);
  void Count(const Result<void>& published);

  ros2::Bus& bus_;
  const Ros2Options options_;
  BoundedChannel<PoseReport> poses_;
  std::atomic<std::uint64_t> unpublished_{0};
  mutable Mutex mutex_;
  std::map<NameId, std::shared_ptr<const Robot>> robots_ CAIRN_GUARDED_BY(mutex_);
  std::vector<std::string> too_large_ CAIRN_GUARDED_BY(mutex_);
  Mutex news_mutex_;
  CondVar news_came_;
  bool finished_ CAIRN_GUARDED_BY(news_mutex_) = false;
  std::map<NameId, News> news_ CAIRN_GUARDED_BY(news_mutex_);
  MapWishes wishes_;
  Failures poses_failed_{"a pose for ROS 2"};
  Failures maps_failed_{"a map for ROS 2"};
  // Used by the thread of the maps only. News stay until they are in the grid, also if an exception comes between.
  std::map<NameId, News> taken_;
  std::map<NameId, Site> sites_;
  std::jthread poses_thread_;
  std::jthread maps_thread_;
};

}  // namespace cairn::server
