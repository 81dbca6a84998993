#include "client/lib/map_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "client/lib/client_id.h"
#include "client/lib/deadline.h"

namespace cairn::client {

MapClient::MapClient(wire::Bus& bus, const std::string& site, std::function<void()> on_change)
    : bus_(bus), site_(site), on_change_(std::move(on_change)), mirror_(HashName(site)), last_value_(Clock::now()) {}

MapClient::~MapClient() {
  std::unique_ptr<Wire> last;  // Its callbacks take the mutex.
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    changed_.NotifyAll();
  }
  if (watcher_.joinable()) watcher_.join();
  const MutexLock lock(mutex_);
  last = std::move(wire_);
}

Result<std::unique_ptr<MapClient>> MapClient::Create(wire::Bus& bus, const std::string& site,
                                                     std::function<void()> on_change) {
  std::unique_ptr<MapClient> client(new MapClient(bus, site, std::move(on_change)));
  auto wire = client->Connect(bus, 0);
  if (!wire) return tl::unexpected(wire.error());
  {
    const MutexLock lock(client->mutex_);
    client->wire_ = std::move(*wire);
  }
  client->watcher_ = std::thread([self = client.get()] { self->Watch(); });
  return client;
}

Result<std::unique_ptr<MapClient::Wire>> MapClient::Connect(wire::Bus& bus, int number) {
  auto wire = std::make_unique<Wire>();
  auto map = bus.Subscribe<MapInfo>([this, number](MapInfo&& info) { Apply(number, std::move(info)); });
  if (!map) return tl::unexpected(map.error());
  wire->map = std::move(*map);
  auto tiles = bus.Subscribe<TileSample>([this, number](TileSample&& sample) { Apply(number, std::move(sample)); });
  if (!tiles) return tl::unexpected(tiles.error());
  wire->tiles = std::move(*tiles);
  return wire;
}

template <typename Value>
void MapClient::Apply(int number, Value&& value) {
  {
    const MutexLock lock(mutex_);
    if (number != number_ || !mirror_->Apply(std::forward<Value>(value))) return;
    last_value_ = Clock::now();
    changed_.NotifyAll();
  }
  if (on_change_) on_change_();
}

// The mirror is not what the server has by now.
bool MapClient::Behind(const MapInfo& asked) const {
  const std::uint64_t known = std::max(mirror_->version(), mirror_->info() ? mirror_->info()->version : 0);
  return asked.generation != mirror_->generation() || asked.epoch != mirror_->epoch() || asked.version > known;
}

void MapClient::Watch() {
  constexpr std::chrono::seconds kSilence{2};
  constexpr std::chrono::seconds kLongestPause{60};
  Clock::time_point asked = Clock::now();
  Clock::duration pause = kSilence;  // Between two questions; longer where joining anew did not help.
  bool behind = false;               // As of the last question, and nothing came since.
  for (;;) {
    {
      const MutexLock lock(mutex_);
      if (!stopping_) changed_.WaitFor(mutex_, std::chrono::milliseconds(200));
      if (stopping_) return;
      const auto now = Clock::now();
      if (now - last_value_ < kSilence) behind = false;
      if (now - last_value_ < kSilence || now - asked < pause) continue;
      asked = now;
    }
    if (queries_ == nullptr) {
      auto queries = QueryClient::Create(bus_);
      if (!queries) continue;
      queries_ = std::move(*queries);
    }
    const auto info = queries_->Map(site_);
    if (!info) continue;
    const bool before = behind;
    {
      const MutexLock lock(mutex_);
      behind = Behind(*info);
    }
    if (!behind) pause = kSilence;
    if (!before || !behind) continue;
    Renew();
    pause = std::min<Clock::duration>(2 * pause, kLongestPause);
    behind = false;
  }
}

// Nothing that was received before counts any more: it may have been forged.
void MapClient::Renew() {
  auto bus = wire::Bus::Create(bus_.options(), "map");
  if (!bus) return;
  int number = 0;
  {
    const MutexLock lock(mutex_);
    number = ++number_;
    mirror_.emplace(HashName(site_));
    last_value_ = Clock::now();
  }
  auto wire = Connect(**bus, number);
  if (!wire) return;
  (*wire)->own = std::move(*bus);
  std::unique_ptr<Wire> before;  // Its callbacks take the mutex: it goes when the lock is released.
  {
    const MutexLock lock(mutex_);
    before = std::exchange(wire_, std::move(*wire));
  }
}

int MapClient::renewed() const {
  const MutexLock lock(mutex_);
  return number_;
}

Result<void> MapClient::WaitComplete(double timeout_s) {
  const Deadline deadline = DeadlineAfter(timeout_s);
  const MutexLock lock(mutex_);
  while (!mirror_->complete()) {
    if (Clock::now() >= deadline) {
      if (wire_->map->matched() == 0) return Fail(StatusCode::kUnavailable, NoServer(bus_, timeout_s));
      if (!mirror_->info())
        return Fail(StatusCode::kNotFound, fmt::format("the server has no map of site '{}'", site_));
      return Fail(StatusCode::kDeadlineExceeded,
                  fmt::format("{} of {} tiles of site '{}' within {:.1f} s", mirror_->tiles(0).size(),
                              mirror_->info()->tile_count, site_, timeout_s));
    }
    changed_.WaitUntil(mutex_, deadline);
  }
  return {};
}

std::vector<Tile> MapClient::tiles() const {
  const MutexLock lock(mutex_);
  return mirror_->tiles();
}

std::vector<Tile> MapClient::tiles(int level) const {
  const MutexLock lock(mutex_);
  return mirror_->tiles(level);
}

std::optional<MapInfo> MapClient::info() const {
  const MutexLock lock(mutex_);
  return mirror_->info();
}

std::uint32_t MapClient::epoch() const {
  const MutexLock lock(mutex_);
  return mirror_->epoch();
}

std::uint64_t MapClient::version() const {
  const MutexLock lock(mutex_);
  return mirror_->version();
}

}  // namespace cairn::client
