// The map of a site as one grid of ROS 2, kept from the tiles that the server publishes: what has to be published now,
// whole or as a rectangle of changes. Not thread-safe: one owner. Time is given by the caller.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "common/map/tile.h"
#include "common/ros2/messages.h"
#include "common/service/map_info.h"
#include "common/service/stream.h"
#include "server/ros2/ros2_options.h"

namespace cairn::server {

class SiteGrid {
 public:
  using Clock = std::chrono::steady_clock;
  // While a site grows, its whole map is published at most this often.
  static constexpr std::chrono::seconds kShortestPeriod{1};
  // So long the tiles that the site says it has are waited for.
  static constexpr std::chrono::seconds kCompleteWithin{2};

  SiteGrid(std::string frame, double map_period_s, std::int64_t max_cells);

  void Take(const MapInfo& info);
  // A tile of level 0. One that cannot be decoded is ignored.
  void Take(const TileSample& sample);

  // What is due: the whole map if `wanted` (somebody new listens), if its size has changed or the last one is too old;
  // else the rectangle that has changed since; nothing where neither has anything new, or while tiles are missing, for
  // at most kCompleteWithin: what a planner does not know it may drive through. `stamp`: of the message.
  using Due = std::variant<std::monostate, ros2::Grid, ros2::GridUpdate>;
  [[nodiscard]] Due Next(bool wanted, Stamp stamp, Clock::time_point now);

  // The whole map as it is now, whatever was published; without cells if there is none, or if it is too large. Where
  // the map has just changed as a whole and tiles are missing, the map before that.
  [[nodiscard]] ros2::Grid Now(Stamp stamp) const;

  [[nodiscard]] const std::string& site() const { return site_; }
  // The map has more cells than a message may have, and is not published.
  [[nodiscard]] bool too_large() const { return too_large_; }

 private:
  using Place = std::pair<int, int>;  // Row and column of a tile.
  struct Bounds {
    int x_min = 0, y_min = 0, x_max = -1, y_max = -1;  // In tiles, both ends included.
    bool operator==(const Bounds&) const = default;
    [[nodiscard]] std::uint64_t cells() const;
    [[nodiscard]] bool empty() const { return x_max < x_min; }
    void Add(int x, int y);
  };

  using Tiles = std::map<Place, TileCells>;

  // False: it is of an epoch that has passed.
  [[nodiscard]] bool Enter(std::uint32_t epoch);
  // As many tiles are here as the site says.
  [[nodiscard]] bool complete() const { return info_epoch_ == epoch_ && tiles_.size() >= tile_count_; }
  void NoteComplete();
  // Tiles are missing, and have not been waited for long enough.
  [[nodiscard]] bool IsHeld(Clock::time_point now);
  // The cells of all tiles within the bounds.
  [[nodiscard]] static std::vector<std::int8_t> CellsOf(const Tiles& tiles, const Bounds& bounds);
  [[nodiscard]] static Bounds BoundsOf(const Tiles& tiles);
  [[nodiscard]] ros2::Grid Whole(const Tiles& tiles, const Bounds& bounds, Stamp stamp) const;

  const std::string frame_;
  const std::chrono::duration<double> period_;
  const std::uint64_t max_cells_;
  std::string site_;
  double resolution_ = 0.0;
  std::uint32_t epoch_ = 0;
  std::uint32_t info_epoch_ = 0;  // Of the last MapInfo, and ...
  std::uint32_t tile_count_ = 0;  // ... how many tiles the map has by it.
  bool epoch_was_complete_ = false;
  std::optional<Clock::time_point> incomplete_since_;
  bool waited_ = false;  // For long enough, since then.
  bool wanted_ = false;  // Somebody new listens, since when the map has been held back.
  Tiles tiles_;
  Tiles tiles_before_;  // Of the epoch before, until this one is complete.
  Bounds published_;
  Bounds changed_;             // Since the last message.
  bool whole_is_old_ = false;  // Changes were published since the whole map was.
  bool too_large_ = false;
  Clock::time_point whole_at_{};
};

}  // namespace cairn::server
