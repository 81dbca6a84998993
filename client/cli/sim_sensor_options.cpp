#include "client/cli/sim_sensor_options.h"

#include <cmath>
#include <vector>

#include "client/cli/option_checks.h"
#include "client/sim/laser_models.h"

namespace cairn::client {
namespace {

std::shared_ptr<std::string> AddLaser(CLI::App& command, sim::LaserOptions& laser) {
  auto model = std::make_shared<std::string>();
  auto* named = command.add_option("--laser-model", *model, "Field of view, resolution, range and error of a scanner")
                    ->check(CLI::IsMember(sim::LaserModelNames()));
  command.add_option("--beams", laser.beams, "Beams of a scan")
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
  command.add_option("--noise", laser.noise_m, "Standard deviation of a range, where --error is sigma")
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
              if (names[i] == name) laser.error = static_cast<sim::RangeErrorKind>(i);
          },
          "How the range error is stated [sigma]")
      ->check(CLI::IsMember(std::vector<std::string>(names.begin(), names.end())))
      ->excludes(named);
  command.add_option("--error-bound", laser.bound_m, "percent, step: ranges are off by at most this, and")
      ->check(InRange(0.0, 10.0))
      ->type_name("METRES")
      ->capture_default_str()
      ->excludes(named);
  command
      .add_option("--error-share", laser.bound_share, "... this share of the range (step: instead, beyond the step)")
      ->check(InRange(0.0, 1.0))
      ->capture_default_str()
      ->excludes(named);
  command.add_option("--error-step", laser.step_m, "step: up to here the bound holds, beyond it the share")
      ->check(InRange(0.0, 1000.0))
      ->type_name("METRES")
      ->capture_default_str()
      ->excludes(named);
  command.add_option("--sweep", laser.sweep_s, "From a scan's first beam to its last")
      ->check(InRange(0.0, 1.0))
      ->type_name("SECONDS")
      ->capture_default_str();
  command.add_option("--laser-height", laser.height_m, "Of the scanner above the floor")
      ->check(InRange(0.0, 100.0))
      ->type_name("METRES")
      ->capture_default_str();
  return model;
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
                      "Now and then tilt the scanner: FROM,TO,SCANS, degrees, positive down, e.g. --nod=-60,45,36")
                  ->delimiter(',')
                  ->expected(3)
                  ->type_name("DEG,DEG,N");
  command.add_option("--nod-every", tilt.level_scans, "Level scans between nods")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str()
      ->needs(nod);
  command.add_flag("!--nod-driving", tilt.halt, "Drive on while nodding, instead of halting")->needs(nod);
}

}  // namespace

std::shared_ptr<std::string> AddSensorOptions(CLI::App& command, sim::FleetOptions& fleet) {
  auto model = AddLaser(command, fleet.laser);
  AddTilt(command, fleet.tilt);
  command.add_option("--hz", fleet.scan_hz, "Scans a second")->check(InRange(0.1, 200.0))->capture_default_str();
  command.add_option("--odometry-hz", fleet.odometry_hz, "Odometry samples a second")
      ->check(InRange(0.1, 500.0))
      ->capture_default_str();
  command.add_option("--slip", fleet.wheels.slip_m_per_sqrt_m, "Random wheel error after 1 m")
      ->check(InRange(0.0, 0.2))
      ->type_name("METRES")
      ->capture_default_str();
  command.add_option("--wheel-spread", fleet.wheel_spread.wheel_share, "Systematic wheel size error, share")
      ->check(InRange(0.0, 0.1))
      ->capture_default_str();
  command.add_option("--speed", fleet.drive.speed_m_s, "How fast robots drive")
      ->check(InRange(0.05, 5.0))
      ->type_name("M/S")
      ->capture_default_str();
  return model;
}

}  // namespace cairn::client
