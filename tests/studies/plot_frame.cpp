#include "tests/studies/plot_frame.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace cairn::studies {
namespace {

constexpr int kShift = 4;  // Fractional bits of OpenCV's coordinates.
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr int kLeft = 96, kTop = 44, kBottom = 62;

cv::Point Fixed(cv::Point2d p) {
  const auto fixed = [](double value) {
    return static_cast<int>(std::lround(std::clamp(value, -1e4, 1e5) * (1 << kShift)));
  };
  return {fixed(p.x), fixed(p.y)};
}

std::string LabelOf(const Axis& axis) {
  return axis.unit.empty() ? axis.label : axis.label + " (" + axis.unit + ")";
}

}  // namespace

std::vector<double> TicksOf(AxisRange range, bool logarithmic, int wanted) {
  std::vector<double> ticks;
  if (logarithmic) {
    const double first = std::ceil(std::log10(range.low) - 1e-9), last = std::floor(std::log10(range.high) + 1e-9);
    const bool few = last - first < 2.5;
    const double stride = std::max(1.0, std::ceil((last - first) / std::max(wanted, 1)));
    for (double power = few ? first - 1 : first; power <= last; power += stride) {
      for (const double digit : {1.0, 2.0, 5.0}) {
        const double value = digit * std::pow(10.0, power);
        if ((digit == 1.0 || few) && value >= range.low * (1 - 1e-9) && value <= range.high * (1 + 1e-9))
          ticks.push_back(value);
      }
    }
    return ticks.size() >= 3 ? ticks : TicksOf(range, false, wanted);
  }
  const double rough = (range.high - range.low) / std::max(wanted, 1);
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * power;
  for (const double digit : {1.0, 2.0, 5.0})
    if (digit * power >= rough * 0.999) {
      step = digit * power;
      break;
    }
  const double first = std::ceil(range.low / step - 1e-9);
  for (int i = 0; i < 100 && (first + i) * step <= range.high + 1e-9 * step; ++i)
    ticks.push_back((first + i) == 0.0 ? 0.0 : (first + i) * step);
  return ticks;
}

