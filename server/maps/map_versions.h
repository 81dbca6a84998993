// The versions of a site's map: what each consists of and which one is enabled. Version 1 is the live map since the
// site began; every job adds one, disabled. Enabling stores the parts that the outgoing version gives up, so that it
// can be enabled again (rolled back to). Bounded: the oldest that is neither version 1 nor enabled is forgotten. Not
// thread-safe: belongs to the site's strand.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/sensor/trajectory.h"
#include "common/service/map_info.h"
#include "server/robots/robot_event.h"

namespace cairn::server {

using SmoothedPaths = std::map<std::string, std::shared_ptr<const Trajectory>>;  // By robot.

struct MapVersion {
  MapVersionInfo info;
  std::map<SessionId, RobotGrid> parts;
  SmoothedPaths smoothed;
};

class MapVersions {
 public:
  explicit MapVersions(std::size_t max_versions);

  // Its number; disabled.
  std::uint32_t Add(MapVersion version);
  [[nodiscard]] const MapVersion* Find(std::uint32_t version) const;
  // `displaced` are the parts that the version enabled so far gives up.
  void Enable(std::uint32_t version, std::map<SessionId, RobotGrid> displaced);

  [[nodiscard]] std::uint32_t enabled() const { return enabled_; }
  [[nodiscard]] std::vector<MapVersionInfo> infos() const;
  // Of the enabled version, or of the newest that has any.
  [[nodiscard]] const SmoothedPaths& smoothed() const;

 private:
  const std::size_t max_versions_;
  std::uint32_t next_ = 2;
  std::uint32_t enabled_ = 1;
  std::map<std::uint32_t, MapVersion> versions_;
};

}  // namespace cairn::server
