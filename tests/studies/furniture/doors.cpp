// cairn-study furniture, the second part: doors that open and close while a robot drives past them again and again.
// What does its map show of them after so many changes that it has seen, and does it still know where it is?
#include "tests/studies/furniture/doors.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "server/slam/landmarks/innovation.h"
#include "server/slam/scan_pipeline.h"
#include "tests/server/slam/known_grid_of.h"

namespace cairn::studies {
namespace {

constexpr double kLookM = 4.0, kPastM = 6.0;  // A look: from nearer than the one, then the door is left behind.
constexpr int kMostChanges = 6;               // That are told apart.
constexpr int kSometimesFrom = 15, kSometimesTo = 85;
constexpr double kWrongM = 0.5, kWrongRad = 0.1;

// The doorways from the ring corridor of the world `office` into the outer rooms (worlds/office.yaml).
std::vector<sim::Door> OfficeDoors() {
  constexpr double kWidthM = 1.1, kTurnS = 40.0;
  struct Side {
    Eigen::Vector2d from, along;
    std::vector<double> gaps_m;
  };
  const std::vector<Side> sides = {{{8, 7}, {1, 0}, {3, 11, 17.5, 26, 33, 40}},
                                   {{52, 7}, {0, 1}, {4, 13, 20}},
                                   {{52, 33}, {-1, 0}, {4, 12, 20, 29, 38}},
                                   {{8, 33}, {0, -1}, {4, 12, 21}}};
  std::vector<sim::Door> doors;
  for (const Side& side : sides) {
    for (const double gap_m : side.gaps_m) {
      doors.push_back({side.from + gap_m * side.along, side.from + (gap_m + kWidthM) * side.along, kTurnS, kTurnS,
                       7.0 * static_cast<double>(doors.size())});
    }
  }
  return doors;
}

sim::Fleet MakeFleet(const std::vector<sim::Door>& doors, std::uint64_t seed) {
  auto place = sim::OpenSurroundings("office");
  if (!place) throw std::invalid_argument(place.error().message);
  place->doors = doors;
  sim::FleetOptions options;
  options.robots = 1;
  options.seed = seed;
  auto fleet = sim::Fleet::Create(*std::move(place), options);
  if (!fleet) throw std::invalid_argument(fleet.error().message);
  return std::move(*fleet);
}

// What a map shows where the leaf of a door is when it is closed, in per cent; nothing where it shows nothing.
std::optional<double> OccupancyOf(const slam::OccupancyGrid& grid, const sim::Door& door) {
  const double cell_m = grid.options().resolution_m;
  const Eigen::Vector2d leaf = door.b_map - door.a_map, across = Eigen::Vector2d(-leaf.y(), leaf.x()).normalized();
  double sum = 0.0;
  int points = 0;
  for (double share = 0.2; share < 0.85; share += 0.1) {
    int most = -1;  // The surface of the leaf may lie in a cell beside it.
    for (const int beside : {-1, 0, 1}) {
      const int cell = grid.OccupancyAt(door.a_map + share * leaf + beside * cell_m * across);
      if (cell != kUnknownCell) most = std::max(most, cell);
    }
    if (most < 0) continue;
    sum += most;
    ++points;
  }
  return points == 0 ? std::nullopt : std::optional(sum / points);
}

struct Watched {
  sim::Door door;
  bool near = false;
  bool closed = false;  // When it was seen last,
  std::optional<bool> before = {};
  int changes = 0;
};

struct Looks {
  int all = 0, closed = 0, sometimes = 0;
  double sum = 0.0, sum_closed = 0.0, sum_open = 0.0;
};

struct Errors {
  int localized = 0, not_localized = 0, wrong = 0;
  int outside = 0;  // The error of the position lies outside the 99.9 % region of the stated doubt.
  double sum_m = 0.0, most_m = 0.0;

