// The frame of a plot: a white picture with axes, ticks and labels, and the conversion from data to pixels.
// Used by the plots of this folder only.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "tests/studies/plot.h"

namespace cairn::studies {

struct AxisRange {
  double low = 0.0;
  double high = 1.0;
};

// Round values inside the range: 1, 2 or 5 times a power of ten apart; powers of ten on a logarithmic axis.
[[nodiscard]] std::vector<double> TicksOf(AxisRange range, bool logarithmic, int wanted);
[[nodiscard]] std::string TickText(double value);

// The given ends of the axis, otherwise those of the values with a small margin; never empty.
[[nodiscard]] AxisRange RangeOf(const Axis& axis, const std::vector<double>& values);

[[nodiscard]] cv::Scalar PaletteColour(int index);

class PlotFrame {
 public:
  // `right_margin`: pixels kept free on the right, for a colour bar.
  PlotFrame(int width, int height, Axis x, AxisRange x_range, Axis y, AxisRange y_range, bool equal_scale,
            int right_margin = 24);

  [[nodiscard]] cv::Mat& image() { return image_; }
  [[nodiscard]] cv::Rect area() const { return area_; }
  [[nodiscard]] bool Shows(double x, double y) const;  // Finite, and positive on logarithmic axes.
  [[nodiscard]] cv::Point2d At(double x, double y) const;

  void DrawGrid();
  // Frame, ticks, labels and title, over what was drawn; drawing outside the area is covered.
  void DrawAxes(const std::string& title);

 private:
  [[nodiscard]] double Share(double value, AxisRange range, bool logarithmic) const;

  cv::Mat image_;
  cv::Rect area_;
  Axis x_, y_;
  AxisRange x_range_, y_range_;
};

enum class Anchor : std::uint8_t { kLeft, kCentre, kRight };
// Text whose middle line is at p.y.
void DrawText(cv::Mat& image, const std::string& text, cv::Point2d p, Anchor anchor, double size = 0.5,
              const cv::Scalar& colour = {40, 40, 40});
[[nodiscard]] int TextWidth(const std::string& text, double size = 0.5);

// Thin smooth line between two points given in fractions of pixels.
void DrawStroke(cv::Mat& image, cv::Point2d a, cv::Point2d b, const cv::Scalar& colour, int thickness);
void DrawDashes(cv::Mat& image, cv::Point2d a, cv::Point2d b, const cv::Scalar& colour, int thickness);

[[nodiscard]] RasterImage RasterOf(const cv::Mat& image);

}  // namespace cairn::studies
