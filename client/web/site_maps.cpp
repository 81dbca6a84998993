#include "client/web/site_maps.h"

#include <algorithm>
#include <string_view>

namespace cairn::web {
namespace {

// A version alone is no tag: it begins anew with each epoch and each start of the server.
std::string TagOf(const Tile& tile, Theme theme) {
  const NameId hash = HashName({reinterpret_cast<const char*>(tile.bytes.data()), tile.bytes.size()});
  return "\"" + std::to_string(tile.epoch) + "-" + std::to_string(tile.version) + "-" + std::to_string(hash) +
         (theme == Theme::kDark ? "-d\"" : "-l\"");
}

tl::unexpected<Status> TooMany() {
  return Fail(StatusCode::kResourceExhausted, "too many sites are looked at; try again in a minute");
}

}  // namespace

Result<TilePicture> SiteMap::Picture(const TileKey& key, Theme theme, const std::string& known_etag) {
  const auto tile = map_->tile(key);
  if (!tile) return Fail(StatusCode::kNotFound, "there is no such tile");
  TilePicture picture{.etag = TagOf(*tile, theme), .png = {}};
  if (picture.etag == known_etag) return picture;
  {
    const MutexLock lock(mutex_);
    const auto drawn = pictures_.find({key, theme});
    if (drawn != pictures_.end() && drawn->second.etag == picture.etag) return drawn->second;
  }
  auto png = DrawTile(*tile, theme);
  if (!png) return tl::unexpected(png.error());
  picture.png = std::make_shared<const std::string>(std::move(*png));
  const MutexLock lock(mutex_);
  TilePicture& kept = pictures_[{key, theme}];
  if (kept.png) bytes_ -= kept.png->size();
  kept = picture;
  bytes_ += picture.png->size();
  // They are drawn again in a millisecond, so it does not matter which ones go.
  while (bytes_ > kMaxPictureBytes && pictures_.size() > 1) {
    auto last = pictures_.begin()->first == PictureKey(key, theme) ? std::prev(pictures_.end()) : pictures_.begin();
    bytes_ -= last->second.png->size();
    pictures_.erase(last);
  }
  return picture;
}

bool SiteMaps::MakeRoom() {
  constexpr std::chrono::seconds kForgotten{60};
  const auto now = Clock::now();
  std::erase_if(places_, [&](const auto& entry) {
    return entry.second.map.use_count() == 1 && now - entry.second.asked > kForgotten;
  });
  return places_.size() < kMaxOpenMaps;
}

std::shared_ptr<SiteMap> SiteMaps::Find(const std::string& site) {
  const auto found = places_.find(site);
  if (found == places_.end()) return nullptr;
  found->second.asked = Clock::now();
  return found->second.map;
}

Result<std::shared_ptr<SiteMap>> SiteMaps::Open(const std::string& site, client::QueryClient& queries) {
  {
    const MutexLock lock(mutex_);
    if (auto map = Find(site)) return map;
    if (!MakeRoom()) return TooMany();  // Before the server is asked.
  }
  auto coarsest = queries.Tiles({.site = site, .area = {}, .level = kPyramidLevels - 1});
  const MutexLock lock(mutex_);
  if (auto map = Find(site)) return map;  // Somebody else was faster.
  if (!MakeRoom()) return TooMany();
  auto map = client::MapClient::Create(bus_, site);
  if (!map) return tl::unexpected(map.error());
  auto opened = std::make_shared<SiteMap>(std::move(*map));
  if (coarsest) opened->map().Fill(std::move(*coarsest));
  places_[site] = {.map = opened, .asked = Clock::now()};
  return opened;
}

std::size_t SiteMaps::open() const {
  const MutexLock lock(mutex_);
  return places_.size();
}

}  // namespace cairn::web
