#include "server/ros2/ros2_egress.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "common/wall_clock.h"

namespace cairn::server {
namespace {

constexpr std::size_t kMaxPoses = 4096;
// Maps change twice a second; somebody who begins to listen is noticed as fast.
constexpr std::chrono::milliseconds kMapPeriod{200};
constexpr ros2::Qos kPoseQos{.reliable = true, .transient_local = false, .depth = 10};
constexpr ros2::Qos kTfQos{.reliable = true, .transient_local = false, .depth = 100};
constexpr ros2::Qos kMapQos{.reliable = true, .transient_local = true, .depth = 1};
constexpr ros2::Qos kUpdateQos{.reliable = true, .transient_local = false, .depth = 10};

ros2::Pose3 InSpace(const Pose2& pose) {
  return {{pose.x, pose.y, 0.0}, Eigen::Quaterniond(Eigen::AngleAxisd(pose.theta, Eigen::Vector3d::UnitZ()))};
}

// x, y and the turn about z are the elements 0, 1 and 5 of six.
std::array<double, 36> InSpace(const Eigen::Matrix3d& covariance) {
  constexpr std::array<std::size_t, 3> kPlace{0, 1, 5};
  std::array<double, 36> in_space{};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      in_space[6 * kPlace[row] + kPlace[column]] =
          covariance(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column));
    }
  }
  return in_space;
}

}  // namespace

void Ros2Egress::News::MakeNewer(News&& newer) {
  if (newer.gone) {
    gone = true;
    info.reset();
    tiles.clear();
  }
  if (newer.info) info = std::move(newer.info);
  for (auto tile = newer.tiles.begin(); tile != newer.tiles.end();) {
    const auto next = std::next(tile);
    auto node = newer.tiles.extract(tile);
    tiles.erase(node.key());
    tiles.insert(std::move(node));
    tile = next;
  }
}

Ros2Egress::Ros2Egress(ros2::Bus& bus, const Ros2Options& options) : bus_(bus), options_(options), poses_(kMaxPoses) {}

Ros2Egress::~Ros2Egress() {
  Finish();
}

void Ros2Egress::Start() {
  poses_thread_ = std::jthread([this] { RunPoses(); });
  maps_thread_ = std::jthread([this] { RunMaps(); });
}

void Ros2Egress::Finish() {
  poses_.Close();
  {
    const MutexLock lock(news_mutex_);
    finished_ = true;
    news_came_.NotifyAll();
  }
  poses_thread_ = {};
  maps_thread_ = {};
}

void Ros2Egress::Count(const Result<void>& published) {
  if (!published) unpublished_.fetch_add(1, std::memory_order_relaxed);
}

void Ros2Egress::See(const OutboundValue& value) {
  if (const auto* const pose = std::get_if<PoseReport>(&value)) {
    if (!poses_.TryPush(*pose)) unpublished_.fetch_add(1, std::memory_order_relaxed);
    return;
  }
  const auto* const info = std::get_if<MapInfo>(&value);
  const auto* const tile = std::get_if<TileSample>(&value);
  const auto* const retired = std::get_if<Retired>(&value);
  const auto* const gone = retired != nullptr ? std::get_if<MapInfo>(&retired->of) : nullptr;
  if (info == nullptr && gone == nullptr && (tile == nullptr || tile->tile.key.level != 0)) return;
  const MutexLock lock(news_mutex_);
  if (finished_) return;
  if (gone != nullptr) {
    News news;
    news.gone = true;
    news_.insert_or_assign(gone->site_id, std::move(news));
  }
  if (info != nullptr) news_[info->site_id].info = *info;
  if (tile != nullptr) news_[tile->site_id].tiles.insert_or_assign(tile->tile.key, *tile);
}

void Ros2Egress::Serve(const RobotAddress& address) {
  auto robot = std::make_shared<Robot>();
  robot->address = address;
  {
    // Where only the frame is new, the topics stay: subscribers would have to find new ones first.
    const MutexLock lock(mutex_);
    const auto known = robots_.find(address.robot_id);
    if (known != robots_.end() && known->second->address.name_space == address.name_space &&
        known->second->address.tf_topic == address.tf_topic) {
      robot->pose = known->second->pose;
      robot->tf = known->second->tf;
      known->second = std::move(robot);
      return;
    }
  }
  const std::string topic = TopicIn(address.name_space, "cairn/pose");
  auto pose = bus_.Advertise<ros2::PoseWithCovariance>(topic, kPoseQos);
  auto tf = bus_.Advertise<ros2::Transforms>(address.tf_topic, kTfQos);
  if (!pose || !tf) {
    spdlog::warn("ROS 2: the poses of {} cannot be published: {}", address.name_space,
                 !pose ? pose.error().message : tf.error().message);
    return;
  }
  robot->pose = *std::move(pose);
  robot->tf = *std::move(tf);
  const MutexLock lock(mutex_);
  robots_.insert_or_assign(address.robot_id, std::move(robot));
}

void Ros2Egress::Leave(NameId robot_id) {
  const MutexLock lock(mutex_);
  robots_.erase(robot_id);
}

void Ros2Egress::RunPoses() {
  while (const auto report = poses_.Pop()) poses_failed_.Guard([&] { Publish(*report); });
}

