#include "tests/studies/plot.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>

#include "tests/studies/plot_frame.h"

namespace cairn::studies {
namespace {

using Colour = std::array<std::uint8_t, 3>;

Colour At(const RasterImage& image, int x, int y) {
  const std::size_t at =
      3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x));
  return {image.samples[at], image.samples[at + 1], image.samples[at + 2]};
}

bool Holds(const RasterImage& image, const cv::Scalar& colour) {
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const Colour at = At(image, x, y);
      if (at[0] == colour[0] && at[1] == colour[1] && at[2] == colour[2]) return true;
    }
  return false;
}

TEST(PlotAxes, TicksAreRound) {
  EXPECT_EQ(TicksOf({0, 10}, false, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
  EXPECT_EQ(TicksOf({50, 450}, false, 8), (std::vector<double>{50, 100, 150, 200, 250, 300, 350, 400, 450}));
  EXPECT_EQ(TicksOf({0.5, 2000}, true, 5), (std::vector<double>{1, 10, 100, 1000}));
  EXPECT_EQ(TicksOf({1, 10}, true, 5), (std::vector<double>{1, 2, 5, 10}));
  EXPECT_EQ(TicksOf({0.021, 0.049}, true, 3),
            (std::vector<double>{0.03, 0.04}));  // Within a decade, as on a plain axis.
  EXPECT_LE(TicksOf({1e-30, 1e3}, true, 8).size(), 9u);
}

TEST(PlotAxes, RangesAreNeverEmpty) {
  const double nan = std::nan("");
  for (const auto& values : {std::vector<double>{}, {nan}, {3, 3}, {-1, 5, nan}, {INFINITY}}) {
    for (const bool logarithmic : {false, true}) {
      const AxisRange range = RangeOf({.logarithmic = logarithmic}, values);
      EXPECT_LT(range.low, range.high);
      EXPECT_TRUE(std::isfinite(range.low) && std::isfinite(range.high));
      EXPECT_TRUE(!logarithmic || range.low > 0.0);
    }
  }
  EXPECT_EQ(RangeOf({.low = 0.0, .high = 7.0}, {1, 2}).high, 7.0);
}

TEST(PlotFrame, DataLandWhereTheAxesSay) {
  const PlotFrame frame(1000, 600, {}, {0, 10}, {.logarithmic = true}, {1, 100}, false);
  const cv::Rect area = frame.area();
  EXPECT_NEAR(frame.At(5, 10).x, area.x + 0.5 * area.width, 1e-9);
  EXPECT_NEAR(frame.At(5, 10).y, area.y + 0.5 * area.height, 1e-9);
  EXPECT_FALSE(frame.Shows(1, 0));
  EXPECT_FALSE(frame.Shows(std::nan(""), 1));
  EXPECT_TRUE(frame.Shows(-1, 1));
}

TEST(Plot, EverySeriesAndBoundIsThere) {
  Plot plot{.title = "t", .x = {"x", "m"}, .y = {"y", "s"}};
  plot.series = {{.label = "a", .x = {0, 1, 2}, .y = {0, 1, 4}, .deviation = {0.1, 0.2, 0.3}},
                 {.label = "b", .x = {0, 1, 2}, .y = {4, NAN, 1}, .mark = Mark::kPoints}};
  plot.bounds = {{2.0, "bound"}};
  const RasterImage image = DrawPlot(plot);
  EXPECT_EQ(image.width, plot.width);
  EXPECT_EQ(image.height, plot.height);
  EXPECT_TRUE(Holds(image, PaletteColour(0)));
  EXPECT_TRUE(Holds(image, PaletteColour(1)));
  EXPECT_FALSE(Holds(image, PaletteColour(2)));
}

TEST(Plot, OddInputIsDrawnAsFarAsItGoes) {
  const double nan = std::nan("");
  for (const auto& x : {std::vector<double>{}, {1}, {nan, nan}, {1, 1, 1}, {INFINITY, 1}, {1e300, -1e300}}) {
    Plot plot{.x = {.logarithmic = true}, .y = {.logarithmic = true}};
    plot.series = {{.label = "s", .x = x, .y = x, .deviation = x, .low = x, .high = x}};
    EXPECT_EQ(DrawPlot(plot).width, plot.width);
    plot.x.logarithmic = plot.y.logarithmic = false;
    EXPECT_EQ(DrawPlot(plot).width, plot.width);
  }
  EXPECT_GT(DrawHeatMap({}).width, 0);
  EXPECT_GT(DrawMap({}, {}).width, 0);
}

TEST(PlotMap, WallsFreeAndUnknownDiffer) {
  OccupancyImage map{0.1, {-1, -1, 0}, 20, 20, std::vector<std::uint8_t>(400, 255)};
  for (int row = 0; row < 20; ++row)
    for (const int column : {0, 1, 2, 3, 4, 15, 16, 17, 18, 19})
      map.cells[static_cast<std::size_t>(20 * row + column)] = row < 10 ? 0 : 100;
  const RasterImage image = DrawMap(map, {.title = "m"});
  EXPECT_TRUE(Holds(image, {0, 0, 0}));
  EXPECT_TRUE(Holds(image, {255, 255, 255}));
  EXPECT_TRUE(Holds(image, {222, 222, 222}));
}

TEST(PlotMap, UnknownEdgesAreCutOff) {
  // One known cell in the middle of a wide unknown map fills the picture.
  OccupancyImage map{1.0, {-50, -50, 0}, 100, 100, std::vector<std::uint8_t>(10000, 255)};
  map.cells[50 * 100 + 50] = 100;
  EXPECT_FALSE(Holds(DrawMap(map, {}), {222, 222, 222}));
}

TEST(Plot, ANarrowMapLeavesRoomForTitleAndLegend) {
  Plot plot{.title = "a corridor", .equal_scale = true};
  plot.series = {{.label = "a long label beside the corridor", .x = {0, 1}, .y = {0, 50}}};
  EXPECT_GE(DrawPlot(plot).width, 640);
}

TEST(HeatMap, LowIsDarkHighIsBrightAndNothingIsGrey) {
  const HeatMap map{.columns = {0, 1, 2}, .rows = {0}, .values = {0.0, 1.0, NAN}, .low = 0.0, .high = 1.0};
  const RasterImage image = DrawHeatMap(map);
  EXPECT_TRUE(Holds(image, {84, 1, 68}));
  EXPECT_TRUE(Holds(image, {37, 231, 253}));
  EXPECT_TRUE(Holds(image, {205, 205, 205}));
}

}  // namespace
}  // namespace cairn::studies
