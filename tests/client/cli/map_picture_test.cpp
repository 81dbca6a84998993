#include "client/cli/map_picture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>

namespace cairn::client {
namespace {

// 4 x 2 m at 0.05 m: free, with a wall along x = 3 m.
OccupancyImage Map() {
  OccupancyImage map;
  map.T_map_origin = {10.0, -5.0, 0.0};
  map.width = 80;
  map.height = 40;
  map.cells.assign(80 * 40, 0);
  for (int row = 0; row < 40; ++row) map.cells[row * 80 + 60] = 100;
  return map;
}

cv::Mat Draw(const OccupancyImage& map, const std::vector<PicturePath>& paths, const PictureOptions& options) {
  const auto png = DrawMapPicture(map, paths, options);
  EXPECT_TRUE(png) << png.error().message;
  return png ? cv::imdecode(*png, cv::IMREAD_COLOR) : cv::Mat();
}

int Brightness(const cv::Mat& image, int x, int y) {
  const cv::Vec3b pixel = image.at<cv::Vec3b>(y, x);
  return (pixel[0] + pixel[1] + pixel[2]) / 3;
}

TEST(MapPicture, WallsAreDarkWhereTheyAre) {
  PictureOptions options;
  options.width_px = 1000;
  options.margin_m = 0.5;
  const cv::Mat image = Draw(Map(), {}, options);
  ASSERT_EQ(image.cols, 1000);
  const double px_per_m = 1000.0 / 5.0;  // The map and its margins.
  const int wall_x = static_cast<int>((0.5 + 3.025) * px_per_m), middle_y = static_cast<int>(1.5 * px_per_m);
  EXPECT_LT(Brightness(image, wall_x, middle_y), 80);
  EXPECT_GT(Brightness(image, wall_x - 40, middle_y), 250);
  EXPECT_LT(Brightness(image, 20, middle_y), 245) << "unknown is not free";
}

TEST(MapPicture, PathsAreColouredAndUpIsY) {
  Trajectory path;
  for (int i = 0; i <= 20; ++i) path.push_back({i, {10.5 + 0.1 * i, -3.3, 0.0}});  // Near the upper edge.
  PictureOptions options;
  options.width_px = 1000;
  options.margin_m = 0.5;
  const cv::Mat image = Draw(Map(), {{"robot1", path, false}}, options);
  const int x = static_cast<int>(2.0 * 200), y = static_cast<int>((0.5 + 0.3) * 200);
  const cv::Vec3b pixel = image.at<cv::Vec3b>(y, x);
  EXPECT_GT(std::abs(pixel[0] - pixel[2]), 80) << "a colour, not a grey";
  EXPECT_GT(Brightness(image, x, y + 100), 250);
}

// The pictures of an animation: the map grows, and what was there stays where it was.
TEST(MapPicture, PicturesOfOneFrameHaveOneSizeAndAPlaceIsAtTheSamePixel) {
  OccupancyImage grown = Map();
  grown.T_map_origin.x -= 2.0;
  grown.width += 40;
  grown.cells.assign(static_cast<std::size_t>(grown.width) * static_cast<std::size_t>(grown.height), 0);
  for (int row = 0; row < grown.height; ++row) grown.cells[static_cast<std::size_t>(row * grown.width + 100)] = 100;
  PictureOptions options;
  options.width_px = 1200;
  options.shades = 4;
  options.frame.Include(FrameOf(Map(), {}, 0.5));
  options.frame.Include(FrameOf(grown, {}, 0.5));
  options.frame.Include(PictureFrame{});
  EXPECT_NEAR(options.frame.x_max_m - options.frame.x_min_m, 7.0, 1e-9);
  const cv::Mat small = Draw(Map(), {}, options), large = Draw(grown, {}, options);
  ASSERT_EQ(small.size(), large.size());
  const int wall_x = static_cast<int>((0.5 + 2.0 + 3.025) * 1200.0 / 7.0), y = static_cast<int>(1.5 * 1200.0 / 7.0);
  EXPECT_LT(Brightness(small, wall_x, y), 80);
  EXPECT_LT(Brightness(large, wall_x, y), 80);
  const int new_x = static_cast<int>((0.5 + 1.0) * 1200.0 / 7.0);
  EXPECT_LT(Brightness(small, new_x, y), 245) << "unknown before";
  EXPECT_GT(Brightness(large, new_x, y), 250) << "free now";
}

TEST(MapPicture, DrawsPathsAloneAndRefusesNothingAtAll) {
  EXPECT_FALSE(DrawMapPicture({}, {}, {}));
  const cv::Mat image = Draw({}, {{"one pose", {{0, {1, 2, 3}}}, false}}, {});
  EXPECT_GT(image.rows, 0);
  PictureOptions tiny;
  tiny.width_px = 10;
  EXPECT_FALSE(DrawMapPicture(Map(), {}, tiny));
}

TEST(MapPicture, ALegendTooLongForThePictureIsCut) {
  std::vector<PicturePath> paths;
  for (int i = 0; i < 40; ++i) paths.push_back({"a robot with a long name", {{0, {11, -4, 0}}}, i % 2 == 0});
  PictureOptions options;
  options.title = "Title";
  EXPECT_GT(Draw(Map(), paths, options).rows, 0);
}

TEST(RoundLength, IsOneTwoOrFiveTimesAPowerOfTen) {
  EXPECT_DOUBLE_EQ(RoundLength(7.3), 5.0);
  EXPECT_DOUBLE_EQ(RoundLength(4.9), 2.0);
  EXPECT_DOUBLE_EQ(RoundLength(1.0), 1.0);
  EXPECT_DOUBLE_EQ(RoundLength(0.08), 0.05);
  EXPECT_DOUBLE_EQ(RoundLength(130), 100.0);
}

}  // namespace
}  // namespace cairn::client
