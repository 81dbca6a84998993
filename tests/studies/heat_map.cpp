#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>

#include "tests/studies/plot.h"
#include "tests/studies/plot_frame.h"

namespace cairn::studies {
namespace {

// Viridis from a few of its points, as blue green red: dark purple is low, yellow high. Grey where there is
// no value.
cv::Scalar HeatColour(double share) {
  if (!std::isfinite(share)) return {205, 205, 205};
  static const cv::Scalar points[] = {{84, 1, 68}, {139, 82, 59}, {140, 145, 33}, {98, 201, 94}, {37, 231, 253}};
  const double at = std::clamp(share, 0.0, 1.0) * 4.0;
  const int low = std::min(static_cast<int>(at), 3);
  return points[low] + (points[low + 1] - points[low]) * (at - low);
}

// Cells end half-way between centres.
std::vector<double> EdgesOf(const std::vector<double>& centres) {
  std::vector<double> edges;
  const std::size_t n = centres.size();
  if (n == 0) return {0.0, 1.0};
  const double first = n > 1 ? centres[1] - centres[0] : 1.0, last = n > 1 ? centres[n - 1] - centres[n - 2] : 1.0;
  edges.push_back(centres[0] - 0.5 * first);
  for (std::size_t i = 0; i + 1 < n; ++i) edges.push_back(0.5 * (centres[i] + centres[i + 1]));
  edges.push_back(centres[n - 1] + 0.5 * last);
  return edges;
}

void DrawColourBar(PlotFrame& frame, const HeatMap& map) {
  const cv::Rect area = frame.area();
  const cv::Rect bar(area.br().x + 24, area.y, 16, area.height);
  for (int row = 0; row < bar.height; ++row)
    cv::line(frame.image(), {bar.x, bar.br().y - row}, {bar.br().x, bar.br().y - row},
             HeatColour(1.0 * row / bar.height));
  cv::rectangle(frame.image(), bar, cv::Scalar(60, 60, 60), 1);
  for (const double value : TicksOf({map.low, map.high}, false, 6))
    DrawText(frame.image(), TickText(value),
             {bar.br().x + 6.0, bar.br().y - bar.height * (value - map.low) / (map.high - map.low)}, Anchor::kLeft,
             0.44);
  DrawText(frame.image(), map.value_label, {frame.image().cols - 8.0, area.br().y + 42.0}, Anchor::kRight, 0.48);
}

}  // namespace

RasterImage DrawHeatMap(const HeatMap& map) {
  const std::vector<double> x = EdgesOf(map.columns), y = EdgesOf(map.rows);
  PlotFrame frame(map.width, map.height, map.x, {x.front(), x.back()}, map.y, {y.front(), y.back()}, false, 110);
  for (std::size_t row = 0; row + 1 < y.size(); ++row) {
    for (std::size_t column = 0; column + 1 < x.size(); ++column) {
      const std::size_t index = row * (x.size() - 1) + column;
      if (index >= map.values.size()) continue;
      const double share = (map.values[index] - map.low) / (map.high - map.low);
      const cv::Point a(frame.At(x[column], y[row + 1])), b(frame.At(x[column + 1], y[row]));
      cv::rectangle(frame.image(), a, b, HeatColour(share), cv::FILLED);
      if (map.print_values && std::isfinite(map.values[index]))
        DrawText(frame.image(), TickText(std::round(map.values[index] * 100) / 100), 0.5 * cv::Point2d(a + b),
                 Anchor::kCentre, 0.4, share > 0.6 ? cv::Scalar(30, 30, 30) : cv::Scalar(255, 255, 255));
    }
  }
  frame.DrawAxes(map.title);
  DrawColourBar(frame, map);
  return RasterOf(frame.image());
}

}  // namespace cairn::studies