  void Add(const slam::ScanOutcome& outcome, const Pose2& truth) {
    if (!outcome.localized) {
      ++not_localized;
      return;
    }
    const Pose2 error = Between(truth, outcome.T_map_robot);
    const double error_m = error.translation().norm();
    ++localized;
    sum_m += error_m;
    most_m = std::max(most_m, error_m);
    wrong += error_m > kWrongM || std::abs(error.theta) > kWrongRad ? 1 : 0;
    const Eigen::Vector2d beside = outcome.T_map_robot.translation() - truth.translation();
    const Eigen::Matrix2d doubt = outcome.covariance.topLeftCorner<2, 2>();
    static const double kLargestNis = slam::ChiSquareQuantile(0.999, 2.0);
    outside += beside.dot(doubt.ldlt().solve(beside)) > kLargestNis ? 1 : 0;
  }
};

// A robot maps the office for so long.
std::shared_ptr<const slam::KnownGrid> OfficeMap(const std::vector<sim::Door>& doors, double seconds,
                                                 std::uint64_t seed) {
  sim::Fleet fleet = MakeFleet(doors, seed);
  slam::MapperOptions options;
  options.seed = static_cast<std::int64_t>(seed);
  slam::ScanPipeline pipeline(
      options, fleet.T_map_robot_start(0), slam::SerialFor,
      {.used = [](const Scan&, const slam::ScanOutcome&) {}, .dropped = [](const Scan&, DropReason) {}});
  const Stamp end = sim::FleetOptions{}.first_stamp + StampFromSeconds(seconds);
  for (;;) {
    sim::FleetRecord next = fleet.Next();
    if (auto* const scan = std::get_if<Scan>(&next.record)) {
      pipeline.Add(std::make_shared<const Scan>(std::move(*scan)));
      continue;
    }
    const auto& odometry = std::get<Odometry>(next.record);
    if (odometry.stamp > end) return slam::test::KnownGridOf(pipeline.mapper().grid(), options);
    pipeline.Add(odometry);
  }
}

// A robot drives through the office for so long. It maps it, or is only localised in `map` if there is one. `looks`: by
// the changes of a door between looks so far, at the map that it makes.
Errors DrivePast(const std::vector<sim::Door>& doors, double seconds, std::uint64_t seed,
                 const std::shared_ptr<const slam::KnownGrid>& map, std::map<int, Looks>& looks) {
  sim::Fleet fleet = MakeFleet(doors, seed);
  std::vector<Watched> watched;
  for (const sim::Door& door : doors) watched.push_back({.door = door});
  Errors errors;
  Pose2 truth = fleet.T_map_robot_start(0);
  slam::MapperOptions options;
  options.seed = static_cast<std::int64_t>(seed);
  std::map<Stamp, Pose2> truths;  // Of scans that wait.
  slam::ScanPipeline pipeline(options, truth, slam::SerialFor,
                              {.used =
                                   [&](const Scan& scan, const slam::ScanOutcome& outcome) {
                                     errors.Add(outcome, truths.at(scan.stamp));
                                     truths.erase(scan.stamp);
                                   },
                               .dropped = [&](const Scan& scan, DropReason) { truths.erase(scan.stamp); }});
  if (map != nullptr) static_cast<void>(pipeline.mapper().LocaliseIn(map, true));
  const Stamp first = sim::FleetOptions{}.first_stamp, end = first + StampFromSeconds(seconds);
  for (;;) {
    sim::FleetRecord next = fleet.Next();
    if (auto* const odometry = std::get_if<Odometry>(&next.record)) {
      if (odometry->stamp > end) return errors;
      pipeline.Add(*odometry);
      continue;
    }
    auto scan = std::make_shared<const Scan>(std::get<Scan>(std::move(next.record)));
    truth = fleet.TakeTruth(0).back().T_map_robot;
    const double now_s = SecondsFromStamp(scan->stamp - first);
    truths.emplace(scan->stamp, truth);
    pipeline.Add(std::move(scan));
    if (map != nullptr) continue;
    for (Watched& one : watched) {
      const double away_m = sim::DistanceFrom(one.door, truth.translation());
      if (away_m < kLookM) {
        one.near = true;
        one.closed = sim::IsClosed(one.door, now_s);
      } else if (one.near && away_m > kPastM) {
        one.near = false;
        if (one.before && *one.before != one.closed) ++one.changes;
        one.before = one.closed;
        const auto shown = OccupancyOf(pipeline.mapper().grid(), one.door);
        if (!shown) continue;
        Looks& look = looks[std::min(one.changes, kMostChanges)];
        ++look.all;
        look.closed += one.closed ? 1 : 0;
        look.sometimes += *shown >= kSometimesFrom && *shown <= kSometimesTo ? 1 : 0;
        look.sum += *shown;
        (one.closed ? look.sum_closed : look.sum_open) += *shown;
      }
    }
  }
}

std::string MeanOf(double sum, int count) {
  return count == 0 ? "-" : Number(sum / count, 0);
}

}  // namespace

void StudyDoors(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Doors that open and close");
  report.Text(
      "A robot drives around the ring of the office, past 17 doors that are closed for 40 s and open for 40 s. After "
      "each "
      "look at a door: what the cells of its leaf show, by how often the door was found changed since the look before. "
      "`sometimes` is from 15 to 85 %.");
  const double seconds = context.Pick(3000.0, 300.0);
  std::map<int, Looks> looks, none;
  const Errors with = DrivePast(OfficeDoors(), seconds, context.seed, nullptr, looks);
  const Errors without = DrivePast({}, seconds, context.seed, nullptr, none);
  // All doors are open in the one map, and some are closed in the other.
  const double mapped_s = context.Pick(600.0, 200.0);
  const Errors open = DrivePast(OfficeDoors(), seconds, context.seed + 1, OfficeMap({}, mapped_s, context.seed), none);
  const Errors mixed =
      DrivePast(OfficeDoors(), seconds, context.seed + 1, OfficeMap(OfficeDoors(), mapped_s, context.seed), none);
  Table shown(
      {"changes seen", "looks", "occupancy (%)", "after it was closed (%)", "after it was open (%)", "at `sometimes`"});
  for (const auto& [changes, look] : looks) {
    shown.Add({Count(changes) + (changes == kMostChanges ? " or more" : ""), Count(look.all),
               MeanOf(look.sum, look.all), MeanOf(look.sum_closed, look.closed),
               MeanOf(look.sum_open, look.all - look.closed), Percent(static_cast<double>(look.sometimes) / look.all)});
  }
  report.Add(shown, "doors");
  if (const auto last = looks.find(kMostChanges); last != looks.end() && 2 * last->second.sometimes < last->second.all)
    report.Warn("fewer than half of the doors that have changed often are shown as sometimes occupied");
  Table places(
      {"doors", "poses localized", "not localized", "mean error (m)", "largest error (m)", "wrong", "outside 99.9 %"});
  for (const auto& [name, errors] : {std::pair{"open and close", with}, std::pair{"none", without},
                                     std::pair{"open and close, only localised in a map without doors", open},
                                     std::pair{"open and close, only localised in a map with doors", mixed}}) {
    places.Add({name, Count(errors.localized), Count(errors.not_localized),
                Number(errors.sum_m / std::max(1, errors.localized), 3), Number(errors.most_m, 3), Count(errors.wrong),
                Percent(static_cast<double>(errors.outside) / std::max(1, errors.localized), 2)});
    report.Expect(errors.wrong == 0, std::string("doors ") + name + ": a robot was localized at a wrong place");
  }
  report.Add(places, "doors-places");
}

}  // namespace cairn::studies
