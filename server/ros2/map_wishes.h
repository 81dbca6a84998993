// The requests for the map of a site that wait for the thread of the maps. Bounded: at most kMost wait, and at most
// kMostOfOne of one participant (as many again while a turn is under way); a further one is not taken. One turn ends
// with the map after which it has answered as many cells as one message may have, so that nobody keeps the thread busy
// with maps. A
// request whose answer cannot be delivered yet waits for a later turn, until its deadline. Thread rule: Add from any
// thread, the rest from one.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <utility>

#include "common/mutex.h"
#include "common/ros2/messages.h"
#include "common/service/names.h"

namespace cairn::server {

struct MapWish {
  std::uint64_t asker = 0;  // Which participant.
  NameId site_id = 0;
  bool until_known = false;  // It waits for a map with cells, as long as its deadline allows.
  std::chrono::steady_clock::time_point deadline;
  // Answers with this map, which has no cells where there is none. False: the answer cannot be delivered yet.
  std::function<bool(const ros2::Grid&)> answer;
};

class MapWishes {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t kMost = 64;
  static constexpr std::size_t kMostOfOne = 4;

  // Whether it was taken.
  [[nodiscard]] bool Add(MapWish&& wish) CAIRN_EXCLUDES(mutex_);
  // Answers in the order of the requests. `map_of` makes the map of a site as it is now. Returns how many were given
  // up, because nobody was there at their deadline.
  std::size_t Answer(const std::function<ros2::Grid(NameId)>& map_of, std::size_t max_cells, Clock::time_point now)
      CAIRN_EXCLUDES(mutex_);

 private:
  Mutex mutex_;
  std::list<MapWish> waiting_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::server
