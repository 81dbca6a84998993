#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "server/slam/methods.h"
#include "server/slam/tracking/front_end.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/thesis_b/thesis_b.h"

namespace cairn::studies {
namespace {

struct Step {
  slam::ScanView prev, curr;
  slam::MatchPrior prior;
};

// Calls visit for pairs of scans at least 0.25 m or 10 deg apart by odometry.
template <typename Visit>
void ForEachStep(const StudyLog& log, int most, const Visit& visit) {
  std::optional<Odometry> odometry;
  std::optional<slam::ScanView> last;
  Pose2 T_odom_last;
  int steps = 0;
  for (const LogRecord& record : log.records) {
    if (const auto* sample = std::get_if<Odometry>(&record)) {
      odometry = *sample;
      continue;
    }
    const Scan& scan = std::get<Scan>(record);
    if (!odometry || !ValidateScan(scan)) continue;
    const Pose2 moved = Between(T_odom_last, odometry->T_odom_robot);
    if (last && moved.translation().norm() < 0.25 && std::abs(moved.theta) < Radians(10)) continue;
    slam::ScanView view = slam::Look(scan, slam::FrontEndOptions{});
    if (last) {
      Step step{*last, view, {moved, Eigen::Vector3d(0.01, 0.01, 0.0025).asDiagonal()}};
      visit(step);
      if (++steps >= most) return;
    }
    last = std::move(view);
    T_odom_last = odometry->T_odom_robot;
  }
}

}  // namespace

void StudyTracking(StudyContext& context, const std::vector<StudyLog>& logs) {
  Report& report = context.report;
  report.Heading("Consecutive scans of the available logs");
  report.Text(
      "Pairs of scans that are at least 0.25 m or 10 deg apart are matched with odometry as the guess. "
      "The true step is not known. The answer is therefore compared with that of point-to-line ICP, if "
      "both converge.");
  Table table({"log", "pairs", "converged", "flagged degenerate", "rounds mean", "rounds p95",
               "apart from ICP median (cm)", "p95 (cm)", "median (deg)", "p95 (deg)", "time mean (ms)", "p99 (ms)",
               "ICP mean (ms)"});
  for (const StudyLog& log : logs) {
    int pairs = 0, converged = 0, degenerate = 0;
    std::vector<double> rounds, cm, deg, time, icp_time;
    ForEachStep(log, context.Pick(1500, 150), [&](const Step& step) {
      ++pairs;
      Stopwatch watch;
      const slam::MatchResult lines =
          slam::MakeMatcher(slam::MatcherKind::kLineLsq, {}).match(step.prev, step.curr, step.prior, slam::SerialFor);
      time.push_back(watch.CpuMs());
      watch.Restart();
      const slam::MatchResult icp =
          slam::MakeMatcher(slam::MatcherKind::kIcp, {}).match(step.prev, step.curr, step.prior, slam::SerialFor);
      icp_time.push_back(watch.CpuMs());
      if (!lines.converged) return;
      ++converged;
      degenerate += lines.degenerate;
      rounds.push_back(lines.iterations);
      if (!icp.converged || icp.degenerate || lines.degenerate) return;
      const Pose2 apart = Between(icp.T_ref_curr, lines.T_ref_curr);
      cm.push_back(100 * apart.translation().norm());
      deg.push_back(Degrees(std::abs(apart.theta)));
    });
    const Distribution r = DistributionOf(rounds), d = DistributionOf(cm), a = DistributionOf(deg),
                       t = DistributionOf(time);
    table.Add({log.name, Count(pairs), Percent(1.0 * converged / std::max(pairs, 1)),
               Percent(1.0 * degenerate / std::max(converged, 1)), Number(r.mean, 1), Number(r.p95, 0),
               Number(d.median, 2), Number(d.p95, 1), Number(a.median, 3), Number(a.p95, 2), Number(t.mean, 3),
               Number(t.p99, 3), Number(DistributionOf(icp_time).mean, 3)});
    report.Expect(pairs > 0 && converged >= pairs / 2 && d.median <= 5.0,
                  "the line matcher converges for less than half of the pairs, or differs from ICP by more than 5 "
                  "cm, on " +
                      log.name + ", or is 5 cm apart from ICP");
  }
  report.Add(table, "tracking");
}

}  // namespace cairn::studies
