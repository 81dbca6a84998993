#include "tests/studies/mapper/mapper_consistency.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "common/geometry/pose_difference.h"
#include "server/slam/landmarks/innovation.h"
#include "server/slam/scan_pipeline.h"

namespace cairn::studies {
namespace {

constexpr double kPointEveryM = 3.0;

// A scanner that does not see the ends of a corridor, with few beams and few scans, which makes 400 runs
// affordable.
sim::FleetOptions RobotOf(const ConsistencyDrive& drive, std::uint64_t seed) {
  sim::FleetOptions robot;
  robot.robots = 1;
  robot.scan_hz = 4.0;
  robot.odometry_hz = 20.0;
  robot.laser.beams = 180;
  robot.laser.range_max_m = 10.0;
  robot.laser.error.sigma_m = drive.range_sigma_m;
  robot.laser.sweep_s = drive.sweep_s;
  robot.seed = seed;
  return robot;
}

class WorldBuilder {
 public:
  explicit WorldBuilder(const std::string& name) { world_.name = name; }
  WorldBuilder& Chain(const std::vector<Eigen::Vector2d>& points) {
    for (std::size_t i = 0; i + 1 < points.size(); ++i) world_.segments.push_back({points[i], points[i + 1]});
    return *this;
  }
  WorldBuilder& Box(double x, double y, double width, double height) {
    return Chain({{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}, {x, y}});
  }
  WorldBuilder& Pillar(double x, double y, double radius_m) {
    world_.discs.push_back({{x, y}, radius_m});
    return *this;
  }
  WorldBuilder& Route(std::vector<Eigen::Vector2d> waypoints) {
    world_.routes.push_back({"round", std::move(waypoints)});
    return *this;
  }
  [[nodiscard]] sim::World world() const { return world_; }

