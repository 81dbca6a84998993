#include "tests/studies/plot.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "tests/studies/plot_frame.h"

namespace cairn::studies {
namespace {

bool HasLine(Mark mark) {
  return mark != Mark::kPoints;
}

void DrawBand(PlotFrame& frame, const Series& series, const cv::Scalar& colour) {
  if (series.low.size() != series.x.size() || series.high.size() != series.x.size() || series.x.size() < 2) return;
  cv::Mat veil = frame.image().clone();
  for (std::size_t i = 0; i + 1 < series.x.size(); ++i) {
    const auto corner = [&](std::size_t k, const std::vector<double>& y) {
      return cv::Point(frame.At(series.x[k], y[k]));
    };
    if (!frame.Shows(series.x[i], series.low[i]) || !frame.Shows(series.x[i + 1], series.low[i + 1]) ||
        !frame.Shows(series.x[i], series.high[i]) || !frame.Shows(series.x[i + 1], series.high[i + 1]))
      continue;
    const std::vector<cv::Point> piece{corner(i, series.low), corner(i + 1, series.low), corner(i + 1, series.high),
                                       corner(i, series.high)};
    cv::fillConvexPoly(veil, piece, colour);
  }
  cv::addWeighted(veil, 0.22, frame.image(), 0.78, 0.0, frame.image());
}

void DrawErrorBars(PlotFrame& frame, const Series& series, const cv::Scalar& colour) {
  if (series.deviation.size() != series.x.size()) return;
  for (std::size_t i = 0; i < series.x.size(); ++i) {
    const double low = series.y[i] - series.deviation[i], high = series.y[i] + series.deviation[i];
    if (!frame.Shows(series.x[i], low) || !frame.Shows(series.x[i], high)) continue;
    const cv::Point2d a = frame.At(series.x[i], low), b = frame.At(series.x[i], high), wide(4.0, 0.0);
    DrawStroke(frame.image(), a, b, colour, 1);
    DrawStroke(frame.image(), a - wide, a + wide, colour, 1);
    DrawStroke(frame.image(), b - wide, b + wide, colour, 1);
  }
}

void DrawCurve(PlotFrame& frame, const Series& series, const cv::Scalar& colour, int thickness) {
  const std::size_t count = std::min(series.x.size(), series.y.size());
  for (std::size_t i = 0; i < count; ++i) {
    if (!frame.Shows(series.x[i], series.y[i])) continue;
    const cv::Point2d p = frame.At(series.x[i], series.y[i]);
    if (HasLine(series.mark) && i + 1 < count && frame.Shows(series.x[i + 1], series.y[i + 1])) {
      const cv::Point2d q = frame.At(series.x[i + 1], series.y[i + 1]);
      if (series.mark == Mark::kDashed)
        DrawDashes(frame.image(), p, q, colour, thickness);
      else
        DrawStroke(frame.image(), p, q, colour, thickness);
    }
    if (series.mark == Mark::kPoints || series.mark == Mark::kLineAndPoints)
      cv::circle(frame.image(), cv::Point(p * 16.0), 3 * 16, colour, cv::FILLED, cv::LINE_AA, 4);
  }
}

int ColourIndex(const Series& series, std::size_t position) {
  return series.colour.value_or(static_cast<int>(position));
}

// 0 x 0 if no series has a label.
cv::Size LegendSize(const Plot& plot) {
  int widest = 0, lines = 0;
  for (const Series& series : plot.series) {
    if (series.label.empty()) continue;
    widest = std::max(widest, TextWidth(series.label, 0.48));
    ++lines;
  }
  return lines == 0 ? cv::Size() : cv::Size(widest + 52, 20 * lines + 10);
}

// Maps keep room for their legend on the right: every corner of them shows something. So do plots with a long
// one.
int RightMargin(const Plot& plot, bool map) {
  const cv::Size legend = LegendSize(plot);
  const bool beside = map || legend.height > plot.height / 3;
  return beside && legend.width > 0 ? legend.width + 30 : 24;
}

// Beside the plot where there is room, else in its corner that holds the fewest points.
void DrawLegend(PlotFrame& frame, const Plot& plot) {
  const cv::Size size = LegendSize(plot);
  if (size.width == 0) return;
  const cv::Rect area = frame.area();
  const cv::Rect corners[] = {{area.br().x - size.width - 10, area.y + 10, size.width, size.height},
                              {area.x + 10, area.y + 10, size.width, size.height},
                              {area.br().x - size.width - 10, area.br().y - size.height - 10, size.width, size.height},
                              {area.x + 10, area.br().y - size.height - 10, size.width, size.height}};
  const auto crowd = [&](const cv::Rect& box) {
    int inside = 0;
    for (const Series& series : plot.series)
      for (std::size_t i = 0; i < std::min(series.x.size(), series.y.size()); ++i)
        if (frame.Shows(series.x[i], series.y[i]))
          inside += box.contains(cv::Point(frame.At(series.x[i], series.y[i])));
    return inside;
  };
  cv::Rect box = *std::min_element(std::begin(corners), std::end(corners),
                                   [&](const cv::Rect& a, const cv::Rect& b) { return crowd(a) < crowd(b); });
  if (frame.image().cols - area.br().x >= size.width + 20) box = {area.br().x + 12, area.y, size.width, size.height};
  cv::Mat veil = frame.image().clone();
  cv::rectangle(veil, box, cv::Scalar(255, 255, 255), cv::FILLED);
  cv::addWeighted(veil, 0.85, frame.image(), 0.15, 0.0, frame.image());
  cv::rectangle(frame.image(), box, cv::Scalar(190, 190, 190), 1);
  double y = box.y + 15.0;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const Series& series = plot.series[i];
    if (series.label.empty()) continue;
    const cv::Scalar colour = PaletteColour(ColourIndex(series, i));
    const cv::Point2d a(box.x + 8.0, y), b(box.x + 36.0, y);
    if (series.mark == Mark::kDashed)
      DrawDashes(frame.image(), a, b, colour, 2);
    else if (HasLine(series.mark))
      DrawStroke(frame.image(), a, b, colour, 2);
    if (series.mark == Mark::kPoints || series.mark == Mark::kLineAndPoints)
      cv::circle(frame.image(), cv::Point(0.5 * (a + b)), 3, colour, cv::FILLED, cv::LINE_AA);
    DrawText(frame.image(), series.label, {box.x + 44.0, y}, Anchor::kLeft, 0.48);
    y += 20.0;
  }
}

void DrawSeries(PlotFrame& frame, const Plot& plot, int thickness) {
  for (std::size_t i = 0; i < plot.series.size(); ++i)
    DrawBand(frame, plot.series[i], PaletteColour(ColourIndex(plot.series[i], i)));
  const cv::Scalar ink(90, 90, 90);
  const cv::Rect area = frame.area();
  for (const Bound& bound : plot.bounds) {
    if (!frame.Shows(1.0, bound.y)) continue;
    const double y = frame.At(1.0, bound.y).y;
    DrawDashes(frame.image(), {1.0 * area.x, y}, {1.0 * area.br().x, y}, ink, 1);
    DrawText(frame.image(), bound.label, {area.x + 8.0, y - 10.0}, Anchor::kLeft, 0.44, ink);
  }
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const cv::Scalar colour = PaletteColour(ColourIndex(plot.series[i], i));
    DrawErrorBars(frame, plot.series[i], colour);
    DrawCurve(frame, plot.series[i], colour, thickness);
  }
}

