#include "client/cli/map_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <opencv2/imgproc.hpp>

#include "common/file/atomic_file.h"
#include "common/map/image_codec.h"

namespace cairn::client {
namespace {

const cv::Scalar kPaper(255, 255, 255), kInk(59, 41, 30), kMuted(139, 116, 100);  // BGR, as OpenCV has it.
const cv::Vec3f kUnknownColor(243, 239, 235), kFreeColor(255, 255, 255), kWallColor(56, 38, 28);
// Most colour-blind people can tell these apart, too (after Okabe, Ito 2008).
const std::array<cv::Scalar, 8> kPathColors = {
    cv::Scalar(178, 114, 0), cv::Scalar(0, 94, 213),   cv::Scalar(115, 158, 0), cv::Scalar(167, 121, 204),
    cv::Scalar(0, 159, 230), cv::Scalar(233, 180, 86), cv::Scalar(40, 40, 180), cv::Scalar(120, 90, 90)};
constexpr int kSubpixelBits = 4;

class Canvas {
 public:
  Canvas(const PictureFrame& frame, const PictureOptions& options)
      : frame_(frame),
        // The second bound keeps the picture of a tall map at most twice as high as it is wide.
        px_per_m_(std::min(options.width_px / (frame.x_max_m - frame.x_min_m),
                           2.0 * options.width_px / (frame.y_max_m - frame.y_min_m))),
        unit_(options.width_px / 1800.0),
        shades_(static_cast<float>(options.shades)) {
    const int width = static_cast<int>(std::lround((frame.x_max_m - frame.x_min_m) * px_per_m_));
    const int height = static_cast<int>(std::lround((frame.y_max_m - frame.y_min_m) * px_per_m_));
    map_ = cv::Rect(0, options.title.empty() ? 0 : Pixels(70), std::max(width, Pixels(600)), std::max(height, 1));
    drawn_ = cv::Rect(0, map_.y, width, map_.height);
    image_.create(map_.y + map_.height + Pixels(84), map_.width, CV_8UC3);
    image_.setTo(kPaper);
  }

  void DrawCells(const OccupancyImage& map) {
    cv::Mat known = cv::Mat::zeros(map.height, map.width, CV_32F), wall = known.clone();
    for (int row = 0; row < map.height; ++row) {
      for (int column = 0; column < map.width; ++column) {
        const std::uint8_t cell = map.cells[static_cast<std::size_t>(row) * map.width + column];
        if (cell == kUnknownCell) continue;
        // Cells of an occupancy near 0.5 are drawn like unknown ones, because grey would look like a thin wall.
        const float occupied = static_cast<float>(std::min<int>(cell, 100)) / 100.0f;
        known.at<float>(row, column) = occupied < 0.5f ? 1.0f - 2.0f * occupied : 0.0f;
        wall.at<float>(row, column) = occupied > 0.5f ? 2.0f * occupied - 1.0f : 0.0f;
      }
    }
    // Maps cells of the map to pixels of the picture.
    const double cell_px = map.resolution_m * px_per_m_;
    const double dx = (map.T_map_origin.x - frame_.x_min_m) * px_per_m_,
                 dy = (frame_.y_max_m - map.T_map_origin.y) * px_per_m_;
    const cv::Mat to_picture =
        (cv::Mat_<double>(2, 3) << cell_px, 0, dx + 0.5 * cell_px - 0.5, 0, -cell_px, dy - 0.5 * cell_px - 0.5);
    cv::Mat target = image_(drawn_), known_px, wall_px;
    if (cell_px < 1.0) {  // When the map is shrunk, a wall thinner than a pixel must stay visible.
      const int reach = static_cast<int>(std::ceil(1.0 / cell_px));
      cv::dilate(wall, wall, cv::getStructuringElement(cv::MORPH_RECT, {reach, reach}));
    }
    cv::warpAffine(known, known_px, to_picture, drawn_.size(), cv::INTER_LINEAR);
    cv::warpAffine(wall, wall_px, to_picture, drawn_.size(), cv::INTER_LINEAR);
    for (int row = 0; row < target.rows; ++row) {
      for (int column = 0; column < target.cols; ++column) {
        const float k = Sharpen(known_px.at<float>(row, column)), w = Sharpen(wall_px.at<float>(row, column));
        const cv::Vec3f ground = kUnknownColor * (1 - k) + kFreeColor * k;
        const cv::Vec3f color = ground * (1 - w) + kWallColor * w;
        target.at<cv::Vec3b>(row, column) = cv::Vec3b(
            cv::saturate_cast<uchar>(color[0]), cv::saturate_cast<uchar>(color[1]), cv::saturate_cast<uchar>(color[2]));
      }
    }
  }

  void DrawPath(const Trajectory& trajectory, const cv::Scalar& color, bool reference) {
    std::vector<cv::Point> points;
    for (const StampedPose& pose : trajectory) {
      const cv::Point point = At(pose.T_map_robot.translation());
      if (points.empty() || points.back() != point) points.push_back(point);
    }
    if (points.empty()) return;
    if (reference) {
      cv::polylines(image_, points, false, color, Pixels(2), cv::LINE_AA, kSubpixelBits);
      return;
    }
    cv::polylines(image_, points, false, kPaper, Pixels(8), cv::LINE_AA,
                  kSubpixelBits);  // A white rim makes crossings readable.
    cv::polylines(image_, points, false, color, Pixels(4), cv::LINE_AA, kSubpixelBits);
  }

