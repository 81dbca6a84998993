#include "server/ros2/ros2_services.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "server/ros2/namespace_rules.h"
#include "server/ros2/ros2_service_templates.h"

namespace cairn::server {
namespace {

constexpr const char* kOfServer = "/cairn";

}  // namespace

Ros2Services::Ros2Services(ros2::Bus& bus, const Ros2Options& options, const ServerAbilities& abilities,
                           CommandCalls& commands, Doors doors)
    : bus_(bus), options_(options), abilities_(abilities), doors_(std::move(doors)), commands_(commands) {
  if (options_.commands && abilities_.keeps_sites) OfferLoad();
}

void Ros2Services::Take(const OutboundValue& value) {
  if (const auto* const info = std::get_if<MapInfo>(&value)) {
    const MutexLock lock(news_mutex_);
    news_.insert_or_assign(info->site_id, info->site);
  } else if (const auto* const retired = std::get_if<Retired>(&value)) {
    const auto* const gone = std::get_if<MapInfo>(&retired->of);
    if (gone == nullptr) return;
    const MutexLock lock(news_mutex_);
    news_.insert_or_assign(gone->site_id, std::nullopt);
  }
}

void Ros2Services::Tick(Clock::time_point now) {
  now_ = now;
  while (auto news = NextNews()) {
    const auto& [site_id, name] = *news;
    if (name) {
      OpenSite(site_id, *name);
    } else {
      EndSite(site_id);
    }
  }
  SendLater();
  std::erase_if(lingering_, [now](const Lingering& one) { return one.until < now; });
  CountMalformed();
}

// One at a time: where an exception comes between, the others are there at the next Tick.
std::optional<std::pair<NameId, std::optional<std::string>>> Ros2Services::NextNews() {
  const MutexLock lock(news_mutex_);
  if (news_.empty()) return std::nullopt;
  auto node = news_.extract(news_.begin());
  return std::pair(node.key(), std::move(node.mapped()));
}

void Ros2Services::EndSite(NameId site_id) {
  const auto gone = sites_.find(site_id);
  if (gone == sites_.end()) return;
  for (const auto& endpoint : gone->second.endpoints) ended_refused_ += endpoint->refused();
  const std::string topic_part = gone->second.topic_part;
  sites_.erase(gone);
  // Another one may have waited for the name.
  for (auto& [other_id, other] : sites_) {
    if (other.topic_part == topic_part) return OfferAll(other_id, other);
  }
}

void Ros2Services::Close() {
  CountMalformed();
  of_server_.clear();
  sites_.clear();
  undelivered_.clear();
  lingering_.clear();
}

void Ros2Services::CountMalformed() {
  std::uint64_t sum = ended_refused_;
  for (const auto& endpoint : of_server_) sum += endpoint->refused();
  for (const auto& [site_id, site] : sites_) {
    for (const auto& endpoint : site.endpoints) sum += endpoint->refused();
  }
  malformed_.store(sum, std::memory_order_relaxed);
}

void Ros2Services::SendLater() {
  for (auto one = undelivered_.begin(); one != undelivered_.end();) {
    const bool sent = one->send();
    if (!sent && now_ < one->deadline) {
      ++one;
      continue;
    }
    if (!sent) unanswered_.fetch_add(1, std::memory_order_relaxed);
    one = undelivered_.erase(one);
  }
}

void Ros2Services::OpenSite(NameId site_id, const std::string& name) {
  if (sites_.contains(site_id)) return;
  Site site{name, TopicPart(name), {}};
  // In ROS, names of Cairn's may be the same ("a.b" and "a-b"). A service has one server.
  const bool taken = std::any_of(sites_.begin(), sites_.end(),
                                 [&site](const auto& other) { return other.second.topic_part == site.topic_part; });
  if (taken) {
    spdlog::warn("ROS 2: site {} has no services, because another site is '{}' there too", name, site.topic_part);
  } else {
    OfferAll(site_id, site);
  }
  sites_.emplace(site_id, std::move(site));
}

void Ros2Services::OfferAll(NameId site_id, Site& site) {
  OfferMap(site_id, "/" + site.topic_part + "/dynamic_map", site.endpoints);
  OfferMap(site_id, "/" + site.topic_part + "/map", site.endpoints);
  if (options_.commands) OfferCommands(site_id, site);
}

void Ros2Services::OfferMap(NameId site_id, const std::string& service, Endpoints& endpoints) {
  Offer<ros2::GetMap>(service, endpoints, [this, site_id](ros2::GetMap::Request&&, const Asked<ros2::GetMap>& asked) {
    MapWish wish{asked.asker(), site_id, false, now_ + kAnswerWaits,
                 [this, asked](const ros2::Grid& map) { return Send(asked, ros2::GetMap::Response{map}); }};
    if (!doors_.want_map(std::move(wish))) overflow_.fetch_add(1, std::memory_order_relaxed);
  });
}

void Ros2Services::OfferCommands(NameId site_id, Site& site) {
  const std::string prefix = "/" + site.topic_part + "/";
  Offer<ros2::Pause>(
      prefix + "pause_new_measurements", site.endpoints,
      [this, site_id](ros2::Pause::Request&&, const Asked<ros2::Pause>& asked) { TogglePause(site_id, asked); });
  if (!abilities_.keeps_sites) return;
  Offer<ros2::SaveMap>(prefix + "save_map", site.endpoints,
                       [this, site_id](ros2::SaveMap::Request&& request, const Asked<ros2::SaveMap>& asked) {
                         Save(site_id, request.name, asked.asker(),
                              [this, asked](const Status& status) { Answer(asked, {SaveMapResult(status)}); });
                       });
  using Serialize = ros2::SerializePoseGraph;
  Offer<Serialize>(prefix + "serialize_map", site.endpoints,
                   [this, site_id](Serialize::Request&& request, const Asked<Serialize>& asked) {
                     Save(site_id, request.filename, asked.asker(), [this, asked](const Status& status) {
                       Answer(asked, {status.ok() ? Serialize::kSuccess : Serialize::kFailedToWriteFile});
                     });
                   });
  if (!abilities_.makes_sites) return;
  Offer<ros2::Reset>(prefix + "reset", site.endpoints,
                     [this, site_id](ros2::Reset::Request&& request, const Asked<ros2::Reset>& asked) {
                       Reset(site_id, request, asked);
                     });
}

void Ros2Services::OfferLoad() {
  Offer<ros2::LoadMap>(
      std::string(kOfServer) + "/load_map", of_server_,
      [this](ros2::LoadMap::Request&& request, const Asked<ros2::LoadMap>& asked) { Load(std::move(request), asked); });
}

}  // namespace cairn::server
