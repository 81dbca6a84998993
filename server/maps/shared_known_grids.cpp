#include "server/maps/shared_known_grids.h"

#include <utility>

namespace cairn::server {

void SharedKnownGrids::RemoveUnused() {
  std::erase_if(grids_, [](const auto& grid) { return grid.expired(); });
}

SharedKnownGrids::Grid SharedKnownGrids::Make(slam::KnownGrid::Source source, const slam::PlaceSearchOptions& options,
                                              double near_m) {
  {
    const MutexLock lock(mutex_);
    for (const auto& known : grids_) {
      auto grid = known.lock();
      if (grid != nullptr && grid->IsOf(source, options, near_m)) return grid;
    }
  }
  return SameAs(std::make_shared<const slam::KnownGrid>(std::move(source), options, near_m));
}

SharedKnownGrids::Grid SharedKnownGrids::SameAs(const Grid& grid) {
  const MutexLock lock(mutex_);
  RemoveUnused();
  for (const auto& known : grids_) {
    auto other = known.lock();
    if (other != nullptr && (other == grid || other->IsSameAs(*grid))) return other;
  }
  grids_.push_back(grid);
  return grid;
}

std::size_t SharedKnownGrids::size() {
  const MutexLock lock(mutex_);
  RemoveUnused();
  return grids_.size();
}

}  // namespace cairn::server