  // A ring where it starts, an arrowhead where it ends.
  void DrawEnds(const Trajectory& trajectory, const cv::Scalar& color) {
    if (trajectory.empty()) return;
    const cv::Point start = At(trajectory.front().T_map_robot.translation());
    const int radius = Pixels(9) << kSubpixelBits;
    cv::circle(image_, start, radius, kPaper, cv::FILLED, cv::LINE_AA, kSubpixelBits);
    cv::circle(image_, start, radius, color, Pixels(4), cv::LINE_AA, kSubpixelBits);
    const Pose2& T_map_end = trajectory.back().T_map_robot;
    const auto head = [&](double size_px) {
      const double s = size_px * unit_ / px_per_m_;
      return std::vector<cv::Point>{
          At(T_map_end * Eigen::Vector2d(1.3 * s, 0)), At(T_map_end * Eigen::Vector2d(-0.9 * s, 0.9 * s)),
          At(T_map_end * Eigen::Vector2d(-0.4 * s, 0)), At(T_map_end * Eigen::Vector2d(-0.9 * s, -0.9 * s))};
    };
    cv::fillPoly(image_, std::vector<std::vector<cv::Point>>{head(21)}, kPaper, cv::LINE_AA, kSubpixelBits);
    cv::fillPoly(image_, std::vector<std::vector<cv::Point>>{head(15)}, color, cv::LINE_AA, kSubpixelBits);
  }

  void DrawTitle(const std::string& title) {
    if (!title.empty()) Text(title, {Pixels(28), Pixels(46)}, 1.05, kInk, 2);
  }

  // The strip under the map: scale bar left, one entry per path right of it.
  void DrawLegend(const std::vector<PicturePath>& paths, const std::vector<cv::Scalar>& colors) {
    const int y = map_.y + map_.height + Pixels(46);
    const double length_m = RoundLength(0.16 * map_.width / px_per_m_);
    const int x0 = Pixels(28), x1 = x0 + static_cast<int>(std::lround(length_m * px_per_m_)), tick = Pixels(8);
    for (const auto& [from, to] : {std::pair<cv::Point, cv::Point>{{x0, y}, {x1, y}},
                                   {{x0, y - tick}, {x0, y + tick}},
                                   {{x1, y - tick}, {x1, y + tick}}}) {
      cv::line(image_, from, to, kInk, Pixels(3), cv::LINE_AA);
    }
    int x = x1 + Pixels(16);
    x += Text(fmt::format("{:g} m", length_m), {x, y + Pixels(9)}, 0.75, kInk, 1) + Pixels(56);
    for (std::size_t i = 0; i < paths.size(); ++i) {
      const int width = Pixels(46 + 14 + 34) + TextWidth(paths[i].label, 0.75, 1);
      if (x + width > map_.width) {
        Text("...", {x, y + Pixels(9)}, 0.75, kMuted, 1);
        break;
      }
      cv::line(image_, {x, y}, {x + Pixels(46), y}, colors[i], Pixels(paths[i].reference ? 2 : 5), cv::LINE_AA);
      Text(paths[i].label, {x + Pixels(60), y + Pixels(9)}, 0.75, kInk, 1);
      x += width;
    }
    cv::line(image_, {0, map_.y + map_.height}, {map_.width, map_.y + map_.height}, cv::Scalar(220, 212, 205), 1);
  }

  [[nodiscard]] RasterImage image() const {
    RasterImage raster{image_.cols, image_.rows, 3, {}};
    raster.samples.assign(image_.datastart, image_.dataend);
    return raster;
  }

 private:
  [[nodiscard]] int Pixels(double at_1800) const { return std::max(1, static_cast<int>(std::lround(at_1800 * unit_))); }

  // Makes interpolated edges steeper, so that they stay about a pixel wide when cells are drawn large.
  [[nodiscard]] float Sharpen(float value) const {
    const auto gain = static_cast<float>(std::clamp(0.25 * px_per_m_ * 0.05, 1.0, 3.0));
    const float sharp = std::clamp((value - 0.5f) * gain + 0.5f, 0.0f, 1.0f);
    return shades_ > 0.0f ? std::round(sharp * shades_) / shades_ : sharp;
  }

  [[nodiscard]] cv::Point At(const Eigen::Vector2d& p_map) const {
    constexpr double kOne = 1 << kSubpixelBits;
    return {static_cast<int>(std::lround(((p_map.x() - frame_.x_min_m) * px_per_m_ - 0.5) * kOne)),
            static_cast<int>(std::lround(((frame_.y_max_m - p_map.y()) * px_per_m_ - 0.5 + map_.y) * kOne))};
  }

