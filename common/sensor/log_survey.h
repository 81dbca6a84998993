// Two properties of a scanner that only its whole log shows, found in a first pass over the file: the range from which
// on a reading means "nothing hit", and how the scanner is mounted.
//
// No return: scanners report one of a few saturated values (SICK LMS: 81.83 or 81.91 m; in MIT Killian Court 51.0 to
// 51.2 m). Such readings pile up at the top of the range histogram. The pile counts where, around the most
// frequent centimetre of the upper half of the ranges seen, it holds at least 100 readings and 0.1 % of all, ten times
// what lies in the band just below it, almost nothing lies above it, and it is seen in at least a quarter of all beam
// directions (a wall in front of a standing robot is seen in few).
//
// Mounting: the median of the laser's pose seen from the robot's, where nine tenths of all messages agree with it
// (logs rewritten by a mapping program carry corrected laser poses, which are no mounting).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/sensor/log_message.h"

namespace cairn {

class LaserSurvey {
 public:
  void Add(const LaserMessage& laser);

  [[nodiscard]] std::int64_t scans() const { return scans_; }
  // The lowest saturated range; nothing if no pile is found.
  [[nodiscard]] std::optional<double> NoReturn() const;
  // T_robot_laser rounded to 1 mm and 0.1 mrad; nothing where poses are missing or follow no fixed mounting.
  [[nodiscard]] std::optional<Pose2> Mounting() const;

 private:
  static constexpr int kBins = 10'000;  // 1 cm each.
  struct Bin {
    std::int64_t count = 0;
    std::uint64_t sectors = 0;  // Which 64ths of the field of view the readings came from.
  };
  [[nodiscard]] Bin Sum(int first, int last) const;

  std::int64_t scans_ = 0;
  std::int64_t readings_ = 0;
  std::vector<Bin> bins_;
  std::vector<Pose2> mountings_;  // Every stride-th message's T_robot_laser.
  std::int64_t stride_ = 1;
};

}  // namespace cairn
