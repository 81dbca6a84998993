// Plots as plain values, and functions that draw them as pictures: lines and points with error bars and bands
// over labelled axes, heat maps, and map images with paths over them. For people to look at; nothing reads
// them back. The unit of the data is that of the axis label. Stateless, thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/map/image_codec.h"
#include "common/map/occupancy_image.h"
#include "common/sensor/trajectory.h"

namespace cairn::studies {

// A label with its unit: {"distance", "m"} is written "distance (m)". Every field
// here has an initializer, so that a plot names only the fields that matter.
struct Axis {
  std::string label{};
  std::string unit{};
  bool logarithmic = false;     // Values at or below zero are then left out.
  std::optional<double> low{};  // Ends of the axis; from the data where not given.
  std::optional<double> high{};
};

enum class Mark : std::uint8_t { kLine, kPoints, kLineAndPoints, kDashed };

struct Series {
  std::string label{};  // In the legend; empty: not listed.
  std::vector<double> x{};
  std::vector<double> y{};            // As many as x; a NaN lifts the pen.
  std::vector<double> deviation{};    // Error bars of y - d .. y + d; empty: none.
  std::vector<double> low{}, high{};  // A band behind the line; empty: none.
  Mark mark = Mark::kLineAndPoints;
  std::optional<int> colour{};  // Index into the palette; next free one where not given.
};

// A horizontal dashed line with words, e.g. a bound or a printed figure.
struct Bound {
  double y = 0.0;
  std::string label{};
};

struct Plot {
  std::string title{};
  Axis x{}, y{};
  std::vector<Series> series{};
  std::vector<Bound> bounds{};
  bool equal_scale = false;  // One unit has the same length on both axes, as in maps.
  int width = 1000;
  int height = 620;
};
[[nodiscard]] RasterImage DrawPlot(const Plot& plot);

// The map under the plot's series: x and y are metres in `map`.
[[nodiscard]] RasterImage DrawMap(const OccupancyImage& map, const Plot& plot);

// A trajectory as a series of DrawMap.
[[nodiscard]] Series PathSeries(const Trajectory& trajectory, std::string label);

struct HeatMap {
  std::string title{};
  Axis x{}, y{};
  std::vector<double> columns{};  // x of the columns' centres, ascending.
  std::vector<double> rows{};     // y of the rows' centres, ascending.
  std::vector<double> values{};   // Row by row from the lowest y; NaN: no value.
  std::string value_label{};
  double low = 0.0;   // Dark end of the colours ...
  double high = 1.0;  // ... and bright end.
  bool print_values = false;
  int width = 760;
  int height = 620;
};
[[nodiscard]] RasterImage DrawHeatMap(const HeatMap& map);

}  // namespace cairn::studies