 private:
  sim::World world_;
};

// 36 x 28 m with pillars and a few crates. In the middle no wall is in range.
sim::World Hall() {
  WorldBuilder hall("hall");
  hall.Box(0, 0, 36, 28);
  for (const double x : {7.0, 14.5, 21.5, 29.0})
    for (const double y : {6.5, 14.0, 21.0}) hall.Pillar(x, y, 0.3);
  hall.Box(1, 11, 1.2, 2.0).Box(12, 26, 2.4, 1.0).Box(33, 20, 1.5, 2.5).Box(24, 0.8, 3.0, 0.9);
  return hall.Route({{4, 4}, {18, 4.5}, {32, 4}, {31.5, 14}, {32, 24}, {18, 23.5}, {18, 13}, {10.5, 17.5}, {4, 18}})
      .world();
}

// Six equal rooms along a corridor, with the same door and the same table in each. The way leads into every
// other one.
sim::World EqualRooms() {
  constexpr double kWidth = 6.0, kDepth = 5.0;
  constexpr int kRooms = 6;
  WorldBuilder rooms("equal rooms");
  std::vector<Eigen::Vector2d> way{{1.0, 1.2}};
  for (int k = 0; k < kRooms; ++k) {
    const double x = k * kWidth;
    rooms.Chain({{x, 2.4}, {x + 2.4, 2.4}, {x + 2.4, 2.52}, {x, 2.52}});
    rooms.Chain({{x + kWidth, 2.4}, {x + 3.6, 2.4}, {x + 3.6, 2.52}, {x + kWidth, 2.52}});
    rooms.Chain({{x, 2.52}, {x, 2.52 + kDepth}, {x + kWidth, 2.52 + kDepth}, {x + kWidth, 2.52}});
    rooms.Box(x + 4.4, 5.6, 1.2, 0.8);
    if (k % 2 == 0) {
      const std::vector<Eigen::Vector2d> inside{{x + 3, 1.2}, {x + 3, 4.2}, {x + 1.5, 6.0}, {x + 3, 4.2}, {x + 3, 1.2}};
      way.insert(way.end(), inside.begin(), inside.end());
    }
  }
  const double length = kRooms * kWidth;
  rooms.Chain({{0, 2.4}, {0, 0}, {length, 0}, {length, 2.4}});
  way.insert(way.end(), {{length - 1.0, 1.2}, {0.5 * length, 1.0}});
  return rooms.Route(way).world();
}

// A ring of four corridors with the same niche every 4 m on both sides, so that every place looks like many others.
sim::World Niches() {
  constexpr double kLength = 26.0, kDepth = 18.0, kWidth = 2.4;
  WorldBuilder ring("niches");
  ring.Box(0, 0, kLength, kDepth).Box(kWidth, kWidth, kLength - 2 * kWidth, kDepth - 2 * kWidth);
  for (double x = 5.0; x < kLength - 4.0; x += 4.0) ring.Box(x, 0, 0.8, 0.3).Box(x, kDepth - 0.3, 0.8, 0.3);
  for (double y = 5.0; y < kDepth - 4.0; y += 4.0) ring.Box(0, y, 0.3, 0.8).Box(kLength - 0.3, y, 0.3, 0.8);
  const double near = 0.5 * kWidth, right = kLength - near, top = kDepth - near;
  return ring.Route({{near, near}, {right, near}, {right, top}, {near, top}}).world();
}

sim::World Shipped(const std::string& name) {
  auto world = sim::OpenWorld(name);
  if (!world) throw std::invalid_argument(world.error().message);
  return *std::move(world);
}

// One place of one run.
struct Place {
  double travelled_m = 0.0;
  double nees = 0.0, position_nees = 0.0, heading_nees = 0.0;
  double position_error2 = 0.0, position_variance = 0.0, heading_error2 = 0.0, heading_variance = 0.0;
  bool localized = true;
  bool singular = false;  // Reported as certain in some direction, so there is no NEES.
};

Place PlaceOf(const slam::ScanOutcome& outcome, const Pose2& T_map_robot_true, double doubt_factor) {
  Eigen::Vector3d error = outcome.T_map_robot.vector() - T_map_robot_true.vector();
  error.z() = WrapAngle(error.z());
  const Eigen::Matrix3d P = doubt_factor * doubt_factor * outcome.covariance;
  const Eigen::Vector2d offset = error.head<2>();
  Place place;
  const Eigen::Matrix2d P_position = P.topLeftCorner<2, 2>();
  const Eigen::LLT<Eigen::Matrix3d> factor(P);
  place.singular = factor.info() != Eigen::Success;
  if (!place.singular) {
    place.nees = error.dot(factor.solve(error));
    place.position_nees = offset.dot(P_position.ldlt().solve(offset));
    place.heading_nees = error.z() * error.z() / P(2, 2);
  }
  place.position_error2 = offset.squaredNorm();
  place.position_variance = P_position.trace();
  place.heading_error2 = error.z() * error.z();
  place.heading_variance = P(2, 2);
  place.localized = outcome.localized;
  return place;
}

// Whether the error of a relation is larger than that of any match, apart from directions that it calls uncertain.
bool IsWrong(const slam::PoseRelation& relation, const Pose2& T_from_to_true) {
  constexpr double kWrongM = 0.5, kWrongRad = 0.2, kSigmas = 4.0;
  const Eigen::Vector3d error = Minus(relation.T_from_to, T_from_to_true);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(relation.covariance.topLeftCorner<2, 2>());
  Eigen::Vector2d offset = axes.eigenvectors().transpose() * error.head<2>();
  for (int i = 0; i < 2; ++i)
    if (offset[i] * offset[i] < kSigmas * kSigmas * axes.eigenvalues()[i]) offset[i] = 0.0;
  return offset.norm() > kWrongM || std::abs(error.z()) > kWrongRad;
}

SeenAgain SeenAgainIn(const slam::MapperSnapshot& snapshot, const Trajectory& truth) {
  constexpr double kNearM = 1.0, kSameHeadingRad = 0.5, kLaterM = 12.0;
  std::vector<Pose2> keyframes;
  std::vector<double> way_m;
  std::size_t at = 0;
  for (const slam::Keyframe& keyframe : snapshot.keyframes) {
    while (at + 1 < truth.size() && truth[at].stamp < keyframe.scan->stamp) ++at;
    const Pose2& pose = truth[at].T_map_robot;
    way_m.push_back(keyframes.empty() ? 0.0
                                      : way_m.back() + (pose.translation() - keyframes.back().translation()).norm());
    keyframes.push_back(pose);
  }
  SeenAgain seen;
  std::vector<bool> related(keyframes.size(), false);
  for (const slam::PoseRelation& relation : snapshot.relations) {
    if (!relation.loop) continue;
    related[std::max(relation.from, relation.to)] = true;
    ++seen.relations;
    seen.wrong += IsWrong(relation, Between(keyframes[relation.from], keyframes[relation.to])) ? 1 : 0;
  }
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    bool chance = false;
    for (std::size_t old = 0; old < k && way_m[k] - way_m[old] >= kLaterM && !chance; ++old)
      chance = (keyframes[old].translation() - keyframes[k].translation()).norm() < kNearM &&
               std::abs(AngleDiff(keyframes[old].theta, keyframes[k].theta)) < kSameHeadingRad;
    if (!chance) continue;
    ++seen.chances;
    seen.found += related[k] ? 1 : 0;
  }
  return seen;
}

// The places of one drive, every kPointEveryM of the true path. What was seen again is added to `seen_again`.
std::vector<Place> DriveOnce(const ConsistencyDrive& drive, const MapperConsistencyOptions& options, std::uint64_t seed,
                             SeenAgain& seen_again) {
  const sim::FleetOptions robot = RobotOf(drive, seed);
  auto fleet = sim::Fleet::Create(drive.world, robot);
  if (!fleet) throw std::invalid_argument(fleet.error().message);
  std::vector<slam::ScanOutcome> outcomes;
  slam::MapperOptions mapper = options.mapper;
  mapper.seed = static_cast<std::int64_t>(seed);
  slam::ScanPipeline pipeline(
      mapper, fleet->T_map_robot_start(0), slam::SerialFor,
      {.used = [&](const Scan&, const slam::ScanOutcome& outcome) { outcomes.push_back(outcome); },
       .dropped = [](const Scan&, DropReason) {}});
  const Stamp end = robot.first_stamp + StampFromSeconds(drive.seconds);
  for (;;) {
    sim::FleetRecord record = fleet->Next();
    if (std::visit([](const auto& value) { return value.stamp; }, record.record) > end) break;
    if (const auto* odometry = std::get_if<Odometry>(&record.record)) {
      pipeline.Add(*odometry);
    } else {
      pipeline.Add(std::make_shared<const Scan>(std::get<Scan>(std::move(record.record))));
    }
  }
  pipeline.Finish();

  std::vector<Place> places;
  const Trajectory& truth = fleet->truth(0);
  const SeenAgain seen = SeenAgainIn(pipeline.mapper().Snapshot(), truth);
  seen_again.chances += seen.chances;
  seen_again.found += seen.found;
  seen_again.relations += seen.relations;
  seen_again.wrong += seen.wrong;
  double travelled_m = 0.0;
  for (std::size_t i = 1, used = 0; i < truth.size(); ++i) {
    travelled_m += (truth[i].T_map_robot.translation() - truth[i - 1].T_map_robot.translation()).norm();
    while (used < outcomes.size() && outcomes[used].stamp < truth[i].stamp) ++used;
    if (used == outcomes.size()) break;
    if (outcomes[used].stamp != truth[i].stamp) continue;
    if (travelled_m < kPointEveryM * static_cast<double>(places.size() + 1)) continue;
    places.push_back(PlaceOf(outcomes[used], truth[i].T_map_robot, options.doubt_factor));
    places.back().travelled_m = travelled_m;
  }
  return places;
}

double MedianOf(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

MapperConsistencyPoint Summarise(const std::vector<Place>& places) {
  MapperConsistencyPoint point;
  std::vector<double> nees;
  for (const Place& place : places)
    if (!place.singular) nees.push_back(place.nees);
  const double inside = slam::ChiSquareQuantile(0.95, 3.0), share = 1.0 / static_cast<double>(places.size());
  const double regular = nees.empty() ? 0.0 : 1.0 / static_cast<double>(nees.size());
  for (const Place& place : places) {
    point.travelled_m += share * place.travelled_m;
    point.nees += regular * place.nees;
    point.position_nees += regular * place.position_nees;
    point.heading_nees += regular * place.heading_nees;
    point.position_error_m += share * place.position_error2;
    point.position_sigma_m += share * place.position_variance;
    point.heading_error_rad += share * place.heading_error2;
    point.heading_sigma_rad += share * place.heading_variance;
    point.inside += !place.singular && place.nees <= inside ? share : 0.0;
    point.singular += place.singular ? share : 0.0;
    point.not_localized += place.localized ? 0.0 : share;
  }
  for (double* square :
       {&point.position_error_m, &point.position_sigma_m, &point.heading_error_rad, &point.heading_sigma_rad})
    *square = std::sqrt(*square);
  point.nees_median = MedianOf(std::move(nees));
  return point;
}

}  // namespace

std::vector<ConsistencyDrive> ConsistencyDrives(double seconds) {
  std::vector<ConsistencyDrive> drives;
  for (sim::World world : {Shipped("building"), Shipped("corridor"), Hall(), EqualRooms()})
    drives.push_back({std::move(world), seconds});
  return drives;
}

ConsistencyDrive WithCheapLidar(ConsistencyDrive drive) {
  drive.world.name += ", cheap lidar";
  drive.range_sigma_m = 0.04;
  drive.sweep_s = 0.2;
  return drive;
}

ConsistencyDrive NichesDrive(double seconds) {
  return {Niches(), seconds};
}

MapperConsistency StudyMapperConsistency(const ConsistencyDrive& drive, const MapperConsistencyOptions& options,
                                         const std::function<void(int)>& after_run) {
  MapperConsistency result;
  std::vector<std::vector<Place>> by_point;
  std::vector<Place> all;
  for (int run = 0; run < options.runs; ++run) {
    const std::vector<Place> places =
        DriveOnce(drive, options, options.first_seed + static_cast<std::uint64_t>(run), result.seen_again);
    if (by_point.size() < places.size()) by_point.resize(places.size());
    for (std::size_t p = 0; p < places.size(); ++p) by_point[p].push_back(places[p]);
    all.insert(all.end(), places.begin(), places.end());
    if (after_run) after_run(run + 1);
  }
  for (const auto& places : by_point) result.points.push_back(Summarise(places));
  if (!all.empty()) result.whole = Summarise(all);
  const double numbers = 3.0 * options.runs;
  result.nees_low = 3.0 * slam::ChiSquareQuantile(0.025, numbers) / numbers;
  result.nees_high = 3.0 * slam::ChiSquareQuantile(0.975, numbers) / numbers;
  return result;
}

}  // namespace cairn::studies
