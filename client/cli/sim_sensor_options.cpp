#include <cmath>
#include <vector>

#include "client/cli/option_checks.h"
#include "client/cli/sim_run.h"
#include "client/sim/laser_models.h"

namespace cairn::client {
namespace {

void AddLaser(CLI::App& command, sim::FleetOptions& fleet) {
  sim::LaserOptions& laser = fleet.laser;
  // It is defined first, so that the other options count after it in whatever order they are given.
  auto* named = command
                    .add_option_function<std::string>(
                        "--laser-model",
                        [&fleet](const std::string& name) {
                          const auto model = sim::WithModel(fleet.laser, name);
                          if (!model) throw CLI::ValidationError("--laser-model", model.error().message);
                          fleet.laser = model->laser;
                          if (model->scan_hz > 0.0) fleet.scan_hz = model->scan_hz;
                        },
                        "Field of view, resolution, range and error of a scanner, and of lidars of today scan rate, "
                        "time and sense of a turn")
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
  AddNumber(command, "--range", laser.range_max_m, 0.5, 1000.0, "How far the scanner sees", "METRES")->excludes(named);
  AddNumber(command, "--noise", laser.error.sigma_m, 0.0, 1.0, "Standard deviation of a range, where --error is sigma",
            "METRES")
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
  AddNumber(command, "--error-bound", laser.error.bound_m, 0.0, 10.0, "percent and step: largest error of a range",
            "METRES")
      ->excludes(named);
  AddNumber(command, "--error-share", laser.error.bound_share, 0.0, 1.0,
            "percent: this share of the range is added to the bound; step: beyond --error-step it replaces it")
      ->excludes(named);
  AddNumber(command, "--error-step", laser.error.step_m, 0.0, 1000.0,
            "step: up to this range --error-bound holds, beyond it --error-share", "METRES")
      ->excludes(named);
  AddNumber(command, "--sweep", laser.sweep_s, 0.0, 1.0, "Time from a scan's first beam to its last", "SECONDS");
  command.add_flag("--laser-clockwise", laser.clockwise, "The lidar turns clockwise, seen from above")->excludes(named);
  AddNumber(command, "--range-bias", laser.error.bias_m, -1.0, 1.0, "Every range is too long by this", "METRES");
  AddNumber(command, "--range-scale", laser.error.bias_share, -0.5, 0.5, "Every range is too long by this share");
  AddNumber(command, "--range-step", laser.error.quantum_m, 0.0, 1.0, "Ranges are multiples of this; 0: any range",
            "METRES")
      ->excludes(named);
  AddNumber(command, "--dropouts", laser.dropout_share, 0.0, 1.0, "Share of the beams that say nothing")
      ->excludes(named);
  AddNumber(command, "--laser-height", laser.height_m, 0.0, 100.0, "Height of the scanner above the floor", "METRES");
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

void AddSensorOptions(CLI::App& command, sim::FleetOptions& fleet) {
  AddLaser(command, fleet);
  AddTilt(command, fleet.tilt);
  AddNumber(command, "--hz", fleet.scan_hz, 0.1, 200.0, "Scans per second");
  AddNumber(command, "--odometry-hz", fleet.odometry_hz, 0.0, 500.0,
            "Odometry samples per second; 0: the robots send none");
  AddNumber(command, "--slip", fleet.wheels.slip_m_per_sqrt_m, 0.0, 0.2,
            "Standard deviation of the random wheel error after 1 m", "METRES");
  AddNumber(command, "--wheel-spread", fleet.wheel_spread.wheel_share, 0.0, 0.1,
            "Standard deviation of the systematic wheel size error, as a share");
  AddNumber(command, "--speed", fleet.drive.speed_m_s, 0.05, 5.0, "How fast robots drive", "M/S");
}

}  // namespace cairn::client
