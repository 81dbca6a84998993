#include "tests/studies/log_run.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/studies/mapper_choice.h"

namespace cairn::studies {
namespace {

StudyLog ShortDrive() {
  sim::FleetOptions options;
  options.seed = 2;
  return SimulateLog("room", 15.0, options);
}

TEST(StudyLogRun, EveryScanIsTimedAndHasAPose) {
  const StudyLog log = ShortDrive();
  const auto options = MapperWith({"slam.particles=20"}, 1);
  ASSERT_TRUE(options) << options.error().message;
  const LogRun run = RunOverLog(log, *options);
  EXPECT_EQ(run.online.size() + run.scans_dropped, log.scans());
  EXPECT_EQ(run.scan_cpu_ms.size(), run.online.size());
  EXPECT_EQ(run.full.size(), run.online.size());
  EXPECT_TRUE(std::all_of(run.scan_cpu_ms.begin(), run.scan_cpu_ms.end(), [](double ms) { return ms > 0.0; }));
  std::uint64_t reasons = 0;
  for (const std::uint64_t count : run.reasons) reasons += count;
  EXPECT_EQ(reasons, run.online.size());
  EXPECT_LT(ErrorOf(run.online, log.relations).trans_mean_m, 0.05);
  EXPECT_GT(MapOf(run, WhichPath::kFull, options->grid).width, 100);
}

TEST(StudyLogRun, TheSameSeedGivesTheSamePath) {
  const StudyLog log = ShortDrive();
  const auto options = MapperWith({"slam.particles=20"}, 5);
  ASSERT_TRUE(options);
  const LogRun a = RunOverLog(log, *options), b = RunOverLog(log, *options);
  ASSERT_EQ(a.online.size(), b.online.size());
  for (std::size_t i = 0; i < a.online.size(); ++i) EXPECT_EQ(a.online[i].T_map_robot, b.online[i].T_map_robot);
}

TEST(StudyMapperChoice, WhatThisBuildLacksIsAnErrorThatNamesIt) {
  const auto options = MapperWith({"slam.matcher=no_such"}, 1);
  ASSERT_FALSE(options);
  EXPECT_NE(options.error().message.find("no_such"), std::string::npos);
}

TEST(StudyMapperChoice, ListsTheChoices) {
  const auto matchers = ChoicesOf("slam.matcher");
  EXPECT_NE(std::find(matchers.begin(), matchers.end(), "voting"), matchers.end());
  EXPECT_TRUE(ChoicesOf("slam.no_such_option").empty());
}

}  // namespace
}  // namespace cairn::studies