void Ros2Egress::Publish(const PoseReport& report) {
  std::shared_ptr<const Robot> robot;
  {
    const MutexLock lock(mutex_);
    const auto found = robots_.find(report.robot_id);
    if (found != robots_.end()) robot = found->second;
  }
  if (robot == nullptr || !report.localized) return;
  Count(robot->pose->Publish(
      {{report.stamp, options_.map_frame}, InSpace(report.T_map_robot), InSpace(report.covariance)}));
  if (robot->address.odom_frame.empty()) return;
  ros2::Transforms transforms;
  transforms.transforms.push_back(
      {{report.stamp + StampFromSeconds(options_.transform_tolerance_s), options_.map_frame},
       robot->address.odom_frame,
       InSpace(report.T_map_odom)});
  Count(robot->tf->Publish(transforms));
}

void Ros2Egress::RunMaps() {
  for (;;) {
    {
      const MutexLock lock(news_mutex_);
      const auto deadline = std::chrono::steady_clock::now() + kMapPeriod;
      while (!finished_ && news_came_.WaitUntil(news_mutex_, deadline)) {
      }
      if (finished_ && news_.empty()) return;
    }
    maps_failed_.Guard([this] { TakeNews(); });
    maps_failed_.Guard([this] { PublishMaps(); });
    maps_failed_.Guard([this] { AnswerWishes(); });
  }
}

Ros2Egress::Site& Ros2Egress::SiteOf(NameId site_id, const MapInfo& info) {
  const auto known = sites_.find(site_id);
  if (known != sites_.end()) return known->second;
  Site site{SiteGrid(options_.map_frame, options_.map_period_s, options_.max_map_cells), nullptr, nullptr};
  const std::string topic = "rt/" + TopicPart(info.site) + "/map";
  auto map = bus_.Advertise<ros2::Grid>(topic, kMapQos);
  auto updates = bus_.Advertise<ros2::GridUpdate>(topic + "_updates", kUpdateQos);
  if (map && updates) {
    site.map = *std::move(map);
    site.updates = *std::move(updates);
  } else {
    spdlog::warn("ROS 2: the map of {} cannot be published: {}", info.site,
                 !map ? map.error().message : updates.error().message);
  }
  return sites_.emplace(site_id, std::move(site)).first->second;
}

void Ros2Egress::TakeNews() {
  {
    const MutexLock lock(news_mutex_);
    // Tiles wait until the name of their site is known. Whole nodes move, which needs no memory.
    for (auto one = news_.begin(); one != news_.end();) {
      const auto next = std::next(one);
      if (one->second.gone || one->second.info || sites_.contains(one->first)) {
        auto node = news_.extract(one);
        if (const auto older = taken_.find(node.key()); older != taken_.end()) {
          older->second.MakeNewer(std::move(node.mapped()));
        } else {
          taken_.insert(std::move(node));
        }
      }
      one = next;
    }
    if (finished_) news_.clear();
  }
  while (!taken_.empty()) {
    auto& [site_id, one] = *taken_.begin();
    if (std::exchange(one.gone, false)) sites_.erase(site_id);
    if (!one.info && !sites_.contains(site_id)) {
      taken_.erase(taken_.begin());
      continue;
    }
    Site& site = SiteOf(site_id, one.info.value_or(MapInfo{}));
    if (one.info) site.grid.Take(*one.info);
    auto& tiles = taken_.begin()->second.tiles;
    while (!tiles.empty()) {
      site.grid.Take(tiles.begin()->second);
      tiles.erase(tiles.begin());
    }
    taken_.erase(taken_.begin());
  }
}

void Ros2Egress::PublishMaps() {
  std::vector<std::string> too_large;
  for (auto& [site_id, site] : sites_) {
    if (site.map == nullptr) continue;
    const int listeners = site.map->matched();
    const bool wanted = listeners > std::exchange(site.listeners, listeners);
    const SiteGrid::Due due = site.grid.Next(wanted, WallClock(), SiteGrid::Clock::now());
    if (const auto* const whole = std::get_if<ros2::Grid>(&due)) Count(site.map->Publish(*whole));
    if (const auto* const update = std::get_if<ros2::GridUpdate>(&due)) Count(site.updates->Publish(*update));
    if (site.grid.too_large()) too_large.push_back(site.grid.site());
  }
  const MutexLock lock(mutex_);
  too_large_ = std::move(too_large);
}

void Ros2Egress::AnswerWishes() {
  const auto map_of = [this](NameId site_id) {
    const auto site = sites_.find(site_id);
    if (site != sites_.end()) return site->second.grid.Now(WallClock());
    ros2::Grid nothing;
    nothing.header = {WallClock(), options_.map_frame};
    return nothing;
  };
  unpublished_.fetch_add(
      wishes_.Answer(map_of, static_cast<std::size_t>(options_.max_map_cells), MapWishes::Clock::now()),
      std::memory_order_relaxed);
}

std::vector<std::string> Ros2Egress::problems() const {
  const MutexLock lock(mutex_);
  std::vector<std::string> problems;
  for (const std::string& site : too_large_)
    problems.push_back("the map of " + site + " has more cells than ros2.max_map_cells and is not published");
  return problems;
}

}  // namespace cairn::server
