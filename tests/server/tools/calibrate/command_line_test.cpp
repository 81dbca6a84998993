// Whole command lines of cairn-calibrate: what good ones print, and what wrong ones answer.
#include "server/tools/calibrate/command_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "common/options/config.h"
#include "server/tools/calibrate/motion_run.h"
#include "server/tools/log_run/json_line.h"
#include "tests/server/tools/calibrate/noisy_drive.h"
#include "tests/temp_directory.h"

namespace cairn::server {
namespace {

using ::testing::HasSubstr;

struct Outcome {
  int code;
  std::string out;
  std::string err;
};

class Calibrate : public ::testing::Test {
 protected:
  static Outcome Run(const std::vector<std::string>& arguments) {
    std::ostringstream out, err;
    const int code = RunCalibrate(arguments, out, err);
    return {code, out.str(), err.str()};
  }
  [[nodiscard]] std::string File(const std::string& name) const { return (directory_ / name).string(); }
  [[nodiscard]] std::string Write(const std::string& name, const std::string& text) const {
    return directory_.Write(name, text).string();
  }

  TempDirectory directory_;
};

constexpr const char* kHeader = "direction,floor,abs_x,abs_y,abs_theta,calc_x,calc_y,calc_theta\n";

TEST_F(Calibrate, WrongCommandLinesAreUsageErrors) {
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"fly"},
      {"odometry"},
      {"odometry", "--simulate", "--base", "-1"},
      {"odometry", "--simulate", "--runs", "none"},
      {"odometry", "--simulate", "--set", "run.E_d=7"},
      {"odometry", "--simulate", "--set", "run.colour=red"},
      {"odometry", "runs.csv", "--simulate"},
      {"odometry", "runs.csv", "--set", "run.E_d=1"},
      {"motion"},
      {"motion", "x.log", "--seed", "-3"},
      {"motion", "x.log", "--set", "fit.particles=many"},
      {"motion", "x.log", "--set", "slam.matcher=guess"},
      {"motion", "x.log", "--set", "slam.grid.hit_probability=0.985"},
      {"motion", "x.log", "--colour", "red"},
      {"motion", "x.log", "-o", "x.yaml", "--no-matcher"},
  };
  for (const auto& arguments : wrong) {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.code, 2) << ::testing::PrintToString(arguments) << outcome.out << outcome.err;
    EXPECT_FALSE(outcome.err.empty()) << ::testing::PrintToString(arguments);
  }
}

TEST_F(Calibrate, HelpAndVersionAreNoFailures) {
  EXPECT_EQ(Run({"--help"}).code, 0);
  EXPECT_EQ(Run({"odometry", "--help"}).code, 0);
  EXPECT_THAT(Run({"--version"}).out, HasSubstr("cairn-calibrate"));
}

TEST_F(Calibrate, FilesThatCannotBeUsedFailWithOneLine) {
  const std::string good = std::string(kHeader) + "cw,smooth,-0.16,-0.16,0.08,0,0,0\n";
  const std::vector<std::pair<std::vector<std::string>, std::string>> failing = {
      {{"odometry", File("absent.csv")}, "absent.csv"},
      {{"odometry", directory_.path().string()}, ""},
      {{"odometry", Write("empty.csv", "")}, "no runs"},
      {{"odometry", Write("header.csv", "a,b\n")}, ":1: the first line must be"},
      {{"odometry", Write("one.csv", good)}, "both directions"},
      {{"odometry", Write("few.csv", good + "ccw,smooth,0,0,0\n")}, ":3: has 5 fields"},
      {{"odometry", Write("way.csv", good + "up,smooth,0,0,0,0,0,0\n")}, "cw or ccw"},
      {{"odometry", Write("floor.csv", good + "cw,wet,0,0,0,0,0,0\n")}, "smooth or bumps"},
      {{"odometry", Write("nan.csv", good + "ccw,smooth,nan,0,0,0,0,0\n")}, "is not a number"},
      {{"odometry", Write("text.csv", good + "ccw,smooth,0,0,0x1,0,0,0\n")}, "is not a number"},
      {{"odometry", Write("far.csv", std::string(kHeader) + "cw,smooth,900,0,0,0,0,0\nccw,smooth,0,0,0,0,0,0\n")},
       "far off"},
      {{"motion", File("absent.log")}, "no such file"},
      {{"motion", Write("not.log", "hello\n")}, "not a robot log"},
      {{"motion", File("absent.log"), "--config", File("absent.yaml")}, "absent.yaml"},
  };
  for (const auto& [arguments, message] : failing) {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.code, 1) << ::testing::PrintToString(arguments);
    EXPECT_THAT(outcome.err, HasSubstr(message));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
  const Outcome json = Run({"odometry", File("absent.csv"), "--json"});
  EXPECT_EQ(json.code, 1);
  EXPECT_THAT(json.out, HasSubstr("{\"error\":{\"code\":\"NOT_FOUND\",\"message\":\""));
}

