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
};

constexpr RangeError Sigma(double sigma_m) {
  return {RangeErrorKind::kSigma, sigma_m, 0.0, 0.0, 0.0, 0.0};
}
constexpr RangeError Fixed(double bound_m) {
  return {RangeErrorKind::kPercent, 0.0, 0.0, bound_m, 0.0, 0.0};
}
constexpr RangeError Step(double bound_m, double bound_share) {
  return {RangeErrorKind::kStep, 0.0, 0.0, bound_m, bound_share, 1.0};
}

// 240 deg at 360/1024 deg a step: 683 beams.
constexpr double kUrgView_deg = 682 * 360.0 / 1024.0;

constexpr Model kModels[] = {
    {"thesis", 181, 180.0, 0.02, 30.0, Sigma(0.015)},  // 5.1.1 simulates a standard deviation of 15 mm.
    {"lms200", 361, 180.0, 0.02, 80.0, Sigma(0.005)},
    {"lms291", 361, 180.0, 0.02, 80.0, Sigma(0.010)},
    {"lms291-s05", 361, 180.0, 0.02, 80.0, Fixed(0.010)},
    {"urg-04lx", 683, kUrgView_deg, 0.06, 4.095, Step(0.010, 0.01)},
    {"urg-04lx-ug01", 683, kUrgView_deg, 0.02, 5.6, Step(0.030, 0.03)},
};

}  // namespace

std::vector<std::string> LaserModelNames() {
  std::vector<std::string> names;
  for (const Model& model : kModels) names.emplace_back(model.name);
  return names;
}

Result<LaserOptions> WithModel(const LaserOptions& laser, const std::string& name) {
  std::string known;
  for (const Model& model : kModels) {
    if (model.name == name) {
      LaserOptions options = laser;
      options.beams = model.beams;
      options.field_of_view_rad = Radians(model.field_of_view_deg);
      options.range_min_m = model.range_min_m;
      options.range_max_m = model.range_max_m;
      SetError(model.error, &options);
      return options;
    }
    known += (known.empty() ? "" : ", ") + std::string(model.name);
  }
  return Fail(StatusCode::kNotFound, "laser model '" + name + "' is none of: " + known);
}

}  // namespace cairn::sim
