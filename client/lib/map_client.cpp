#include "client/lib/map_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <type_traits>
#include <utility>

#include "client/lib/client_id.h"
#include "client/lib/deadline.h"

namespace cairn::client {

MapClient::MapClient(wire::Bus& bus, const std::string& site, std::function<void()> on_change)
    : bus_(bus),
      site_(site),
      on_change_(std::move(on_change)),
      mirror_(HashName(site)),
      watch_(
          bus, [this](QueryClient& queries) { return Behind(queries); }, [this] { Renew(); }) {}

MapClient::~MapClient() {
  watch_.Stop();  // It would change the wire.
}

Result<std::unique_ptr<MapClient>> MapClient::Create(wire::Bus& bus, const std::string& site,
                                                     std::function<void()> on_change) {
  std::unique_ptr<MapClient> client(new MapClient(bus, site, std::move(on_change)));
  auto wire = client->Connect(bus, 0);
  if (!wire) return tl::unexpected(wire.error());
  const MutexLock lock(client->mutex_);
  client->wire_ = std::move(*wire);
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
  bool hears = true, changed = false;
  {
    const MutexLock lock(mutex_);
    if (number != number_) return;
    changed = mirror_->Apply(std::forward<Value>(value));
    // Tiles of other sites come as well, and a description alone is no sign that tiles come: their reader can be deaf
    // by itself.
    if constexpr (std::is_same_v<Value, MapInfo>) hears = changed && !MissesTiles();
    if (changed) changed_.NotifyAll();
  }
  if (hears) watch_.Arrived();
  if (changed && on_change_) on_change_();
}

// Whether the mirror is not what the server has by now.
bool MapClient::Behind(QueryClient& queries) {
  const auto asked = queries.Map(site_);
  if (!asked) return false;
  const MutexLock lock(mutex_);
  const std::uint64_t known = std::max(mirror_->version(), mirror_->info() ? mirror_->info()->version : 0);
  if (asked->generation != mirror_->generation() || asked->epoch != mirror_->epoch() || asked->version > known)
    return true;
  // Joining anew helps once at most: the newest tile may have been deleted before the server was started.
  return MissesTiles() && missed_before_ != DescribedVersion();
}

bool MapClient::MissesTiles() const {
  const auto& info = mirror_->info();
  return info && info->tile_count > 0 && mirror_->version() < info->version;
}

std::optional<MapClient::Version> MapClient::DescribedVersion() const {
  const auto& info = mirror_->info();
  if (!info) return std::nullopt;
  return Version{info->generation, info->epoch, info->version};
}

// Nothing that was received before counts any more: it may have been forged.
void MapClient::Renew() {
  auto bus = wire::Bus::Create(bus_.options(), "map");
  if (!bus) return;
  int number = 0;
  {
    const MutexLock lock(mutex_);
    number = ++number_;
    missed_before_ = DescribedVersion();
    mirror_.emplace(HashName(site_));
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
    if (std::chrono::steady_clock::now() >= deadline) {
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

void MapClient::Fill(TileAnswer&& answer) {
  bool filled = false;
  {
    const MutexLock lock(mutex_);
    for (Tile& tile : answer.tiles) filled = mirror_->Fill(answer.generation, std::move(tile)) || filled;
    if (filled) changed_.NotifyAll();
  }
  if (filled && on_change_) on_change_();
}

std::vector<Tile> MapClient::tiles() const {
  const MutexLock lock(mutex_);
  return mirror_->tiles();
}

std::vector<Tile> MapClient::tiles(int level) const {
  const MutexLock lock(mutex_);
  return mirror_->tiles(level);
}

std::optional<Tile> MapClient::tile(const TileKey& key) const {
  const MutexLock lock(mutex_);
  return mirror_->tile(key);
}

TileChanges MapClient::ChangesSince(const TileChanges::Place& place) const {
  const MutexLock lock(mutex_);
  const auto mirror = static_cast<std::uint64_t>(number_) + 1;  // The mirror of a default place is none.
  TileChanges changes = mirror_->ChangesSince(place.mirror == mirror ? place : TileChanges::Place{.mirror = mirror});
  if (place.mirror != mirror) changes.whole = true;
  changes.now.mirror = mirror;
  return changes;
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