std::string TickText(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

AxisRange RangeOf(const Axis& axis, const std::vector<double>& values) {
  AxisRange range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (const double value : values) {
    if (!std::isfinite(value) || (axis.logarithmic && value <= 0.0)) continue;
    range.low = std::min(range.low, value);
    range.high = std::max(range.high, value);
  }
  if (range.low > range.high) range = axis.logarithmic ? AxisRange{0.1, 1.0} : AxisRange{0.0, 1.0};
  if (axis.logarithmic) {
    range = {axis.low.value_or(range.low / 1.15), axis.high.value_or(range.high * 1.15)};
    if (!(range.high > range.low)) range.high = range.low * 10.0;
    return range;
  }
  const double span = range.high - range.low;
  const double air = span > 0 ? 0.04 * span : std::max(0.5 * std::abs(range.low), 0.5);
  range = {axis.low.value_or(range.low - air), axis.high.value_or(range.high + air)};
  if (!(range.high > range.low)) range.high = range.low + 1.0;
  return range;
}

cv::Scalar PaletteColour(int index) {
  // Tableau 10, as blue green red.
  static const cv::Scalar colours[] = {{167, 121, 78}, {43, 142, 242}, {87, 87, 225},   {178, 183, 118},
                                       {79, 161, 89},  {72, 201, 237}, {161, 122, 176}, {167, 157, 255},
                                       {95, 117, 156}, {110, 100, 90}};
  return colours[((index % 10) + 10) % 10];
}

PlotFrame::PlotFrame(int width, int height, Axis x, AxisRange x_range, Axis y, AxisRange y_range, bool equal_scale,
                     int right_margin)
    : area_(kLeft, kTop, std::max(width - kLeft - right_margin, 50), std::max(height - kTop - kBottom, 50)),
      x_(std::move(x)),
      y_(std::move(y)),
      x_range_(x_range),
      y_range_(y_range) {
  if (equal_scale) {
    const double per_m =
        std::min(area_.width / (x_range.high - x_range.low), area_.height / (y_range.high - y_range.low));
    const int wide = static_cast<int>(std::lround((x_range.high - x_range.low) * per_m));
    const int high = static_cast<int>(std::lround((y_range.high - y_range.low) * per_m));
    area_.width = std::max(wide, 50);
    area_.height = std::max(high, 50);
    width = std::max(area_.width + kLeft + right_margin, 640);
    height = area_.height + kTop + kBottom;
  }
  image_ = cv::Mat(height, width, CV_8UC3, cv::Scalar(255, 255, 255));
}

double PlotFrame::Share(double value, AxisRange range, bool logarithmic) const {
  if (logarithmic) return std::log(value / range.low) / std::log(range.high / range.low);
  return (value - range.low) / (range.high - range.low);
}

bool PlotFrame::Shows(double x, double y) const {
  return std::isfinite(x) && std::isfinite(y) && (!x_.logarithmic || x > 0) && (!y_.logarithmic || y > 0);
}

cv::Point2d PlotFrame::At(double x, double y) const {
  return {area_.x + area_.width * Share(x, x_range_, x_.logarithmic),
          area_.y + area_.height * (1.0 - Share(y, y_range_, y_.logarithmic))};
}

void PlotFrame::DrawGrid() {
  const cv::Scalar grey(230, 230, 230);
  for (const double x : TicksOf(x_range_, x_.logarithmic, area_.width / 90))
    DrawStroke(image_, {At(x, y_range_.low).x, 1.0 * area_.y}, {At(x, y_range_.low).x, 1.0 * area_.br().y}, grey, 1);
  for (const double y : TicksOf(y_range_, y_.logarithmic, area_.height / 60))
    DrawStroke(image_, {1.0 * area_.x, At(x_range_.low, y).y}, {1.0 * area_.br().x, At(x_range_.low, y).y}, grey, 1);
}

void PlotFrame::DrawAxes(const std::string& title) {
  const cv::Scalar white(255, 255, 255), ink(60, 60, 60);
  const cv::Rect around[] = {{0, 0, image_.cols, area_.y},
                             {0, area_.br().y, image_.cols, image_.rows - area_.br().y},
                             {0, 0, area_.x, image_.rows},
                             {area_.br().x, 0, image_.cols - area_.br().x, image_.rows}};
  for (const cv::Rect& margin : around) cv::rectangle(image_, margin, white, cv::FILLED);
  cv::rectangle(image_, area_, ink, 1);
  for (const double x : TicksOf(x_range_, x_.logarithmic, area_.width / 90)) {
    const cv::Point2d p = At(x, y_range_.low);
    DrawStroke(image_, {p.x, 1.0 * area_.br().y}, {p.x, area_.br().y + 5.0}, ink, 1);
    DrawText(image_, TickText(x), {p.x, area_.br().y + 17.0}, Anchor::kCentre, 0.46);
  }
  int widest = 0;
  for (const double y : TicksOf(y_range_, y_.logarithmic, area_.height / 60)) {
    const cv::Point2d p = At(x_range_.low, y);
    DrawStroke(image_, {area_.x - 5.0, p.y}, {1.0 * area_.x, p.y}, ink, 1);
    DrawText(image_, TickText(y), {area_.x - 9.0, p.y}, Anchor::kRight, 0.46);
    widest = std::max(widest, TextWidth(TickText(y), 0.46));
  }
  DrawText(image_, title, {0.5 * image_.cols, 0.5 * kTop}, Anchor::kCentre, 0.62);
  DrawText(image_, LabelOf(x_), {area_.x + 0.5 * area_.width, area_.br().y + 42.0}, Anchor::kCentre, 0.54);
  // The y label, turned.
  const int length = TextWidth(LabelOf(y_), 0.54) + 4;
  cv::Mat flat(22, length, CV_8UC3, white), upright;
  DrawText(flat, LabelOf(y_), {2.0, 11.0}, Anchor::kLeft, 0.54);
  cv::rotate(flat, upright, cv::ROTATE_90_COUNTERCLOCKWISE);
  const cv::Rect place(std::max(4, std::min(10, area_.x - widest - 38)), area_.y + (area_.height - length) / 2, 22,
                       length);
  const cv::Rect inside = place & cv::Rect(0, 0, image_.cols, image_.rows);
  if (inside.area() > 0)
    upright(cv::Rect(inside.x - place.x, inside.y - place.y, inside.width, inside.height)).copyTo(image_(inside));
}

void DrawText(cv::Mat& image, const std::string& text, cv::Point2d p, Anchor anchor, double size,
              const cv::Scalar& colour) {
  int baseline = 0;
  const cv::Size box = cv::getTextSize(text, kFont, size, 1, &baseline);
  const double left = anchor == Anchor::kLeft    ? p.x
                      : anchor == Anchor::kRight ? p.x - box.width
                                                 : p.x - 0.5 * box.width;
  cv::putText(image, text,
              cv::Point(static_cast<int>(std::lround(left)), static_cast<int>(std::lround(p.y)) + box.height / 2),
              kFont, size, colour, 1, cv::LINE_AA);
}

int TextWidth(const std::string& text, double size) {
  int baseline = 0;
  return cv::getTextSize(text, kFont, size, 1, &baseline).width;
}

void DrawStroke(cv::Mat& image, cv::Point2d a, cv::Point2d b, const cv::Scalar& colour, int thickness) {
  cv::line(image, Fixed(a), Fixed(b), colour, thickness, cv::LINE_AA, kShift);
}

void DrawDashes(cv::Mat& image, cv::Point2d a, cv::Point2d b, const cv::Scalar& colour, int thickness) {
  const double length = std::min(std::hypot(b.x - a.x, b.y - a.y), 1e4);
  for (double at = 0.0; at < length; at += 12.0)
    DrawStroke(image, a + (b - a) * (at / length), a + (b - a) * (std::min(at + 7.0, length) / length), colour,
               thickness);
}

RasterImage RasterOf(const cv::Mat& image) {
  RasterImage raster{image.cols, image.rows, 3, {}};
  for (int row = 0; row < image.rows; ++row) {
    const std::uint8_t* line = image.ptr<std::uint8_t>(row);
    raster.samples.insert(raster.samples.end(), line, line + 3 * image.cols);
  }
  return raster;
}

}  // namespace cairn::studies
