#include "server/tools/calibrate/motion_run.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iostream>

#include "tests/real_logs.h"
#include "tests/server/tools/calibrate/noisy_drive.h"
#include "tests/temp_directory.h"

namespace cairn::server {
namespace {

// The whole way: a simulated log with known odometry errors goes in, the errors come out. Stated bounds: means within
// 0.03, standard deviations within 0.012 or 20 %.
TEST(MotionRun, RecoversTheInjectedModelFromALog) {
  const TempDirectory directory;
  test::NoisyDrive drive;
  drive.steps = 1200;
  drive.model.along = {0.96, 0.02, 0.08, 0.04, 0.002};
  drive.model.across = {0.01, -0.02, 0.05, 0.03, 0.002};
  drive.model.turn = {0.05, 1.04, 0.06, 0.12, 0.002};
  drive.laser.beams = 361;
  drive.laser.field_of_view_rad = kPi;
  MotionRunOptions options;
  options.log = directory / "drive.log";
  options.truth = directory / "drive.tum";
  std::ofstream log(options.log);
  ASSERT_TRUE(WriteTum(test::WriteNoisyDrive(drive, log), options.truth));
  log.close();
  const auto report = RunMotion(options);
  ASSERT_TRUE(report) << report.error().message;
  std::cout << ReportText(*report);
  EXPECT_TRUE(report->eliazar.converged);
  EXPECT_LT(report->unmeasured_steps, 30);
  for (int k = 0; k < slam::kMotionTerms; ++k) {
    const slam::MotionTermModel &fit = report->eliazar.model.term(k), &truth = drive.model.term(k);
    EXPECT_NEAR(fit.mean_d, truth.mean_d, 0.03) << k;
    EXPECT_NEAR(fit.mean_b, truth.mean_b, 0.03) << k;
    EXPECT_NEAR(fit.sigma_d, truth.sigma_d, std::max(0.012, 0.2 * truth.sigma_d)) << k;
    EXPECT_NEAR(fit.sigma_b, truth.sigma_b, std::max(0.012, 0.2 * truth.sigma_b)) << k;
  }
  ASSERT_TRUE(report->match_error_ratio);
  EXPECT_LT(*report->match_error_ratio, 1.5) << "a match that overstates itself would make the robot look bad";
  ASSERT_TRUE(report->matcher);
  EXPECT_LT(report->matcher->model.along.Sigma(0.3), 0.02);
  EXPECT_LT(report->matcher->model.turn.Sigma(0.1), 0.005);
  EXPECT_LT(report->matcher->failure_share, 0.06);
}

// Intel's robot is known well enough to say what is sane: odometry within a few per cent, no sideways motion.
TEST(MotionRun, ARealLogGivesSaneNumbers) {
  CAIRN_NEED_LOG(path, "intel.clf");
  MotionRunOptions options;
  options.log = path;
  options.max_steps = 600;
  options.matcher_model = false;
  const auto report = RunMotion(options);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_GT(report->steps, 550);
  EXPECT_NEAR(report->eliazar.model.along.mean_d, 1.0, 0.1);
  EXPECT_NEAR(report->eliazar.model.turn.mean_b, 1.0, 0.1);
  EXPECT_NEAR(report->eliazar.model.across.mean_d, 0.0, 0.05);
  EXPECT_LT(report->eliazar.model.turn.sigma_b, 0.4);
}

}  // namespace
}  // namespace cairn::server
