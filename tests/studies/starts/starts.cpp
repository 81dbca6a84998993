// cairn-study starts: robots that are told a wrong place where they start, in a map that others have made. After which
// way the map contradicts what such a robot draws, and whether it ever contradicts one whose start is as exact as a
// person says it. Through the estimator, the comparison and the judgement of the server (jobs/start_judgement.h),
// without a server. --runs: starts for each robot and kind (10).
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "client/sim/fleet.h"
#include "client/sim/shipped_worlds.h"
#include "server/jobs/start_judgement.h"
#include "server/maps/layer_sum.h"
#include "server/slam/scan_pipeline.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

using server::CompareGrids;
using server::GridAgreement;
using server::StartJudgement;
using slam::OccupancyGrid;

constexpr double kWantedM = 5.0;  // A wrong start is to be noticed within this way.
// Of the wrong starts that there is something to compare with, in all worlds: so many are refused on the first 8 m. All
// are wanted; this is what holds today, so that it does not become less without being noticed.
constexpr double kLeastRefused = 0.8;

sim::Fleet MakeFleet(const std::string& world, std::uint64_t seed) {
  auto surroundings = sim::OpenSurroundings(world);
  if (!surroundings) throw std::runtime_error(surroundings.error().message);
  sim::FleetOptions options;
  options.robots = 4;
  options.laser.beams = 360;
  options.seed = seed;
  auto fleet = sim::Fleet::Create(std::move(*surroundings), options);
  if (!fleet) throw std::runtime_error(fleet.error().message);
  return std::move(*fleet);
}

using RobotRecords = std::vector<std::vector<LogRecord>>;

RobotRecords Drive(sim::Fleet& fleet, double seconds) {
  RobotRecords records(static_cast<std::size_t>(fleet.robots()));
  const Stamp end = sim::FleetOptions{}.first_stamp + StampFromSeconds(seconds);
  for (;;) {
    sim::FleetRecord next = fleet.Next();
    if (std::visit([](const auto& one) { return one.stamp; }, next.record) > end) return records;
    records[static_cast<std::size_t>(next.robot)].push_back(std::move(next.record));
  }
}

// Calls visit(way_m, grid) where the server would compare, as far as `last_m`, and at the end (way_m < 0). Where
// the robot is not localized after a metre, nothing is compared.
template <typename Visit>
void Draw(const std::vector<LogRecord>& records, const Pose2& T_map_robot_start, double last_m, const Visit& visit) {
  double way_m = 0.0, next_m = StartJudgement::kEveryM;
  bool localized = false;
  std::optional<Pose2> last;
  slam::MapperOptions options;
  options.filter.particles = 20;
  slam::ScanPipeline pipeline(options, T_map_robot_start, slam::SerialFor,
                              {.used =
                                   [&](const Scan&, const slam::ScanOutcome& outcome) {
                                     localized = outcome.localized;
                                     if (!outcome.keyframe) return;
                                     if (last)
                                       way_m += (outcome.T_map_robot.translation() - last->translation()).norm();
                                     last = outcome.T_map_robot;
                                   },
                               .dropped = [](const Scan&, DropReason) {}});
  for (const LogRecord& record : records) {
    if (const auto* const scan = std::get_if<Scan>(&record)) {
      pipeline.Add(std::make_shared<const Scan>(*scan));
    } else {
      pipeline.Add(std::get<Odometry>(record));
    }
    for (; way_m >= next_m && next_m <= last_m; next_m += StartJudgement::kEveryM)
      if (localized) visit(next_m, pipeline.mapper().ShareGrid());
    if (way_m > last_m) break;
  }
  visit(-1.0, pipeline.mapper().ShareGrid());
}

// The sum of several grids of one time.
OccupancyGrid::Chunks SumOf(const std::vector<OccupancyGrid::Chunks>& grids, std::size_t without) {
  std::map<slam::ChunkKey, slam::GridChunk> sums;
  for (std::size_t i = 0; i < grids.size(); ++i) {
    if (i == without) continue;
    for (const auto& [key, chunk] : grids[i])
      server::AddBeside(sums.try_emplace(key, server::UnseenChunk()).first->second, *chunk);
  }
  OccupancyGrid::Chunks shared;
  for (const auto& [key, chunk] : sums) shared.emplace(key, std::make_shared<const slam::GridChunk>(chunk));
  return shared;
}

struct Kind {
  std::string name;
  double from_m = 0.0, to_m = 0.0;      // Error of the position, in any direction.
  double from_rad = 0.0, to_rad = 0.0;  // Error of the heading, to either side.
  bool wrong = false;
};

const std::vector<Kind> kKinds = {
    {"as a person says it", 0.0, 0.3, 0.0, 0.05, false},    {"carelessly", 0.3, 0.5, 0.05, 0.1, false},
    {"1.5 to 3 m beside", 1.5, 3.0, 0.0, 0.1, true},        {"3 to 10 m beside", 3.0, 10.0, 0.0, 0.1, true},
    {"turned by 0.4 to 0.8 rad", 0.0, 0.3, 0.4, 0.8, true}, {"another way round", 0.0, 1.0, 2.8, 3.2, true}};