struct Extent {
  AxisRange x, y;
};

Extent ExtentOf(const Plot& plot, std::vector<double> xs, std::vector<double> ys) {
  for (const Series& series : plot.series) {
    xs.insert(xs.end(), series.x.begin(), series.x.end());
    ys.insert(ys.end(), series.y.begin(), series.y.end());
    ys.insert(ys.end(), series.low.begin(), series.low.end());
    ys.insert(ys.end(), series.high.begin(), series.high.end());
    for (std::size_t i = 0; i < std::min(series.deviation.size(), series.y.size()); ++i) {
      ys.push_back(series.y[i] - series.deviation[i]);
      ys.push_back(series.y[i] + series.deviation[i]);
    }
  }
  for (const Bound& bound : plot.bounds) ys.push_back(bound.y);
  return {RangeOf(plot.x, xs), RangeOf(plot.y, ys)};
}

}  // namespace

RasterImage DrawPlot(const Plot& plot) {
  const Extent extent = ExtentOf(plot, {}, {});
  PlotFrame frame(plot.width, plot.height, plot.x, extent.x, plot.y, extent.y, plot.equal_scale,
                  RightMargin(plot, plot.equal_scale));
  frame.DrawGrid();
  DrawSeries(frame, plot, 2);
  frame.DrawAxes(plot.title);
  DrawLegend(frame, plot);
  return RasterOf(frame.image());
}

