#include "server/slam/trail/kept_scan.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "server/slam/trail/keyframe.h"

namespace cairn::slam {
namespace {

std::vector<std::uint32_t> BitsOf(std::span<const float> values) {
  std::vector<std::uint32_t> bits;
  for (const float value : values) bits.push_back(std::bit_cast<std::uint32_t>(value));
  return bits;
}

// Returns the bytes for each number.
double ExpectSameAgain(const std::vector<float>& values) {
  const std::vector<std::uint8_t> packed = PackFloats(values);
  EXPECT_EQ(BitsOf(UnpackFloats(packed, values.size())), BitsOf(values));
  return static_cast<double>(packed.size()) / static_cast<double>(values.size());
}

// A wall in `steps` per metre, with noise of 1 cm.
std::vector<float> Wall(double steps, std::size_t beams) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.01);
  std::vector<float> ranges;
  for (std::size_t i = 0; i < beams; ++i) {
    const double range = 4.0 / std::cos(0.0025 * static_cast<double>(i) - 0.9) + noise(random);
    ranges.push_back(static_cast<float>(steps > 0.0 ? std::round(range * steps) / steps : range));
  }
  return ranges;
}

TEST(PackFloats, GivesBackEveryBit) {
  EXPECT_EQ(UnpackFloats(PackFloats({}), 0), std::vector<float>{});
  const float infinity = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  const float other_nan = std::bit_cast<float>(0xffc12345U);
  ExpectSameAgain({infinity, -infinity, nan, other_nan, 0.0F, -0.0F, 1e-45F, -3.4e38F, 3.4e38F, 2.5F});
  ExpectSameAgain({-0.0F, 1.5F});  // Millimetres, but for the sign.
  ExpectSameAgain({99999.5F, 1e8F, 0.001F, 0.00025F});
  std::mt19937 random(2);
  for (const std::size_t count : {1, 2, 15, 16, 17, 31, 32, 33, 8192}) {
    std::vector<float> any, millimetres;
    for (std::size_t i = 0; i < count; ++i) {
      any.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(random())));
      millimetres.push_back(static_cast<float>(static_cast<double>(random() % 80000) / 1000.0));
    }
    ExpectSameAgain(any);
    ExpectSameAgain(millimetres);
    millimetres[count / 2] = infinity;
    ExpectSameAgain(millimetres);
  }
}

TEST(PackFloats, TakesAThirdOfTheMemoryWhereALidarMeasuresSteps) {
  EXPECT_LT(ExpectSameAgain(Wall(1000.0, 720)), 1.3);
  EXPECT_LT(ExpectSameAgain(Wall(4000.0, 720)), 1.5);
  EXPECT_LT(ExpectSameAgain(Wall(100.0, 720)), 1.3);
  EXPECT_LT(ExpectSameAgain(Wall(0.0, 720)), 3.0) << "any floats, with their noise";
}

TEST(KeptScan, IsTheSameScanWhenItIsPacked) {
  Scan scan{.sequence = 7,
            .stamp = 123456789,
            .angle_first_rad = -1.5,
            .angle_step_rad = 0.01,
            .range_min_m = 0.1,
            .range_max_m = 20.0,
            .beam_period_s = 1e-4,
            .tilt_rad = 0.02,
            .T_robot_laser = {0.1, 0.2, 0.3},
            .ranges_m = Wall(0.0, 361)};
  KeptScan kept(std::make_shared<const Scan>(scan));
  const KeptScan whole = kept;
  kept.Pack();
  kept.Pack();  // Once more changes nothing.
  EXPECT_TRUE(kept.packed());
  EXPECT_FALSE(whole.packed());
  for (const KeptScan& one : {kept, whole}) {
    const Scan read = *one;
    EXPECT_EQ(read.sequence, scan.sequence);
    EXPECT_EQ(read.stamp, scan.stamp);
    EXPECT_EQ(read.angle_first_rad, scan.angle_first_rad);
    EXPECT_EQ(read.angle_step_rad, scan.angle_step_rad);
    EXPECT_EQ(read.range_min_m, scan.range_min_m);
    EXPECT_EQ(read.range_max_m, scan.range_max_m);
    EXPECT_EQ(read.beam_period_s, scan.beam_period_s);
    EXPECT_EQ(read.tilt_rad, scan.tilt_rad);
    EXPECT_EQ(read.T_robot_laser, scan.T_robot_laser);
    EXPECT_EQ(BitsOf(read.ranges_m), BitsOf(scan.ranges_m));
    EXPECT_EQ(one->stamp, scan.stamp);
    EXPECT_EQ(BitsOf(one.Share()->ranges_m), BitsOf(scan.ranges_m));
  }
}

}  // namespace
}  // namespace cairn::slam