TEST_F(Calibrate, RunsOfAFileAreEvaluated) {
  const std::string runs = Write("runs.csv", std::string("# a comment\n\n") + kHeader +
                                                 "cw,smooth,-0.16,-0.16,0.08,0,0,0\r\n"
                                                 "ccw,smooth, 0,0,0, 0,0,0\n"
                                                 "cw,bumps,-0.16,-0.16,0.09,0,0,0\n");
  const Outcome text = Run({"odometry", runs, "--side", "4", "--base", "0.34"});
  EXPECT_EQ(text.code, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("E_sys 0.2263 m"));
  EXPECT_THAT(text.out, HasSubstr("alpha 0.5730 deg, beta 0.5730 deg"));
  EXPECT_THAT(text.out, HasSubstr("non-systematic  0.5730 deg"));
  const Outcome json = Run({"odometry", runs, "--json"});
  const Json report = Json::parse(json.out);
  EXPECT_NEAR(report["alpha_rad"].get<double>(), 0.01, 1e-9);
  EXPECT_NEAR(report["non_systematic_rad"].get<double>(), 0.01, 1e-9);
  EXPECT_EQ(report["center_cw_m"].size(), 2U);
  EXPECT_FALSE(report.contains("injected"));
}

TEST_F(Calibrate, SimulatedRunsAreTheSameForTheSameSeed) {
  const std::vector<std::string> line = {"odometry", "--simulate", "--json", "--seed", "4", "--set", "run.E_d=1.01"};
  const Outcome once = Run(line), again = Run(line);
  EXPECT_EQ(once.code, 0) << once.err;
  EXPECT_EQ(once.out, again.out);
  EXPECT_THAT(once.out, HasSubstr("\"injected\":{\"E_d\":1.01,\"E_b\":1.0}"));
  auto other = line;
  other[4] = "5";
  EXPECT_NE(Run(other).out, once.out);
}

TEST_F(Calibrate, AShortLogIsNotEnough) {
  std::ofstream log(File("short.log"));
  static_cast<void>(test::WriteNoisyDrive({.steps = 20}, log));
  log.close();
  const Outcome outcome = Run({"motion", File("short.log")});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("only 20 of 20 steps"));
}

TEST_F(Calibrate, MotionPrintsTheSameForTheSameSeedOnAnyThreadCount) {
  std::ofstream log(File("drive.log"));
  static_cast<void>(WriteTum(test::WriteNoisyDrive({.steps = 80}, log), File("drive.tum")));
  log.close();
  const auto run = [&](const std::string& threads) {
    return Run(
        {"motion", File("drive.log"), "--truth", File("drive.tum"), "--json", "--seed", "3", "--threads", threads});
  };
  const Outcome one = run("1"), three = run("3");
  EXPECT_EQ(one.code, 0) << one.err;
  EXPECT_EQ(one.out, three.out);
  EXPECT_THAT(one.out, HasSubstr("\"eliazar\":{\"along\":{\"mean_d\":"));
  EXPECT_THAT(one.out, HasSubstr("\"matcher\":{\"name\":\"icp\",\"against\":\"truth\""));
  const Outcome far = Run({"motion", File("drive.log"), "--truth", Write("far.tum", "1000000 0 0 0 0 0 0 1\n")});
  EXPECT_EQ(far.code, 1);
  EXPECT_THAT(far.err, HasSubstr("no pose at the stamps"));
}

