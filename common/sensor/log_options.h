// The options of programs that read a log: what the file itself does not say. One list for all programs.
#pragma once

#include <string>

#include "common/options/number_text.h"
#include "common/sensor/log_reader.h"
#include "common/service/start_pose.h"

namespace cairn {

// Adds the options to a command of CLI11 (`Command` is CLI::App; this room does not know the library). `options` must
// outlive the command.
template <typename Command>
void AddLogOptions(Command& command, LogReaderOptions& options) {
  // The message of CLI11 for a text that is refused; it is empty for a good one.
  const auto at_least = [](double least, bool itself) {
    return [=](const std::string& text) {
      double value = 0.0;
      const bool good = ParseNumber(text, value) && (itself ? value >= least : value > least) && value < 1e9;
      return good ? std::string() : "'" + text + "' is not a number " + (itself ? "from 0 on" : "above 0");
    };
  };
  command
      .add_option("--no-return", options.no_return_m,
                  "A range of this length or more hit nothing; 0: find the limit from the log")
      ->check(at_least(0.0, true))
      ->type_name("METRES");
  command
      .add_option("--laser-forward", options.dpslam_laser_forward_m,
                  "DP-SLAM logs: distance of the laser ahead of the pivot")
      ->type_name("METRES")
      ->capture_default_str();
  command
      .add_option("--dpslam-period", options.dpslam_scan_period_s,
                  "DP-SLAM logs, which have no stamps: time between two scans")
      ->check(at_least(0.0, false))
      ->type_name("SECONDS")
      ->capture_default_str();
  command
      .template add_option_function<std::string>(
          "--laser-at",
          [&options](const std::string& text) {
            if (const auto pose = ParseStart(text)) options.T_robot_laser = *pose;
          },
          "Where the laser is mounted, as seen from the robot (m; rad, or 45deg); without this as the log says")
      ->check([](const std::string& text) {
        const auto pose = ParseStart(text);
        return pose ? std::string() : pose.error().message;
      })
      ->type_name("X,Y,THETA");
  command
      .add_option("--scan-topic", options.scan_topic,
                  "Bags and recordings: the topic of the laser scans, where there are several; with commas, of several "
                  "lidars")
      ->type_name("TOPIC");
  command
      .add_option(
          "--odom-topic", options.odometry_topic,
          "Bags and recordings: the topic of the odometry, where there are several; one of transforms (/tf) will do")
      ->type_name("TOPIC");
  const auto timing = [&](const std::string& name, const std::string& help, const std::string& type) {
    command
        .template add_option_function<std::string>(
            "--" + name,
            [&options, name](const std::string& text) { (void)SetLidarTiming(options.timing, name, text); }, help)
        ->check([name](const std::string& text) {
          LidarTiming trial;
          const auto set = SetLidarTiming(trial, name, text);
          return set ? std::string() : set.error().message;
        })
        ->type_name(type);
  };
  timing("scan-period",
         "Time of a full turn of the lidar, where the beams were measured one after the other; 0: all at once",
         "SECONDS");
  timing(
      "stamp-at",
      "When the stamp of a scan was taken: at its first, middle or last beam. This and the next two count only where "
      "--scan-period or the log says how long a turn takes",
      "first|middle|last");
  command.add_flag_function(
      "--clockwise,!--counter-clockwise", [&options](auto count) { options.timing.clockwise = count > 0; },
      "How the lidar turned, seen from above; without this, in the order of the logged beams");
  timing("turn-from", "Where the lidar begins its turn, which may be within the logged beams; 0 is straight ahead",
         "DEGREES");
}

}  // namespace cairn
