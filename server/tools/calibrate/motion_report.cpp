#include <iomanip>
#include <sstream>

#include "common/options/config.h"
#include "server/slam/dpslam/dpslam_options.h"
#include "server/slam/motion_models/motion_sampling.h"
#include "server/tools/calibrate/motion_run.h"
#include "server/tools/log_run/json_line.h"

namespace cairn::server {
namespace {

constexpr const char* kTermNames[] = {"along (D)", "across (C)", "turn (B)"};
constexpr const char* kTermKeys[] = {"along", "across", "turn"};

Json SpreadJson(const slam::MatchSpread& spread) {
  return {{"base", spread.base}, {"share", spread.share}};
}

}  // namespace

std::string ReportText(const MotionReport& report) {
  std::ostringstream out;
  out << std::fixed << std::setprecision(4);
  out << "steps       " << report.steps << " measured, " << report.unmeasured_steps << " not; on average "
      << report.mean_step_m << " m and " << report.mean_step_rad << " rad (" << report.scans << " scans, "
      << report.unusable_scans << " unusable)\n";
  const slam::MotionTermModel &along = report.eliazar.model.term(0), &turn = report.eliazar.model.term(2);
  out << "in short    1 m of odometry is " << along.mean_d << " +- " << along.sigma_d << " m, 1 rad of it is "
      << turn.mean_b << " +- " << turn.sigma_b << " rad\n";
  out << "odometry    Eliazar's model (4.46), " << report.eliazar.iterations << " iterations"
      << (report.eliazar.converged ? "" : ", NOT CONVERGED") << ", log likelihood " << report.eliazar.log_likelihood
      << " a step, " << std::setprecision(0) << 100 * report.eliazar.effective_share
      << " % of the particles effective\n"
      << std::setprecision(4) << "            term         mean_d    mean_b   sigma_d   sigma_b\n";
  for (int k = 0; k < slam::kMotionTerms; ++k) {
    const slam::MotionTermModel& term = report.eliazar.model.term(k);
    out << "            " << std::left << std::setw(10) << kTermNames[k] << std::right << std::setw(9) << term.mean_d
        << std::setw(10) << term.mean_b << std::setw(10) << term.sigma_d << std::setw(10) << term.sigma_b << '\n';
  }
  if (report.match_error_ratio)
    out << "matches     errors are " << std::setprecision(2) << *report.match_error_ratio << " times what they state\n"
        << std::setprecision(4);
  if (report.matcher) {
    const slam::ScanMatchingModel& m = report.matcher->model;
    out << "matcher     " << report.matcher_name << " without odometry against "
        << (report.truth_given ? "the truth" : "the estimator's path") << ", " << report.matcher->samples << " steps, "
        << report.unmatched_blind << " without a match\n"
        << "            sigma along  " << m.along.base << " m + " << m.along.share << " of the motion\n"
        << "            sigma across " << m.across.base << " m + " << m.across.share << " of the motion\n"
        << "            sigma turn   " << m.turn.base << " rad + " << m.turn.share << " of the motion\n"
        << "            shortfalls   " << 100 * m.shortfall_share << " % of the steps with little turning\n"
        << "            failures     " << 100 * report.matcher->failure_share << " % of the steps\n";
  }
  return out.str();
}

std::string ReportJson(const MotionReport& report) {
  Json eliazar;
  for (int k = 0; k < slam::kMotionTerms; ++k) {
    const slam::MotionTermModel& term = report.eliazar.model.term(k);
    eliazar[kTermKeys[k]] = {{"mean_d", term.mean_d},
                             {"mean_b", term.mean_b},
                             {"sigma_d", term.sigma_d},
                             {"sigma_b", term.sigma_b},
                             {"floor", term.floor}};
  }
  eliazar["iterations"] = report.eliazar.iterations;
  eliazar["converged"] = report.eliazar.converged;
  eliazar["log_likelihood"] = report.eliazar.log_likelihood;
  eliazar["effective_share"] = report.eliazar.effective_share;
  Json object = {{"scans", report.scans},
                 {"unusable_scans", report.unusable_scans},
                 {"steps", report.steps},
                 {"unmeasured_steps", report.unmeasured_steps},
                 {"mean_step_m", report.mean_step_m},
                 {"mean_step_rad", report.mean_step_rad},
                 {"eliazar", std::move(eliazar)}};
  if (report.match_error_ratio) object["match_error_ratio"] = *report.match_error_ratio;
  if (report.matcher) {
    const slam::ScanMatchingModel& m = report.matcher->model;
    object["matcher"] = {{"name", report.matcher_name},
                         {"against", report.truth_given ? "truth" : "estimator"},
                         {"samples", report.matcher->samples},
                         {"unmatched", report.unmatched_blind},
                         {"along", SpreadJson(m.along)},
                         {"across", SpreadJson(m.across)},
                         {"turn", SpreadJson(m.turn)},
                         {"shortfall_share", m.shortfall_share},
                         {"failure_share", report.matcher->failure_share}};
  }
  return JsonLine(object);
}

Result<std::string> ReportConfig(const MotionReport& report, bool with_odometry) {
  if (!report.matcher) return Fail(StatusCode::kInvalidArgument, "the scan matcher's model was not learnt");
  slam::LearntMotion learnt{report.eliazar.model, report.matcher->model};
  auto model = with_odometry ? slam::MotionModel::kEliazar : slam::MotionModel::kScanMatching;
  auto low = with_odometry ? slam::LowMotion::kEliazar : slam::LowMotion::kScanMatching;
  const VisitOptions visit = [&](OptionVisitor& visitor) {
    visitor.Section("slam", "Learnt by cairn-calibrate motion.", [&] {
      visitor.Section("motion", "", [&] { slam::Visit(visitor, learnt); });
      visitor.Section("fastslam", "", [&] { visitor.Section("motion", "", [&] { slam::Visit(visitor, model); }); });
      visitor.Section("dpslam", "", [&] { slam::Visit(visitor, low); });
    });
  };
  std::string yaml = PrintYaml(visit);
  // Check that cairn-offline and cairnd would accept the file.
  if (const auto applied = ApplyYaml(yaml, "what was learnt", visit); !applied) return tl::unexpected(applied.error());
  return yaml;
}

}  // namespace cairn::server
