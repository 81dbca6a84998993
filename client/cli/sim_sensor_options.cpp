#include "client/cli/sim_sensor_options.h"

#include <cmath>
#include <vector>

#include "client/cli/option_checks.h"
#include "client/sim/laser.h"

namespace cairn::client {
namespace {

void AddLaser(CLI::App& command, sim::LaserOptions& laser, std::string& model) {
  auto* named = command.add_option("--laser-model", model, "Field of view, resolution, range and error of a scanner")
                    ->check(CLI::IsMember(sim::LaserModelNames()));
  command.add_option("--beams", laser.beams, "Number of beams in a scan")
      ->check(CLI::Range(1, kMaxBeams))
      ->capture_default_str()
      ->excludes(named);
  command
      .add_option_function<double>(
          "--fov", [&laser](double degrees) { laser.field_of_view_rad = Radians(degrees); }, "Field of view [270]")
      ->check(InRange(1.0, 360.0))
      ->type_name("DEGREES")
      ->excludes(named);
  command.add_option("--range", laser.range_max_m, "How far the scanner sees")
      ->check(InRange(0.5, 1000.0))
      ->type_name("METRES")
      ->capture_default_str()
      ->excludes(named);
  command.add_option("--noise", laser.error.sigma_m, "Standard deviation of a range, where --error is sigma")
      ->check(InRange(0.0, 1.0))
      ->type_name("METRES")
      ->capture_default_str()
      ->excludes(named);
  const auto names = sim::RangeErrorNames();
  command
      .add_option_function<std::string>(
          "--error",
          [&laser, names](const std::string& name) {
            for (std::size_t i = 0; i < names.size(); ++i)
              if (names[i] == name) laser.error.kind = static_cast<sim::RangeErrorKind>(i);
          },
          "How the range error is stated [sigma]")
      ->check(CLI::IsMember(std::vector<std::string>(names.begin(), names.end())))
      ->excludes(named);
  command.add_option("--error-bound", laser.error.bound_m, "percent and step: largest error of a range")
      ->check(InRange(0.0, 10.0))
      ->type_name("METRES")
      ->capture_default_str()
      ->excludes(named);
  command
      .add_option("--error-share", laser.error.bound_share,
                  "percent: this share of the range is added to the bound; step: beyond --error-step it replaces it")
      ->check(InRange(0.0, 1.0))
      ->capture_default_str()
      ->excludes(named);
  command
      .add_option("--error-step", laser.error.step_m,
                  "step: up to this range --error-bound holds, beyond it --error-share")
      ->check(InRange(0.0, 1000.0))
      ->type_name("METRES")
      ->capture_default_str()
      ->excludes(named);
  command.add_option("--sweep", laser.sweep_s, "Time from a scan's first beam to its last")
      ->check(InRange(0.0, 1.0))
      ->type_name("SECONDS")
      ->capture_default_str();
  command.add_option("--laser-height", laser.height_m, "Height of the scanner above the floor")
      ->check(InRange(0.0, 100.0))
      ->type_name("METRES")
      ->capture_default_str();
}

void AddTilt(CLI::App& command, sim::TiltOptions& tilt) {
  auto* nod = command
                  .add_option_function<std::vector<double>>(
                      "--nod",
                      [&tilt](const std::vector<double>& values) {
                        if (!(std::abs(values[0]) < 90.0 && std::abs(values[1]) < 90.0))
                          throw CLI::ValidationError("--nod", "tilts must be within +-90 degrees");
                        if (!(values[2] >= 1.0 && values[2] <= 10000.0 && values[2] == std::floor(values[2])))
                          throw CLI::ValidationError("--nod", "SCANS must be 1..10000");
                        tilt.first_rad = Radians(values[0]);
                        tilt.last_rad = Radians(values[1]);
                        tilt.scans = static_cast<int>(values[2]);
                      },
                      "Tilt the scanner from time to time: first and last tilt in degrees (positive is downwards) and "
                      "the number of scans, e.g. --nod=-60,45,36")
                  ->delimiter(',')
                  ->expected(3)
                  ->type_name("DEG,DEG,N");
  command.add_option("--nod-every", tilt.level_scans, "Number of level scans between two nods")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str()
      ->needs(nod);
  command.add_flag("!--nod-driving", tilt.halt, "Drive on while nodding, instead of halting")->needs(nod);
}

}  // namespace

void AddSensorOptions(CLI::App& command, sim::FleetOptions& fleet, std::string& laser_model) {
  AddLaser(command, fleet.laser, laser_model);
  AddTilt(command, fleet.tilt);
  command.add_option("--hz", fleet.scan_hz, "Scans per second")->check(InRange(0.1, 200.0))->capture_default_str();
  command.add_option("--odometry-hz", fleet.odometry_hz, "Odometry samples per second")
      ->check(InRange(0.1, 500.0))
      ->capture_default_str();
  command
      .add_option("--slip", fleet.wheels.slip_m_per_sqrt_m, "Standard deviation of the random wheel error after 1 m")
      ->check(InRange(0.0, 0.2))
      ->type_name("METRES")
      ->capture_default_str();
  command
      .add_option("--wheel-spread", fleet.wheel_spread.wheel_share,
                  "Standard deviation of the systematic wheel size error, as a share")
      ->check(InRange(0.0, 0.1))
      ->capture_default_str();
  command.add_option("--speed", fleet.drive.speed_m_s, "How fast robots drive")
      ->check(InRange(0.05, 5.0))
      ->type_name("M/S")
      ->capture_default_str();
}

}  // namespace cairn::client