struct Count {
  int starts = 0, judged = 0, refused_within = 0, refused = 0;
  double sum_m = 0.0, most_m = 0.0;            // Way until they were refused.
  double most_share = 0.0, least_share = 1.0;  // Of those that were judged, at the end.
};

void RunStarts(StudyContext& context) {
  Report& report = context.report;
  const int runs = context.runs > 0 ? context.runs : context.Pick(10, 1);
  Count wrong;  // In all worlds.
  for (const std::string world : {"office", "building", "storey"}) {
    report.Heading("World " + world);
    sim::Fleet fleet = MakeFleet(world, context.seed);
    const RobotRecords whole = Drive(fleet, context.quick ? 60.0 : 180.0);
    std::vector<OccupancyGrid::Chunks> grids(whole.size());
    for (std::size_t i = 0; i < whole.size(); ++i)
      Draw(whole[i], fleet.T_map_robot_start(static_cast<int>(i)), 1e9,
           [&](double way_m, OccupancyGrid::Chunks&& grid) {
             if (way_m < 0.0) grids[i] = std::move(grid);
           });
    sim::Fleet other = MakeFleet(world, context.seed + 1);
    const RobotRecords first = Drive(other, 20.0);
    std::mt19937_64 random(context.seed);
    std::uniform_real_distribution<double> any(0.0, 1.0);
    std::map<std::string, Count> counts;
    for (std::size_t robot = 0; robot < first.size(); ++robot) {
      const OccupancyGrid::Chunks others = SumOf(grids, robot);
      for (const Kind& kind : kKinds) {
        for (int run = 0; run < runs; ++run) {
          Count& count = counts[kind.name];
          const double away_m = kind.from_m + (kind.to_m - kind.from_m) * any(random),
                       direction = 2 * kPi * any(random);
          const double turn =
              (any(random) < 0.5 ? -1.0 : 1.0) * (kind.from_rad + (kind.to_rad - kind.from_rad) * any(random));
          const Pose2& start = other.T_map_robot_start(static_cast<int>(robot));
          const Pose2 said{start.x + away_m * std::cos(direction), start.y + away_m * std::sin(direction),
                           WrapAngle(start.theta + turn)};
          std::optional<double> refused_m;
          StartJudgement judgement;
          GridAgreement last;
          Draw(first[robot], said, StartJudgement::kFirstM, [&](double way_m, const OccupancyGrid::Chunks& grid) {
            last = CompareGrids(grid, others, said, slam::GridOptions{}.resolution_m);
            if (way_m >= 0.0 && judgement.Refuses(last, way_m) && !refused_m) refused_m = way_m;
          });
          ++count.starts;
          if (last.compared < 100) continue;
          ++count.judged;
          if (refused_m) {
            ++count.refused;
            count.sum_m += *refused_m;
            count.most_m = std::max(count.most_m, *refused_m);
          }
          count.refused_within += refused_m && *refused_m <= kWantedM ? 1 : 0;
          count.most_share = std::max(count.most_share, last.contradicted_share());
          count.least_share = std::min(count.least_share, last.contradicted_share());
        }
      }
    }
    Table table({"start said", "starts", "with something to compare", "refused within 5 m", "refused within 8 m",
                 "after (m), mean", "most", "share that contradicts, least (%)", "most (%)"});
    for (const Kind& kind : kKinds) {
      const Count& count = counts[kind.name];
      table.Add({kind.name, std::to_string(count.starts), std::to_string(count.judged),
                 std::to_string(count.refused_within), std::to_string(count.refused),
                 Number(count.sum_m / std::max(1, count.refused), 1), Number(count.most_m, 1),
                 Number(100.0 * count.least_share, 1), Number(100.0 * count.most_share, 1)});
      if (!kind.wrong) {
        report.Expect(count.refused == 0, world + ": a start said " + kind.name + " was refused");
        continue;
      }
      wrong.judged += count.judged;
      wrong.refused_within += count.refused_within;
      wrong.refused += count.refused;
      wrong.sum_m += count.sum_m;
      wrong.most_m = std::max(wrong.most_m, count.most_m);
    }
    report.Add(table, "starts-" + world);
  }
  const std::string share = Number(100.0 * wrong.refused / std::max(1, wrong.judged), 0) + " %";
  report.Text("Wrong starts in all worlds: " + std::to_string(wrong.refused) + " of " + std::to_string(wrong.judged) +
              " with something to compare were refused (" + share + "), " + std::to_string(wrong.refused_within) +
              " of them within 5 m, after " + Number(wrong.sum_m / std::max(1, wrong.refused), 1) +
              " m of way on the average and " + Number(wrong.most_m, 1) +
              " m at most. The rest drove on with a wrong start.");
  if (!context.quick)
    report.Expect(wrong.refused >= kLeastRefused * wrong.judged, "only " + share + " of the wrong starts were refused");
}

const Registration kStarts("starts", "wrong starts in a map that others have made: whether and when they are noticed",
                           RunStarts);

}  // namespace
}  // namespace cairn::studies
