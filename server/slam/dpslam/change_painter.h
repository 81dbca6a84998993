// Draws scans taken at given poses and returns the resulting changes of the map: per cell, how far laser
// beams travelled in it and how often they were stopped. Scratch memory is kept between calls. Not
// thread-safe.
// Frames: poses are T_map_robot, finite. Source: thesis C 3.2.3.1.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "common/geometry/pose2.h"
#include "server/slam/dpslam/laser_rays.h"
#include "server/slam/dpslam/map_changes.h"

namespace cairn::slam {

class ChangePainter {
 public:
  explicit ChangePainter(double resolution_m) : resolution_m_(resolution_m) {}

  void Draw(const LaserRays& rays, const Pose2& T_map_robot);
  // Returns all changes since the last call.
  [[nodiscard]] MapChanges Take();

 private:
  struct Sheet {
    std::array<float, kChangeTileArea> travel{};  // Travel in cells.
    std::array<std::uint32_t, kChangeTileArea> stops{};
    std::array<std::uint64_t, kChangeTileSide> touched{};  // One bit per cell, one word per row.
  };
  Sheet& SheetAt(const ChangeTileKey& key);

  double resolution_m_;
  std::map<ChangeTileKey, std::unique_ptr<Sheet>> sheets_;
  std::vector<std::unique_ptr<Sheet>> blank_;
};

}  // namespace cairn::slam
