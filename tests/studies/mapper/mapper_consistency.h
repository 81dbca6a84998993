// Tests whether the covariance that the whole mapper reports is right. A simulated robot drives the same way through a
// world many times, each time with other wheels, other slip, other noise of the laser and another seed of the filter.
// At places along the way the error of the reported pose is compared with the reported covariance. Frames: poses in
// `map`; errors are differences of (x, y, theta) along the axes of the map, as the covariance is. Deterministic: the
// same options give the same figures. Source: Bar-Shalom, Li, Kirubarajan 2001, 5.4 (NEES).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "client/sim/world.h"
#include "server/slam/mapper_options.h"

namespace cairn::studies {

// A place to drive in, for how long, and with which lidar.
struct ConsistencyDrive {
  sim::World world;
  double seconds = 0.0;
  double range_sigma_m = 0.02;  // Standard deviation of a range.
  double sweep_s = 0.0;         // Time from the first beam of a scan to the last one.
};

// The shipped building and corridor, a hall with pillars where the laser often sees no wall, and a row of equal rooms.
[[nodiscard]] std::vector<ConsistencyDrive> ConsistencyDrives(double seconds);

// The same drive with a cheap lidar, whose ranges are twice as noisy and whose turn takes 0.2 s.
[[nodiscard]] ConsistencyDrive WithCheapLidar(ConsistencyDrive drive);

// A ring of corridors with equal niches, in which every place is seen again and looks like many others.
[[nodiscard]] ConsistencyDrive NichesDrive(double seconds);

struct MapperConsistencyOptions {
  int runs = 100;
  std::uint64_t first_seed = 1;
  slam::MapperOptions mapper;
  // The mapper's reported standard deviations are multiplied by this before they are compared; 1: as
  // reported. Other values show that the measure detects wrong covariances.
  double doubt_factor = 1.0;
};

// Averages over all runs at one place of the way.
struct MapperConsistencyPoint {
  double travelled_m = 0.0;
  // NEES of (x, y, theta): 3 if the mapper is consistent, more if it states too small an uncertainty.
  double nees = 0.0;
  double nees_median = 0.0;       // 2.37 if consistent. If it is far below the mean, a few runs are very overconfident.
  double position_nees = 0.0;     // NEES of (x, y): 2 if the mapper is consistent.
  double heading_nees = 0.0;      // 1 where consistent.
  double position_error_m = 0.0;  // Root mean square, of both axes together.
  double position_sigma_m = 0.0;  // The reported standard deviation, to compare.
  double heading_error_rad = 0.0;
  double heading_sigma_rad = 0.0;
  double inside = 0.0;         // Share of the runs whose error lies in the 95 % region.
  double singular = 0.0;       // Share of the runs that reported no uncertainty in some direction; not in the NEES.
  double not_localized = 0.0;  // Share of the runs that reported themselves lost or diverged.
};

// Places seen again: of the keyframes at which the robot was within 1 m of an old keyframe, with the same heading
// within 0.5 rad and at least 12 m of way after it (`chances`), those that the mapper has related to an old one
// (`found`); and its relations to old keyframes that are wrong (`wrong`): beside the truth by more than 0.5 m or 0.2
// rad, leaving out directions in which the error is below four standard deviations of the relation itself.
struct SeenAgain {
  std::size_t chances = 0;
  std::size_t found = 0;
  std::size_t relations = 0;
  std::size_t wrong = 0;
};

struct MapperConsistency {
  std::vector<MapperConsistencyPoint> points;
  double nees_low = 0.0;  // 95 % of consistent mappers lie between, at every point.
  double nees_high = 0.0;
  // Over all points; medians are over all runs and points.
  MapperConsistencyPoint whole;
  SeenAgain seen_again;  // Over all runs.
};

// `after_run` is called with the number of runs done.
[[nodiscard]] MapperConsistency StudyMapperConsistency(const ConsistencyDrive& drive,
                                                       const MapperConsistencyOptions& options,
                                                       const std::function<void(int)>& after_run = {});

}  // namespace cairn::studies