// From the fit through the file to the filters: what the programs read from it is what was learnt.
TEST_F(Calibrate, MotionWritesOptionsThatTheFiltersDrawBy) {
  std::ofstream log(File("drive.log"));
  static_cast<void>(WriteTum(test::WriteNoisyDrive({.steps = 80}, log), File("drive.tum")));
  log.close();
  const std::vector<std::string> line = {"motion", File("drive.log"), "--truth", File("drive.tum"), "--json"};
  auto writing = line;
  writing.insert(writing.end(), {"-o", File("learnt.yaml")});
  const Outcome outcome = Run(writing);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.out, Run(line).out);

  MotionRunOptions run;
  run.log = File("drive.log");
  run.truth = File("drive.tum");
  const auto report = RunMotion(run);
  ASSERT_TRUE(report);
  slam::MapperOptions options;
  const auto applied = ApplyYamlFile(File("learnt.yaml"), [&](OptionVisitor& visitor) {
    visitor.Section("slam", "", [&] { slam::Visit(visitor, options); });
  });
  ASSERT_TRUE(applied) << applied.error().message;
  EXPECT_EQ(options.filter.sampling.model, slam::MotionModel::kEliazar);
  EXPECT_EQ(options.filter.dpslam.motion, slam::LowMotion::kEliazar);
  const slam::ScanMatchingModel &matcher = options.filter.motion.scan_matching, &learnt = report->matcher->model;
  EXPECT_EQ(matcher.along.base, learnt.along.base);
  EXPECT_EQ(matcher.across.share, learnt.across.share);
  EXPECT_EQ(matcher.turn.base, learnt.turn.base);
  EXPECT_EQ(matcher.shortfall_share, learnt.shortfall_share);

  // One step of the filters made by these options: hypotheses scatter as the model learnt says.
  const slam::OdometryStep odometry{0.3, 0.1};
  const slam::StepMotion step{{0.0, 1.0, 1.0}, Eigen::Matrix3d::Zero(), slam::MotionOf({odometry.d, 0.0, odometry.b})};
  options.filter.particles = 10000;
  options.filter.dpslam.hierarchical = false;
  for (const auto kind : {slam::FilterKind::kFastSlam1, slam::FilterKind::kDpSlam}) {
    const auto filter = slam::MakeFilter(kind, options.filter, {}, 7);
    filter->Predict(step);
    Eigen::Vector3d mean = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
    const auto count = static_cast<double>(filter->hypothesis_count());
    for (std::size_t i = 0; i < filter->hypothesis_count(); ++i) {
      const Eigen::Vector3d terms = slam::TermsOf(filter->hypothesis(i).T_map_robot);
      mean += terms / count;
      squares += terms.cwiseAbs2() / count;
    }
    for (int k = 0; k < slam::kMotionTerms; ++k) {
      const slam::MotionTermModel& term = report->eliazar.model.term(k);
      const double sigma = std::sqrt(term.Variance(odometry.d, odometry.b));
      EXPECT_NEAR(mean(k), term.Mean(odometry.d, odometry.b), 4.0 * sigma / std::sqrt(count)) << k;
      EXPECT_NEAR(std::sqrt(squares(k) - mean(k) * mean(k)), sigma, 0.04 * sigma) << k;
    }
  }
}

TEST_F(Calibrate, WithoutOdometryTheScanMatchersModelIsChosen) {
  MotionReport report;
  EXPECT_FALSE(ReportConfig(report, true)) << "no matcher, nothing to write";
  report.matcher.emplace();
  EXPECT_THAT(*ReportConfig(report, true), HasSubstr("model: eliazar"));
  EXPECT_THAT(*ReportConfig(report, false), HasSubstr("model: scan_matching"));
  EXPECT_THAT(*ReportConfig(report, false), HasSubstr("motion: scan_matching"));
  report.eliazar.model.along.sigma_d = 11.0;
  const auto refused = ReportConfig(report, true);
  ASSERT_FALSE(refused) << "the programs would refuse it";
  EXPECT_THAT(refused.error().message, HasSubstr("slam.motion.eliazar.along.sigma_d"));
}

}  // namespace
}  // namespace cairn::server
