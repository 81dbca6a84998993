#include "client/cli/progress_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "client/cli/percentiles.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;

TEST(ProgressLine, RedrawsOneLineOnATerminal) {
  std::ostringstream out;
  ProgressLine line(out, true, false);
  line.Show(0.0, 0.5, "a long text");
  line.Finish(1.0, 1.0, "done");
  EXPECT_THAT(out.str(), HasSubstr("[##############..............]  50 %  a long text"));
  EXPECT_THAT(out.str(), HasSubstr("\r[############################] 100 %  done       \n"));
}

TEST(ProgressLine, PrintsPlainLinesNowAndThenElsewhere) {
  std::ostringstream out;
  ProgressLine line(out, false, false);
  for (int i = 0; i <= 100; ++i) line.Show(i * 0.1, i / 100.0, "x");  // 10 s.
  line.Finish(10.0, 1.0, "end");
  const std::string text = out.str();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 3 + 1) << text;
  EXPECT_EQ(text.find('\r'), std::string::npos);
}

TEST(ProgressLine, IsSilentWhenQuietAndBoundsItsBar) {
  std::ostringstream out;
  ProgressLine(out, true, true).Finish(0, 1, "x");
  EXPECT_EQ(out.str(), "");
  ProgressLine line(out, true, false);
  line.Show(0, 7.0, "x");
  EXPECT_THAT(out.str(), HasSubstr("100 %"));
  line.Finish(1, -1, "no end known");
  EXPECT_THAT(out.str(), HasSubstr("\rno end known"));
}

TEST(Percentiles, AreOfNearestRank) {
  Percentiles percentiles;
  EXPECT_EQ(percentiles.At(0.5), 0.0);
  for (int i = 100; i >= 1; --i) percentiles.Add(i);
  EXPECT_EQ(percentiles.At(0.5), 50.0);
  EXPECT_EQ(percentiles.At(0.99), 99.0);
  EXPECT_EQ(percentiles.At(1.0), 100.0);
  EXPECT_EQ(percentiles.At(0.0), 1.0);
  EXPECT_EQ(percentiles.CountAbove(98.5), 2u);
}

}  // namespace
}  // namespace cairn::client
