// The versions of a site's map, their content, and which one is enabled. Version 1 is the live map since the
// site was created. Every job adds a version, which is disabled at first. When another version is enabled,
// the sessions' grids of the version enabled so far are stored, so that it can be enabled again (rolled back
// to). A job that joins one robot makes a version with this part alone, and sessions of which a version has no part
// stay as they are when it is enabled. So that every version shows all sessions as they were under it, the enabled one
// takes over such parts from the one before; and where a session is changed for the first time since a version was left
// or made without a part of it, the version gets the session's grid before that change. The number of versions is
// bounded: the oldest is removed, except version 1, the enabled one, the newest one, and the one that a switch under
// way will enable. Where memory is limited, version 1 can go as well. Not thread-safe: used on the site's strand only.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "common/service/map_info.h"
#include "server/maps/memory_count.h"
#include "server/maps/robot_grid.h"
#include "server/store/records.h"

namespace cairn::server {

struct MapVersion {
  MapVersionInfo info;
  std::map<SessionId, RobotGrid> parts;
  SmoothedPaths smoothed;
};

// Whether one of these sessions is joined with the map in the version: not a fragment.
[[nodiscard]] bool JoinsOneOf(const std::set<SessionId>& sessions, const MapVersion& version);

class MapVersions {
 public:
  explicit MapVersions(std::size_t max_versions);

  // Adds a disabled version and returns its number. `wanted` is the version that a switch under way will
  // enable; 0: none.
  std::uint32_t Add(MapVersion version, std::uint32_t wanted = 0);
  [[nodiscard]] const MapVersion* Find(std::uint32_t version) const;
  // REQUIRES: Find(version). `displaced`: the grids, under the version that has been enabled so far, of those sessions
  // of which the new one has a part. Returns the versions of which parts may have changed.
  std::vector<std::uint32_t> Enable(std::uint32_t version, const std::map<SessionId, RobotGrid>& displaced);

  // The version that is least needed; nothing if all are. `last`: also one that a job has made last, and then the one
  // before the enabled version, to which a roll back goes. Never the enabled one.
  [[nodiscard]] std::optional<std::uint32_t> LeastNeeded(bool last) const;
  // REQUIRES: it is not the enabled one.
  void Remove(std::uint32_t version) { versions_.erase(version); }

  // Two sessions that no longer exist count as one from now on, with the number of the later one. `merge` makes one
  // grid of the parts that a version has of them, null where it has none. Returns the versions that this changed.
  using Merge = std::function<slam::OccupancyGrid::Chunks(const RobotGrid* older, const RobotGrid* later)>;
  std::vector<std::uint32_t> MergeParts(SessionId older, SessionId later, const Merge& merge);

  // The highest number of a session of which a version has a part; 0 if there is none.
  [[nodiscard]] SessionId LastSession() const;

  // Restores the stored versions. REQUIRES: `enabled` is one of the versions, and all are below `next`.
  void Restore(std::map<std::uint32_t, MapVersion> versions, std::uint32_t next, std::uint32_t enabled);

  // Adds the grids and the paths of all versions.
  void Count(MemoryCount& memory) const;

  [[nodiscard]] std::uint32_t enabled() const { return enabled_; }
  [[nodiscard]] std::uint32_t next() const { return next_; }
  [[nodiscard]] std::vector<MapVersionInfo> infos() const;
  // The paths of the enabled version; if it has none, those of the newest version that has some.
  [[nodiscard]] const SmoothedPaths& smoothed() const;

 private:
  const std::size_t max_versions_;
  std::uint32_t next_ = 2;
  std::uint32_t enabled_ = 1;
  std::map<std::uint32_t, MapVersion> versions_;
};

}  // namespace cairn::server
