// What one person who looks is told: the pieces of a stream of server-sent events, on change.
// Thread rule: StateTexts from any thread; a Viewer from the one thread of its stream.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "client/web/server_watch.h"
#include "client/web/site_maps.h"
#include "client/web/tile_pacer.h"
#include "common/mutex.h"

namespace cairn::web {

// The newest state of each site as JSON, written once for all who look at it.
class StateTexts {
 public:
  using Text = std::shared_ptr<const std::string>;

  explicit StateTexts(bool commands) : commands_(commands) {}

  // REQUIRES: `site` is empty or one of the view's sites.
  [[nodiscard]] Text Get(const ServerView& view, const std::string& site);
  // Why robots are not on the map, of whatever site.
  [[nodiscard]] Text Doctor(const ServerView& view);

 private:
  struct Written {
    std::uint64_t view = 0;
    Text text;
  };
  // The newest text of its kind: what `write` gives, or the one before where it is the same.
  template <typename Write>
  [[nodiscard]] static Text Renew(Written& written, std::uint64_t view, const Write& write);

  const bool commands_;
  Mutex mutex_;
  std::map<std::string, Written> written_ CAIRN_GUARDED_BY(mutex_);  // By site; those of the newest views only.
  Written doctor_ CAIRN_GUARDED_BY(mutex_);
};

class Viewer {
 public:
  // `watch` and `states` outlive the viewer. `map` is the site's; null without a site.
  Viewer(ServerWatch& watch, StateTexts& states, std::string site, std::shared_ptr<SiteMap> map)
      : watch_(watch), states_(states), site_(std::move(site)), map_(std::move(map)), looking_(watch.Look()) {}

  // Waits up to half a second for something new. May be empty.
  [[nodiscard]] std::string NextPiece();

 private:
  using Clock = std::chrono::steady_clock;

  void AddView(const ServerView& view, std::string& piece);
  void AddTiles(std::string& piece);

  ServerWatch& watch_;
  StateTexts& states_;
  const std::string site_;
  const std::shared_ptr<SiteMap> map_;
  const std::shared_ptr<void> looking_;
  // What the person has been told.
  std::uint64_t view_ = 0;
  StateTexts::Text state_;
  StateTexts::Text doctor_;
  client::TileChanges::Place tiles_;
  TilePacer pacer_;
  std::int64_t flow_ms_ = 0;
  Clock::time_point told_{};
};

}  // namespace cairn::web
