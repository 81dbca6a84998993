// cairn-study filters tests whether the stated uncertainty of each filter is right. It prints NEES and NIS
// with the bounds of consistent filters, the effective number of particles, and the age of their common
// ancestor, over many simulated runs.
#include <algorithm>

#include "tests/studies/filters/consistency.h"
#include "tests/studies/filters/cost.h"
#include "tests/studies/study.h"

namespace cairn::studies {
namespace {

struct Contender {
  slam::FilterKind kind;
  std::string name;
  bool particles;
};

std::vector<Contender> Contenders() {
  using slam::FilterKind;
  return {{FilterKind::kFastSlam2Points, "fastslam2_points", true},
          {FilterKind::kFastSlam2Oriented, "fastslam2_oriented", true},
          {FilterKind::kFastSlam1, "fastslam1", true},
          {FilterKind::kEkf, "ekf", false},
          {FilterKind::kLandmarkCorrection, "landmark_correction", false},
          {FilterKind::kNone, "none", false}};
}

using Figure = double ConsistencyPoint::*;

Series SeriesOf(const ConsistencyResult& result, const std::string& label, Figure figure) {
  Series series{.label = label, .mark = Mark::kLine};
  for (const ConsistencyPoint& point : result.points) {
    series.x.push_back(point.travelled_m);
    series.y.push_back(point.*figure);
  }
  return series;
}

std::string Range(double low, double high) {
  return Number(low, 2) + " .. " + Number(high, 2);
}

std::string VerdictOf(const ConsistencyResult& result, double nees) {
  if (nees > result.nees_high) return "uncertainty too small";
  return nees < result.nees_low ? "uncertainty too large" : "consistent";
}

// With few runs, some may miss by chance.
void FailUnlessQuick(StudyContext& context, const std::string& why) {
  context.quick ? context.report.Warn(why) : context.report.Fault(why);
}

// One world for all filters. Fails if a filter that must be consistent is not.
void StudyWorld(StudyContext& context, const std::string& name, bool landmarks, bool revisits) {
  Report& report = context.report;
  report.Heading(name);
  Table table({"filter", "NEES (3)", "before the loop", "after", "95 % bounds", "points inside", "NIS a number (1)",
               "95 % bounds", "error at end (m)", "ended diverged", "before the loop", "in all"});
  const Axis way{.label = "travelled", .unit = "m"};
  Plot nees{.title = "NEES, " + name, .x = way, .y = {"NEES of (x, y, heading)", "", true}};
  Plot nis{.title = "NIS a number, " + name, .x = way, .y = {"NIS / numbers", "", true}};
  Plot effective{.title = "Effective sample size, " + name, .x = way, .y = {"particles", ""}};
  Plot depth{.title = "Ancestry depth, " + name, .x = way, .y = {"keyframes to the common ancestor", ""}};
  for (const Contender& contender : Contenders()) {
    const ConsistencyResult result = StudyConsistency({.kind = contender.kind,
                                                       .runs = context.Pick(100, 10),
                                                       .landmarks = landmarks,
                                                       .revisits = revisits,
                                                       .first_seed = context.seed});
    const bool innovates = result.nis_high > 0.0;
    table.Add({contender.name, Number(result.nees_mean, 2), Number(result.nees_before, 2), Number(result.nees_after, 2),
               Range(result.nees_low, result.nees_high), Percent(result.nees_inside, 0),
               innovates ? Number(result.nis_per_number, 3) : "-",
               innovates ? Range(result.nis_low, result.nis_high) : "-", Number(result.position_error_m, 3),
               Count(result.diverged), VerdictOf(result, result.nees_before), VerdictOf(result, result.nees_mean)});
    nees.series.push_back(SeriesOf(result, contender.name, &ConsistencyPoint::nees));
    nees.bounds = {{result.nees_low, "95 %"}, {result.nees_high, "95 %"}};
    if (innovates) nis.series.push_back(SeriesOf(result, contender.name, &ConsistencyPoint::nis_per_number));
    if (contender.kind == slam::FilterKind::kEkf && innovates) {
      Series band{.label = "95 % (ekf)", .mark = Mark::kDashed};
      for (const ConsistencyPoint& point : result.points) {
        if (!(point.nis_high > 0.0)) continue;
        band.x.push_back(point.travelled_m);
        band.y.push_back(1.0);
        band.low.push_back(point.nis_low);
        band.high.push_back(point.nis_high);
      }
      nis.series.push_back(band);
    }
    if (contender.particles) {
      effective.series.push_back(SeriesOf(result, contender.name, &ConsistencyPoint::effective_sample_size));
      depth.series.push_back(SeriesOf(result, contender.name, &ConsistencyPoint::ancestry_depth));
    }
    // landmark_correction replaces the poses that it corrects, and is not tested against the bounds of a
    // Gaussian.
    const bool must = contender.kind != slam::FilterKind::kLandmarkCorrection;
    const auto judge = [&](double figure, const std::string& where) {
      const std::string verdict = VerdictOf(result, figure), what = contender.name + " is " + verdict + where;
      if (verdict != "consistent") must ? FailUnlessQuick(context, what) : report.Warn(what);
    };
    judge(result.nees_before, " before the loop closes.");
    judge(result.nees_mean, " over the whole way.");
  }
  report.Add(table, name + " consistency");
  report.Add(nees, name + " nees");
  report.Add(nis, name + " nis");
  report.Add(effective, name + " effective sample size");
  report.Add(depth, name + " ancestry depth");
}

// The number of particles is sufficient when the error no longer falls with more of them; the stated
// uncertainty must follow the error.
void StudyParticles(StudyContext& context) {
  context.report.Heading("Particles");
  Table table({"filter", "particles", "NEES before the loop (3)", "after", "95 % bounds", "error at end (m)"});
  for (const Contender& contender : Contenders()) {
    if (!contender.particles) continue;
    for (const std::int64_t particles : {50, 200, 800}) {
      const ConsistencyResult result = StudyConsistency(
          {.kind = contender.kind, .runs = context.Pick(50, 5), .particles = particles, .first_seed = context.seed});
      table.Add({contender.name, Count(particles), Number(result.nees_before, 2), Number(result.nees_after, 2),
                 Range(result.nees_low, result.nees_high), Number(result.position_error_m, 3)});
    }
  }
  context.report.Add(table, "particles");
}

// Thesis C 3.1.2: the cost of one step of EKF-SLAM grows with the square of the number of landmarks. FastSLAM
// was developed to avoid this.
void StudyLandmarkCost(StudyContext& context) {
  Report& report = context.report;
  report.Heading("Cost against landmarks");
  const std::vector<std::size_t> sizes =
      context.quick ? std::vector<std::size_t>{60, 120} : std::vector<std::size_t>{60, 120, 240, 480};
  std::vector<std::string> header{"filter"};
  for (const std::size_t size : sizes) header.push_back(Count(static_cast<long long>(size)) + " corners (ms)");
  header.insert(header.end(), {"landmarks held", "exponent"});
  Table table(header);
  Plot plot{.title = "Cost of a step against landmarks",
            .x = {"landmarks", "", true},
            .y = {"processor time per step", "ms", true}};
  double ekf = 0.0, fastslam = 0.0;
  for (const Contender& contender : Contenders()) {
    if (contender.kind == slam::FilterKind::kNone) continue;
    Series series{.label = contender.name, .mark = Mark::kLine};
    std::vector<CostPoint> points;
    std::vector<std::string> row{contender.name};
    for (const std::size_t size : sizes) {
      points.push_back(StudyCost(contender.kind, size, context.seed));
      row.push_back(Number(points.back().step_ms, 3));
      series.x.push_back(static_cast<double>(points.back().landmarks));
      series.y.push_back(points.back().step_ms);
    }
    const double exponent = CostExponent(points);
    row.insert(row.end(), {Count(static_cast<long long>(points.back().landmarks)), Number(exponent, 2)});
    table.Add(row);
    plot.series.push_back(series);
    if (contender.kind == slam::FilterKind::kEkf) ekf = exponent;
    if (contender.kind == slam::FilterKind::kFastSlam2Points) fastslam = exponent;
  }
  report.Text(
      "The robot drives twice round a ring of corners, two for every 1.5 m of the way, and sees about "
      "eight at a time. The second round is timed. The cost grows with a power of the number of "
      "landmarks; the table shows the exponent.");
  report.Add(table, "cost");
  report.Add(plot, "cost");
  if (!(ekf > 1.5 && ekf < 2.5 && fastslam < 1.0))
    FailUnlessQuick(context, "the exponent should be about 2 for the EKF and clearly less for FastSLAM, but it is " +
                                 Number(ekf, 2) + " and " + Number(fastslam, 2));
}

void RunFilters(StudyContext& context) {
  context.report.Text(
      "A loop of 40 m is driven twice past 23 corners. The noise of the world is exactly the noise "
      "that the filter assumes. A consistent filter has a mean NEES of 3 and a mean NIS of 1 per "
      "number. The spread of the particles alone is too small after the loop closes, because all "
      "particles then descend from few ancestors (Bailey et al. 2006). Particle filters therefore "
      "report a covariance that is kept in addition to the particles. NEES is shown before anything is "
      "seen a second time (34 m) and after. The filter dpslam needs ranges and has a study of its own.");
  if (context.Wants("landmarks")) StudyWorld(context, "landmarks", true, false);
  if (context.Wants("revisits")) StudyWorld(context, "revisits", false, true);
  if (context.Wants("particles")) StudyParticles(context);
  if (context.Wants("cost")) StudyLandmarkCost(context);
}

const Registration kRegistered{
    "filters", "NEES, NIS, effective sample size and ancestry depth of every landmark filter", RunFilters};

}  // namespace
}  // namespace cairn::studies