namespace {

// Cuts off rows and columns at the edges that are unknown, because grids grow in whole chunks.
OccupancyImage Cropped(const OccupancyImage& map) {
  int left = map.width, right = -1, low = map.height, high = -1;
  for (int row = 0; row < map.height; ++row)
    for (int column = 0; column < map.width; ++column) {
      if (map.cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(map.width) +
                    static_cast<std::size_t>(column)] > 100)
        continue;
      left = std::min(left, column), right = std::max(right, column);
      low = std::min(low, row), high = std::max(high, row);
    }
  OccupancyImage cropped{map.resolution_m, map.T_map_origin, 0, 0, {}};
  if (right < left) return cropped;
  cropped.T_map_origin.x += left * map.resolution_m;
  cropped.T_map_origin.y += low * map.resolution_m;
  cropped.width = right - left + 1;
  cropped.height = high - low + 1;
  for (int row = low; row <= high; ++row) {
    const auto begin = map.cells.begin() + static_cast<std::ptrdiff_t>(row) * map.width + left;
    cropped.cells.insert(cropped.cells.end(), begin, begin + cropped.width);
  }
  return cropped;
}

}  // namespace

RasterImage DrawMap(const OccupancyImage& whole, const Plot& plot) {
  const OccupancyImage map = Cropped(whole);
  const double right = map.T_map_origin.x + map.width * map.resolution_m;
  const double top = map.T_map_origin.y + map.height * map.resolution_m;
  const bool any = map.width > 0 && map.height > 0;
  const Extent extent =
      any ? ExtentOf(plot, {map.T_map_origin.x, right}, {map.T_map_origin.y, top}) : ExtentOf(plot, {}, {});
  PlotFrame frame(plot.width, plot.height, plot.x, extent.x, plot.y, extent.y, true, RightMargin(plot, true));
  if (any) {
    // Darkest cell under each pixel, so that thin walls survive shrinking.
    cv::Mat cells(map.height, map.width, CV_8UC1);
    for (int row = 0; row < map.height; ++row)
      for (int column = 0; column < map.width; ++column) {
        const std::uint8_t cell = map.cells[static_cast<std::size_t>(row) * static_cast<std::size_t>(map.width) +
                                            static_cast<std::size_t>(column)];
        const bool known = cell <= 100;
        cells.at<std::uint8_t>(map.height - 1 - row, column) = static_cast<std::uint8_t>(!known      ? 222
                                                                                         : cell > 50 ? 0
                                                                                         : cell < 35 ? 255
                                                                                                     : 190);
      }
    const cv::Point2d low = frame.At(map.T_map_origin.x, map.T_map_origin.y), high = frame.At(right, top);
    const cv::Rect place(cv::Point(static_cast<int>(std::lround(low.x)), static_cast<int>(std::lround(high.y))),
                         cv::Point(static_cast<int>(std::lround(high.x)), static_cast<int>(std::lround(low.y))));
    const int shrink = std::max(1, static_cast<int>(std::floor(map.width / std::max(1.0, 1.0 * place.width))));
    if (shrink > 1) cv::erode(cells, cells, cv::Mat::ones(shrink, shrink, CV_8UC1));
    cv::Mat small;
    if (place.area() > 0) {
      cv::resize(cells, small, place.size(), 0, 0, cv::INTER_AREA);
      cv::cvtColor(small, small, cv::COLOR_GRAY2BGR);
      const cv::Rect inside = place & cv::Rect(0, 0, frame.image().cols, frame.image().rows);
      small(cv::Rect(inside.x - place.x, inside.y - place.y, inside.width, inside.height))
          .copyTo(frame.image()(inside));
    }
  }
  DrawSeries(frame, plot, 1);
  frame.DrawAxes(plot.title);
  DrawLegend(frame, plot);
  return RasterOf(frame.image());
}

Series PathSeries(const Trajectory& trajectory, std::string label) {
  Series series;
  series.label = std::move(label);
  series.mark = Mark::kLine;
  for (const StampedPose& pose : trajectory) {
    series.x.push_back(pose.T_map_robot.x);
    series.y.push_back(pose.T_map_robot.y);
  }
  return series;
}

}  // namespace cairn::studies
