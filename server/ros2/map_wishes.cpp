#include "server/ros2/map_wishes.h"

#include <algorithm>
#include <map>

namespace cairn::server {

bool MapWishes::Add(MapWish&& wish) {
  const MutexLock lock(mutex_);
  const auto of_asker = std::count_if(waiting_.begin(), waiting_.end(),
                                      [&wish](const MapWish& other) { return other.asker == wish.asker; });
  if (waiting_.size() >= kMost || static_cast<std::size_t>(of_asker) >= kMostOfOne) return false;
  waiting_.push_back(std::move(wish));
  return true;
}

std::size_t MapWishes::Answer(const std::function<ros2::Grid(NameId)>& map_of, std::size_t max_cells,
                              Clock::time_point now) {
  std::list<MapWish> turn;
  {
    const MutexLock lock(mutex_);
    turn.swap(waiting_);
  }
  std::map<NameId, ros2::Grid> maps;  // Each is made once a turn.
  std::size_t cells = 0, given_up = 0;
  std::list<MapWish> later;
  while (!turn.empty() && (cells == 0 || cells < max_cells)) {
    const MapWish& wish = turn.front();
    const auto [map, is_new] = maps.try_emplace(wish.site_id);
    if (is_new) map->second = map_of(wish.site_id);
    const bool is_over = now >= wish.deadline;
    const bool wait = wish.until_known && map->second.cells.empty() && !is_over;
    const bool answered = !wait && wish.answer(map->second);
    if (answered) cells += std::max<std::size_t>(map->second.cells.size(), 1);
    if (!answered && !is_over) {
      later.splice(later.end(), turn, turn.begin());
    } else {
      given_up += answered ? 0 : 1;
      turn.pop_front();
    }
  }
  const MutexLock lock(mutex_);
  // What was left out of this turn is first in the next one, then what could not be answered, then what is new.
  later.splice(later.begin(), turn);
  waiting_.splice(waiting_.begin(), later);
  return given_up;
}

}  // namespace cairn::server
