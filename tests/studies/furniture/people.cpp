// cairn-study furniture, the third part: people who walk where a robot drives. How much of them is left in its map?
#include "tests/studies/furniture/people.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "server/slam/scan_pipeline.h"

namespace cairn::studies {
namespace {

constexpr std::uint8_t kDrawn = 65;
constexpr double kPersonM = 0.25, kPersonMps = 0.7;
constexpr double kBesideM = 0.11;    // So far a wall may lie elsewhere in the map of another drive.
constexpr double kMostLeft = 0.005;  // Share of the cells where people walked.

// People who walk the way of the first route, against the robot, spread over it.
std::vector<sim::Walker> PeopleAgainst(const sim::Route& route, int people) {
  std::vector<sim::Walker> walkers;
  for (int i = 0; i < people; ++i) {
    std::vector<Eigen::Vector2d> path(route.waypoints_map.rbegin(), route.waypoints_map.rend());
    const auto begin = static_cast<std::ptrdiff_t>(path.size()) * i / people;
    std::rotate(path.begin(), path.begin() + begin, path.end());
    walkers.push_back({kPersonM, kPersonMps, std::move(path)});
  }
  return walkers;
}

struct Mapped {
  std::unique_ptr<slam::ScanPipeline> robot;
  int scans = 0, localized = 0;

  [[nodiscard]] bool Occupied(const Eigen::Vector2d& p_map) const {
    const std::uint8_t cell = robot->mapper().grid().OccupancyAt(p_map);
    return cell != kUnknownCell && cell >= kDrawn;
  }
};

std::unique_ptr<Mapped> MapOf(sim::Surroundings surroundings, double seconds, std::uint64_t seed) {
  sim::FleetOptions options;
  options.robots = 1;
  options.seed = seed;
  auto fleet = sim::Fleet::Create(std::move(surroundings), options);
  if (!fleet) throw std::invalid_argument(fleet.error().message);
  auto mapped = std::make_unique<Mapped>();
  slam::MapperOptions mapper;
  mapper.seed = static_cast<std::int64_t>(seed);
  Mapped& counts = *mapped;
  mapped->robot = std::make_unique<slam::ScanPipeline>(
      mapper, fleet->T_map_robot_start(0), slam::SerialFor,
      slam::ScanPipeline::Sink{.used =
                                   [&counts](const Scan&, const slam::ScanOutcome& outcome) {
                                     ++counts.scans;
                                     counts.localized += outcome.localized ? 1 : 0;
                                   },
                               .dropped = [](const Scan&, DropReason) {}});
  const Stamp end = options.first_stamp + StampFromSeconds(seconds);
  for (;;) {
    sim::FleetRecord next = fleet->Next();
    if (std::visit([](const auto& one) { return one.stamp; }, next.record) > end) return mapped;
    if (const auto* const odometry = std::get_if<Odometry>(&next.record)) {
      mapped->robot->Add(*odometry);
    } else {
      mapped->robot->Add(std::make_shared<const Scan>(std::get<Scan>(std::move(next.record))));
    }
  }
}

// The middles of the cells over which people have walked.
std::vector<Eigen::Vector2d> CellsWalked(const std::vector<sim::Walker>& walkers, double resolution_m) {
  std::set<std::pair<int, int>> cells;
  const int reach = static_cast<int>(std::ceil(kPersonM / resolution_m));
  for (const sim::Walker& walker : walkers) {
    const double length_m = sim::ClosedLength(walker.path_map);
    for (double way_m = 0.0; way_m < length_m; way_m += resolution_m) {
      const Eigen::Vector2d p = sim::PlaceOnPath(walker.path_map, way_m).p_map / resolution_m;
      const int x = static_cast<int>(std::floor(p.x())), y = static_cast<int>(std::floor(p.y()));
      for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx)
          if (dx * dx + dy * dy <= reach * reach) cells.emplace(x + dx, y + dy);
    }
  }
  std::vector<Eigen::Vector2d> middles;
  middles.reserve(cells.size());
  for (const auto& [x, y] : cells) middles.push_back(resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5));
  return middles;
}

bool IsBesideWall(const Mapped& without, const Eigen::Vector2d& p_map, double resolution_m) {
  for (double y = -kBesideM; y <= kBesideM; y += resolution_m)
    for (double x = -kBesideM; x <= kBesideM; x += resolution_m)
      if (without.Occupied(p_map + Eigen::Vector2d(x, y))) return true;
  return false;
}

}  // namespace

void StudyPeople(StudyContext& context) {
  Report& report = context.report;
  report.Heading("People who walk where a robot drives");
  report.Text(
      "A robot maps the world `building` while people walk its route the other way round, and once more without them. "
      "`drawn`: cells over which people walked that are occupied at the end of the drive, and have no wall beside them "
      "in the map without people. They stand where somebody was when the robot looked there last.");
  const double seconds = context.Pick(900.0, 240.0);
  Table table({"people", "drive (s)", "scans localized (%)", "cells walked over and seen", "drawn", "share (%)"});
  const auto surroundings = sim::OpenSurroundings("building");
  if (!surroundings) throw std::invalid_argument(surroundings.error().message);
  sim::Surroundings empty = *surroundings;
  empty.walkers.clear();
  const auto without = MapOf(empty, seconds, context.seed);
  const double resolution_m = without->robot->mapper().grid().options().resolution_m;
  for (const int people : {1, 4, 8}) {
    sim::Surroundings peopled = empty;
    peopled.walkers = PeopleAgainst(peopled.routes.front(), people);
    const auto with = MapOf(peopled, seconds, context.seed);
    int seen = 0, drawn = 0;
    for (const Eigen::Vector2d& cell : CellsWalked(peopled.walkers, resolution_m)) {
      if (with->robot->mapper().grid().OccupancyAt(cell) == kUnknownCell) continue;
      ++seen;
      drawn += with->Occupied(cell) && !IsBesideWall(*without, cell, resolution_m) ? 1 : 0;
    }
    const double share = static_cast<double>(drawn) / std::max(1, seen);
    table.Add({Count(people), Number(seconds, 0), Number(100.0 * with->localized / std::max(1, with->scans), 1),
               Count(seen), Count(drawn), Number(100.0 * share, 2)});
    report.Expect(share <= kMostLeft, Count(people) + " people left " + Number(100.0 * share, 2) +
                                          " % of the cells over which they walked occupied");
  }
  report.Add(table, "people");
}

}  // namespace cairn::studies
