// Which session has looked last at each cell of a chunk, as far as that was noted. A plain value.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/map/tile.h"
#include "server/maps/robot_grid.h"
#include "server/slam/grid/cell_mask.h"
#include "server/slam/grid/occupancy_grid.h"

namespace cairn::server {

class LastLooks {
 public:
  // The session has looked at these cells, later than all others so far.
  void Note(SessionId session, const slam::CellMask& cells);
  // What the session has looked at last counts as looked at by `by`.
  void Replace(SessionId session, SessionId by);
  void Forget(SessionId session);
  // What the session had drawn in the chunk was drawn again. Where it says something else now, it does not count any
  // more as the one that looked last.
  void ForgetWhereDifferent(SessionId session, const slam::GridChunk& before, const slam::GridChunk& now);

  // By cell: 0 where nobody is known to be the last, else the number that NumberOf gives the last session.
  [[nodiscard]] const std::array<std::uint8_t, kTileArea>& numbers() const { return numbers_; }
  // 0: the session is the last at no cell.
  [[nodiscard]] std::uint8_t NumberOf(SessionId session) const;

 private:
  void Renumber(std::uint8_t from, std::uint8_t to);

  std::vector<SessionId> sessions_;  // Number n is that of sessions_[n - 1]. 0: the number is free.
  std::array<std::uint8_t, kTileArea> numbers_{};
};

}  // namespace cairn::server
