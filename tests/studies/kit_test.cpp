#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "tests/studies/logs.h"
#include "tests/studies/relations.h"
#include "tests/studies/report.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/study.h"
#include "tests/studies/table.h"
#include "tests/temp_directory.h"

namespace cairn::studies {
namespace {

Table Sample() {
  Table table({"name", "error (m)"});
  table.Add({"a, \"b\"", "0.5"});
  table.Add({"c|d", "12.25"});
  return table;
}

TEST(StudyTable, AlignsNumbersToTheRight) {
  EXPECT_EQ(Sample().Aligned(),
            "  name    error (m)\n"
            "  -----------------\n"
            "  a, \"b\"        0.5\n"
            "  c|d         12.25\n");
}

TEST(StudyTable, MarkdownAndCsvQuoteWhatWouldBreakThem) {
  EXPECT_NE(Sample().Markdown().find("| c\\|d"), std::string::npos);
  EXPECT_EQ(Sample().Csv(), "name,error (m)\n\"a, \"\"b\"\"\",0.5\nc|d,12.25\n");
}

TEST(StudyTable, NumbersThatAreNoneAreDashes) {
  EXPECT_EQ(Number(std::nan(""), 2), "-");
  EXPECT_EQ(Number(1.005, 1), "1.0");
  EXPECT_EQ(Percent(0.1234), "12.3 %");
}

TEST(StudyReport, WritesMarkdownThatLinksItsPictures) {
  const TempDirectory directory;
  std::ostringstream out;
  Report report(directory / "r", "a title", out);
  report.Heading("first");
  report.Warn("nothing there");
  report.Add(Sample(), "sample");
  report.Add(Plot{.title = "curve", .series = {{.x = {0, 1}, .y = {1, 2}}}}, "curve");
  ASSERT_TRUE(report.Finish());
  const std::string text = directory.Read("r/report.md");
  EXPECT_EQ(text.substr(0, 10), "# a title\n");
  EXPECT_NE(text.find("![curve](curve.png)"), std::string::npos);
  EXPECT_NE(text.find("nothing there"), std::string::npos);
  EXPECT_EQ(directory.Read("r/sample.csv"), Sample().Csv());
  EXPECT_EQ(directory.Read("r/curve.png").substr(1, 3), "PNG");
  EXPECT_NE(out.str().find("!! nothing there"), std::string::npos);
}

TEST(StudyReport, FailsWhereAFigureIsNotAsExpectedAndSaysWhy) {
  std::ostringstream out;
  Report report({}, "title", out);
  report.Warn("mind this");
  report.Expect(true, "what holds");
  EXPECT_FALSE(report.failed());
  report.Expect(false, "what does not hold");
  report.Expect(true, "what holds afterwards");
  EXPECT_TRUE(report.failed());
  EXPECT_NE(out.str().find("!! what does not hold"), std::string::npos);
  EXPECT_EQ(out.str().find("what holds"), std::string::npos);
}

TEST(StudyReport, SaysWhatItCouldNotWrite) {
  const TempDirectory directory;
  const auto file = directory.Write("file", "");
  std::ostringstream out;
  Report report(file / "below", "title", out);
  EXPECT_FALSE(report.Finish());
}

TEST(StudyLogs, AnAbsentLogIsSaidLoudly) {
  std::ostringstream out;
  Report report({}, "title", out);
  StudyContext context{report};
  EXPECT_FALSE(OpenRealLog(context, "no-such-log"));
  EXPECT_NE(out.str().find("!! the published log `no-such-log` is ABSENT"), std::string::npos);
}

TEST(StudyLogs, ASimulatedLogRepeatsAndItsTruthKeepsItsRelations) {
  sim::FleetOptions options;
  options.seed = 5;
  const StudyLog log = SimulateLog("room", 20.0, options), again = SimulateLog("room", 20.0, options);
  EXPECT_NEAR(static_cast<double>(log.scans()), 20.0 * options.scan_hz, 2.0);
  EXPECT_NEAR(log.seconds(), 20.0, 0.3);
  ASSERT_EQ(log.records.size(), again.records.size());
  EXPECT_EQ(std::get<Odometry>(log.records.front()).T_odom_robot,
            std::get<Odometry>(again.records.front()).T_odom_robot);
  ASSERT_GT(log.relations.size(), 10u);
  const RelationError error = ErrorOf(log.truth, log.relations);
  EXPECT_EQ(error.compared, log.relations.size());
  EXPECT_LT(error.trans_max_m, 1e-9);
}

TEST(StudyRelations, MeasuresWhatIsOff) {
  const std::vector<Relation> relations{{0, kNanosPerSecond, {1, 0, 0}}, {0, 9 * kNanosPerSecond, {1, 0, 0}}};
  // A trajectory that is moved as a whole has no error; one that is 0.3 m too long has.
  const Pose2 T_any{5, 6, 1};
  const Trajectory good{{0, T_any}, {kNanosPerSecond, T_any * Pose2{1, 0, 0}}};
  const Trajectory longer{{0, T_any}, {kNanosPerSecond, T_any * Pose2{1.3, 0, Radians(2)}}};
  EXPECT_NEAR(ErrorOf(good, relations).trans_mean_m, 0.0, 1e-12);
  EXPECT_EQ(ErrorOf(good, relations).missing, 1u);
  EXPECT_NEAR(ErrorOf(longer, relations).trans_mean_m, 0.3, 1e-12);
  EXPECT_NEAR(ErrorOf(longer, relations).rot_mean_deg, 2.0, 1e-12);
  EXPECT_TRUE(std::isnan(ErrorOf({}, relations).trans_mean_m));
}

TEST(StudyRelations, ReadsItsFileAndNamesABadLine) {
  const TempDirectory directory;
  const auto good = ReadRelations(directory.Write("a.relations", "# c\n1.5 2.5 1 2 0 0 0 0.5\n"));
  ASSERT_TRUE(good);
  ASSERT_EQ(good->size(), 1u);
  EXPECT_EQ((*good)[0].from, 1'500'000'000);
  EXPECT_EQ((*good)[0].T_from_to, (Pose2{1, 2, 0.5}));
  const auto bad = ReadRelations(directory.Write("b.relations", "\n1 2 3\n"));
  ASSERT_FALSE(bad);
  EXPECT_NE(bad.error().message.find(":2:"), std::string::npos);
}

TEST(StudyStopwatch, RanksAreNearest) {
  std::vector<double> samples;
  for (int i = 100; i >= 1; --i) samples.push_back(i);
  const Distribution d = DistributionOf(samples);
  EXPECT_EQ(d.mean, 50.5);
  EXPECT_EQ(d.median, 50);
  EXPECT_EQ(d.p99, 99);
  EXPECT_EQ(d.max, 100);
}

TEST(StudyStopwatch, ProcessorTimePassesWhileThisRuns) {
  const Stopwatch watch;
  double sum = 0.0;
  while (watch.CpuMs() < 2.0) sum += std::sin(sum + 1.0);
  EXPECT_GE(watch.WallMs(), 1.0);
}

TEST(StudyList, ARegisteredStudyIsFound) {
  const Registration registration("some-name", "some help", [](StudyContext&) {});
  const auto studies = AllStudies();
  ASSERT_EQ(studies.size(), 1u);
  EXPECT_EQ(studies[0].name, "some-name");
}

}  // namespace
}  // namespace cairn::studies