  [[nodiscard]] int TextWidth(const std::string& text, double size, int weight) const {
    return cv::getTextSize(text, cv::FONT_HERSHEY_DUPLEX, size * unit_, Pixels(weight), nullptr).width;
  }
  int Text(const std::string& text, const cv::Point& baseline, double size, const cv::Scalar& color, int weight) {
    cv::putText(image_, text, baseline, cv::FONT_HERSHEY_DUPLEX, size * unit_, color, Pixels(weight), cv::LINE_AA);
    return TextWidth(text, size, weight);
  }

  const PictureFrame frame_;
  const double px_per_m_;
  const double unit_;  // Pens and letters are sized for a picture 1800 px wide.
  const float shades_;
  cv::Rect map_;    // The map's band.
  cv::Rect drawn_;  // The part of it the frame covers.
  cv::Mat image_;
};

}  // namespace

double RoundLength(double wanted_m) {
  const double power = std::pow(10.0, std::floor(std::log10(wanted_m)));
  for (const double step : {5.0, 2.0}) {
    if (step * power <= wanted_m) return step * power;
  }
  return power;
}

void PictureFrame::Include(double x_m, double y_m) {
  x_min_m = std::min(x_min_m, x_m);
  x_max_m = std::max(x_max_m, x_m);
  y_min_m = std::min(y_min_m, y_m);
  y_max_m = std::max(y_max_m, y_m);
}

void PictureFrame::Include(const PictureFrame& other) {
  if (other.empty()) return;
  Include(other.x_min_m, other.y_min_m);
  Include(other.x_max_m, other.y_max_m);
}

PictureFrame FrameOf(const OccupancyImage& map, const std::vector<PicturePath>& paths, double margin_m) {
  PictureFrame frame;
  for (int row = 0; row < map.height; ++row) {
    for (int column = 0; column < map.width; ++column) {
      if (map.cells[static_cast<std::size_t>(row) * map.width + column] == kUnknownCell) continue;
      frame.Include(map.T_map_origin.x + column * map.resolution_m, map.T_map_origin.y + row * map.resolution_m);
      frame.Include(map.T_map_origin.x + (column + 1) * map.resolution_m,
                    map.T_map_origin.y + (row + 1) * map.resolution_m);
    }
  }
  for (const PicturePath& path : paths) {
    for (const StampedPose& pose : path.trajectory) frame.Include(pose.T_map_robot.x, pose.T_map_robot.y);
  }
  if (!frame.empty()) {
    frame.Include(frame.x_min_m - margin_m, frame.y_min_m - margin_m);
    frame.Include(frame.x_max_m + margin_m, frame.y_max_m + margin_m);
  }
  return frame;
}

Result<RasterImage> DrawMapPixels(const OccupancyImage& map, const std::vector<PicturePath>& paths,
                                  const PictureOptions& options) {
  if (options.width_px < 200 || options.width_px > 8000) {
    return Fail(StatusCode::kInvalidArgument, "a picture is 200 to 8000 pixels wide");
  }
  const PictureFrame frame =
      options.frame.empty() ? FrameOf(map, paths, std::max(0.05, options.margin_m)) : options.frame;
  if (frame.empty()) return Fail(StatusCode::kNotFound, "nothing to draw: the map is empty and so are the paths");
  std::vector<cv::Scalar> colors;
  for (const PicturePath& path : paths) {
    const auto robots = static_cast<std::size_t>(
        std::count_if(paths.begin(), paths.begin() + static_cast<std::ptrdiff_t>(colors.size()),
                      [](const auto& p) { return !p.reference; }));
    colors.push_back(path.reference ? kMuted : kPathColors[robots % kPathColors.size()]);
  }
  try {
    Canvas canvas(frame, options);
    if (map.width > 0 && map.height > 0) canvas.DrawCells(map);
    for (const bool reference : {true, false}) {
      for (std::size_t i = 0; i < paths.size(); ++i) {
        if (paths[i].reference == reference) canvas.DrawPath(paths[i].trajectory, colors[i], reference);
      }
    }
    for (std::size_t i = 0; i < paths.size(); ++i) {
      if (!paths[i].reference) canvas.DrawEnds(paths[i].trajectory, colors[i]);
    }
    canvas.DrawTitle(options.title);
    canvas.DrawLegend(paths, colors);
    return canvas.image();
  } catch (const std::exception& error) {
    return Fail(StatusCode::kInternal, fmt::format("drawing failed: {}", error.what()));
  }
}

Result<std::vector<std::uint8_t>> DrawMapPicture(const OccupancyImage& map, const std::vector<PicturePath>& paths,
                                                 const PictureOptions& options) {
  return DrawMapPixels(map, paths, options).and_then([](const RasterImage& image) {
    return EncodeImage(image, ".png", 9);
  });
}

Result<void> CheckPictureFile(const std::filesystem::path& file) {
  std::filesystem::path yaml = file;
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored) || !std::filesystem::exists(yaml.replace_extension(".yaml"), ignored))
    return {};
  return Fail(StatusCode::kAlreadyExists,
              "'" + file.string() + "' is the image of the map with the same name; give the picture another one");
}

Result<void> WritePictureFile(const std::filesystem::path& file, const std::vector<std::uint8_t>& bytes) {
  return WriteFileAtomically(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace cairn::client
