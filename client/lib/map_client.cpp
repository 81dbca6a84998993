#include "client/lib/map_client.h"

#include <fmt/format.h>

#include <utility>

#include "client/lib/client_id.h"
#include "client/lib/deadline.h"

namespace cairn::client {

MapClient::MapClient(wire::Bus& bus, const std::string& site, std::function<void()> on_change)
    : bus_(bus), site_(site), on_change_(std::move(on_change)), mirror_(HashName(site)) {}

MapClient::~MapClient() = default;

Result<std::unique_ptr<MapClient>> MapClient::Create(wire::Bus& bus, const std::string& site,
                                                     std::function<void()> on_change) {
  std::unique_ptr<MapClient> client(new MapClient(bus, site, std::move(on_change)));
  MapClient* self = client.get();
  auto map = bus.Subscribe<MapInfo>([self](MapInfo&& info) { self->Apply(std::move(info)); });
  if (!map) return tl::unexpected(map.error());
  client->map_ = std::move(*map);
  auto tiles = bus.Subscribe<TileSample>([self](TileSample&& sample) { self->Apply(std::move(sample)); });
  if (!tiles) return tl::unexpected(tiles.error());
  client->tiles_ = std::move(*tiles);
  return client;
}

template <typename Value>
void MapClient::Apply(Value&& value) {
  {
    const MutexLock lock(mutex_);
    if (!mirror_.Apply(std::forward<Value>(value))) return;
    changed_.NotifyAll();
  }
  if (on_change_) on_change_();
}

Result<void> MapClient::WaitComplete(double timeout_s) {
  using Clock = std::chrono::steady_clock;
  const Deadline deadline = DeadlineAfter(timeout_s);
  const MutexLock lock(mutex_);
  while (!mirror_.complete()) {
    if (Clock::now() >= deadline) {
      if (map_->matched() == 0) return Fail(StatusCode::kUnavailable, NoServer(bus_, timeout_s));
      if (!mirror_.info()) return Fail(StatusCode::kNotFound, fmt::format("the server has no map of site '{}'", site_));
      return Fail(StatusCode::kDeadlineExceeded,
                  fmt::format("{} of {} tiles of site '{}' within {:.1f} s", mirror_.tiles(0).size(),
                              mirror_.info()->tile_count, site_, timeout_s));
    }
    changed_.WaitUntil(mutex_, deadline);
  }
  return {};
}

std::vector<Tile> MapClient::tiles() const {
  const MutexLock lock(mutex_);
  return mirror_.tiles();
}

std::vector<Tile> MapClient::tiles(int level) const {
  const MutexLock lock(mutex_);
  return mirror_.tiles(level);
}

std::optional<MapInfo> MapClient::info() const {
  const MutexLock lock(mutex_);
  return mirror_.info();
}

std::uint32_t MapClient::epoch() const {
  const MutexLock lock(mutex_);
  return mirror_.epoch();
}

std::uint64_t MapClient::version() const {
  const MutexLock lock(mutex_);
  return mirror_.version();
}

}  // namespace cairn::client
