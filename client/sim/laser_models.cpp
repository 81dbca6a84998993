#include "client/sim/laser_models.h"

#include <string_view>

namespace cairn::sim {
namespace {

struct Model {
  std::string_view name;
  int beams;
  double field_of_view_deg;
  double range_min_m;
  double range_max_m;
  RangeError error;
  double scan_hz = 0.0;         // 0: not stated; the scan is then taken at once.
  bool clockwise = false;       // Seen from above.
  double dropout_share = -1.0;  // Below 0: not stated.
};

constexpr RangeError Sigma(double sigma_m) {
  return {RangeErrorKind::kSigma, sigma_m, 0.0, 0.0, 0.0, 0.0};
}
constexpr RangeError Fixed(double bound_m) {
  return {RangeErrorKind::kPercent, 0.0, 0.0, bound_m, 0.0, 0.0};
}
constexpr RangeError Step(double bound_m, double bound_share, double step_m = 1.0) {
  return {RangeErrorKind::kStep, 0.0, 0.0, bound_m, bound_share, step_m};
}
constexpr RangeError Steps(RangeError error, double quantum_m) {
  error.quantum_m = quantum_m;
  return error;
}

// 240 deg at 360/1024 deg a step: 683 beams.
constexpr double kUrgView_deg = 682 * 360.0 / 1024.0;

constexpr Model kModels[] = {
    // Source: thesis C 4.3.2 (the simulator's own: +-90 deg in steps of 1 deg), 4.3.3 (errors); makers' data sheets for
    // field of view, resolution and range: SICK LMS200/291, Hokuyo URG-04LX-UG01.
    {"thesis", 181, 180.0, 0.02, 30.0, Sigma(0.015)},  // 5.1.1 simulates a standard deviation of 15 mm.
    {"lms200", 361, 180.0, 0.02, 80.0, Sigma(0.005)},
    {"lms291", 361, 180.0, 0.02, 80.0, Sigma(0.010)},
    {"lms291-s05", 361, 180.0, 0.02, 80.0, Fixed(0.010)},
    {"urg-04lx-ug01", 683, kUrgView_deg, 0.02, 5.6, Step(0.030, 0.03)},

    // Lidars of today. What a sheet calls accuracy is taken as an error that all ranges of one device share
    // (RangeError::bias_m). It is named in the comments and is not part of the model. Data sheets say nothing of
    // dropouts. The shares here are of single beams without an answer between two beams that agree: 0.5 % in a log of a
    // MaeBot (RPLIDAR A1, University of Michigan), 1.1 % in one of a Neato (Olin College); other RPLIDARs have between
    // 0.3 and 6.5 %. Assumptions, which no sheet states, are named as such. Where a figure is marked `not checked`, the
    // sheet was not at hand when it was written down here.

    // Hokuyo URG-04LX, data sheet: 0.06-4.095 m, +-10 mm to 1 m, +-1 % beyond (thesis C 4.3.3 has the same), 1 mm steps
    // (not checked).
    // SCIP 2.0 specification C-42-03320B, figure 1, table 2, PP command: 239.77 deg in steps of 360/1024 deg, 600 turns
    // a minute, anti-clockwise seen from above. Assumption: the whole +-10 mm or +-1 % is random.
    {"urg-04lx", 683, kUrgView_deg, 0.06, 4.095, Steps(Step(0.010, 0.01), 0.001), 10.0},

    // SLAMTEC RPLIDAR A1M8, data sheet, "Measurement performance": 0.15-12 m, 1 deg at 5.5 turns a second (typical),
    // resolution < 0.5 mm below 1.5 m and < 1 % of the distance everywhere. The interface protocol has steps of
    // 0.25 mm (distance_q2) and angles that grow clockwise. Assumption: the random error is as large as the resolution,
    // for which the sheet has no standard deviation.
    {"rplidar-a1", 360, 360.0, 0.15, 12.0, Steps(Step(0.0005, 0.01, 1.5), 0.00025), 5.5, true, 0.005},

    // Hitachi-LG HLS-LFCD2, sold as LDS-01 (ROBOTIS e-Manual, TurtleBot3, appendix LDS-01): 0.12-3.5 m, 1 deg, 300
    // turns a minute, precision +-10 mm below 0.5 m and +-3.5 % beyond (accuracy +-15 mm, +-5 %; all not checked).
    // Distances are sent in mm. The maker's ROS driver turns the array over, so angles grow clockwise.
    {"lds-01", 360, 360.0, 0.12, 3.5, Steps(Step(0.010, 0.035, 0.5), 0.001), 5.0, true},

    // LDROBOT LD19, data sheet: 0.02-12 m, 4,500 ranges and typically 10 turns a second, standard deviation 10 mm,
    // resolution 15 mm, both from 0.3 m on (accuracy +-45 mm). Development manual: left-handed, angles grow clockwise.
    // Assumption: the resolution is the step of the ranges.
    {"ld19", 450, 360.0, 0.02, 12.0, Steps(Sigma(0.010), 0.015), 10.0, true},

    // Neato XV-11. Konolige et al. 2008, "A low-cost laser distance sensor", describes its prototype: 3 cm accuracy out
    // to 6 m, 1 deg. Steps of 1 mm, as its bytes were decoded (Xevel/NXV11). 5 turns a second as in published logs.
    // Assumptions: 0.2 m at least; the error is random and a share of the range, although that of triangulation grows
    // with the square of the range; counter-clockwise, as drivers number the beams.
    {"xv11", 360, 360.0, 0.2, 6.0, Steps({RangeErrorKind::kPercent, 0.0, 0.0, 0.0, 0.005, 0.0}, 0.001), 5.0, false,
     0.011},

    // Hokuyo UTM-30LX, specification: 0.1-30 m, 270 deg at 0.25 deg, 25 ms a turn; repeated accuracy sigma < 10 mm to
    // 10 m, < 30 mm beyond (accuracy +-30 and +-50 mm; not checked). SCIP 2.0 specification: anti-clockwise. Steps of 1
    // mm.
    {"utm-30lx", 1081, 270.0, 0.1, 30.0, Steps({RangeErrorKind::kSigma, 0.010, 0.0, 0.0, 0.0, 10.0, 0.030}, 0.001),
     40.0},

    // SICK TiM561, data sheet 8015886: statistical error (1 sigma) 20 mm, systematic +-60 mm; 0.05-10 m, 270 deg at
    // 1/3 deg. Technical information 8015883: 15 turns a second, from -45 to 225 deg. Assumptions: counter-clockwise,
    // because angles grow that way; steps of 1 mm.
    {"tim561", 811, 270.0, 0.05, 10.0, Steps(Sigma(0.020), 0.001), 15.0},
};

}  // namespace

std::vector<std::string> LaserModelNames() {
  std::vector<std::string> names;
  for (const Model& model : kModels) names.emplace_back(model.name);
  return names;
}

Result<ModelledLaser> WithModel(const LaserOptions& laser, const std::string& name) {
  std::string known;
  for (const Model& model : kModels) {
    if (model.name == name) {
      LaserOptions options = laser;
      options.beams = model.beams;
      options.field_of_view_rad = Radians(model.field_of_view_deg);
      options.range_min_m = model.range_min_m;
      options.range_max_m = model.range_max_m;
      options.error = model.error;
      options.error.bias_m = laser.error.bias_m;
      options.error.bias_share = laser.error.bias_share;
      options.clockwise = model.clockwise;
      if (model.dropout_share >= 0.0) options.dropout_share = model.dropout_share;
      if (model.scan_hz > 0.0) {
        const bool full_turn = model.field_of_view_deg == 360.0;  // The last beam comes a step before the turn's end.
        const double turned = full_turn ? 1.0 - 1.0 / model.beams : model.field_of_view_deg / 360.0;
        options.sweep_s = turned / model.scan_hz;
      }
      return ModelledLaser{options, model.scan_hz};
    }
    known += (known.empty() ? "" : ", ") + std::string(model.name);
  }
  return Fail(StatusCode::kNotFound, "laser model '" + name + "' is none of: " + known);
}

}  // namespace cairn::sim
