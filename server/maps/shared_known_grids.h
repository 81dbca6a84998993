// Maps in which robots are localised, each made once for all robots that are localised in the same: the cells, the
// surfaces and the tables for finding a robot take several times the memory of the tiles. A map is kept as long as a
// robot is localised in it. Thread rule: any thread; none waits while another one makes a map, so that two that need
// the same at once may both make it, and both get the one that was made first.
#pragma once

#include <memory>
#include <vector>

#include "common/mutex.h"
#include "server/slam/known_grid/known_grid.h"

namespace cairn::server {

class SharedKnownGrids {
 public:
  using Grid = std::shared_ptr<const slam::KnownGrid>;

  // A map of these cells. REQUIRES: slam::KnownGrid::IsBounded(source).
  [[nodiscard]] Grid Make(slam::KnownGrid::Source source, const slam::PlaceSearchOptions& options, double near_m)
      CAIRN_EXCLUDES(mutex_);
  // Takes the place of a map that somebody has made alone: the one that others have already, or this one.
  [[nodiscard]] Grid SameAs(const Grid& grid) CAIRN_EXCLUDES(mutex_);
  // How many there are.
  [[nodiscard]] std::size_t size() CAIRN_EXCLUDES(mutex_);

 private:
  void RemoveUnused() CAIRN_REQUIRES(mutex_);

  Mutex mutex_;
  std::vector<std::weak_ptr<const slam::KnownGrid>> grids_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::server
