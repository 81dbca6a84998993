// The maps of the sites that somebody looks at, each kept up to date by a MapClient, and their tiles as pictures.
// Bounds: kMaxOpenMaps maps at once (one that nobody asked for in a minute gives way), kMaxPictureBytes of pictures a
// map. Thread rule: every method from any thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "client/lib/map_client.h"
#include "client/web/tile_picture.h"
#include "common/mutex.h"

namespace cairn::web {

inline constexpr std::size_t kMaxOpenMaps = 16;
inline constexpr std::size_t kMaxPictureBytes = std::size_t{32} << 20;

struct TilePicture {
  std::string etag;  // Of the tile's content and the theme, with its quotes.
  std::shared_ptr<const std::string> png;
};

class SiteMap {
 public:
  explicit SiteMap(std::unique_ptr<client::MapClient> map) : map_(std::move(map)) {}

  [[nodiscard]] client::MapClient& map() { return *map_; }
  // The picture and its tag; the picture is not drawn where `known_etag` is the tag. kNotFound: no such tile.
  [[nodiscard]] Result<TilePicture> Picture(const TileKey& key, Theme theme, const std::string& known_etag);

 private:
  using PictureKey = std::pair<TileKey, Theme>;

  const std::unique_ptr<client::MapClient> map_;
  Mutex mutex_;
  std::map<PictureKey, TilePicture> pictures_ CAIRN_GUARDED_BY(mutex_);
  std::size_t bytes_ CAIRN_GUARDED_BY(mutex_) = 0;
};

class SiteMaps {
 public:
  explicit SiteMaps(wire::Bus& bus) : bus_(bus) {}

  // Joins the map where nobody looked at it before. The coarsest tiles are asked for first, because it takes seconds
  // until the wire has brought all tiles of a large map. REQUIRES: the server has the site. kResourceExhausted: too
  // many maps are looked at.
  [[nodiscard]] Result<std::shared_ptr<SiteMap>> Open(const std::string& site, client::QueryClient& queries);
  [[nodiscard]] std::size_t open() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Place {
    std::shared_ptr<SiteMap> map;
    Clock::time_point asked;
  };
  [[nodiscard]] std::shared_ptr<SiteMap> Find(const std::string& site) CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool MakeRoom() CAIRN_REQUIRES(mutex_);

  wire::Bus& bus_;
  mutable Mutex mutex_;
  std::map<std::string, Place> places_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::web
