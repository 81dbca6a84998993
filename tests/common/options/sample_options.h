// A small options tree with every kind of field: for tests.
#pragma once

#include <array>
#include <string>

#include "common/options/config.h"

namespace cairn {

enum class SampleModel { kFast = 0, kExact };

struct SampleOptions {
  double length_m = 0.1;
  std::int64_t particles = 200;
  bool enabled = true;
  std::string name = "floor";
  SampleModel model = SampleModel::kFast;
  double inner_rad = 1.0 / 3.0;

  bool operator==(const SampleOptions&) const = default;
};

inline void Visit(OptionVisitor& visitor, SampleOptions& options) {
  static constexpr std::array<std::string_view, 2> kModels = {"fast", "exact"};
  visitor.Section("slam", "the estimator", [&] {
    visitor.Real("length_m", options.length_m, "m", 0.01, 10.0, "how long");
    visitor.Integer("particles", options.particles, "1", 1, 10000, "how many");
    visitor.Section("inner", "", [&] { visitor.Real("inner_rad", options.inner_rad, "rad", -4.0, 4.0, "turn"); });
    VisitEnum(visitor, "model", options.model, kModels, "which");
  });
  visitor.Flag("enabled", options.enabled, "whether");
  visitor.Text("name", options.name, "what it is called");
}

inline VisitOptions VisitorOf(SampleOptions& options) {
  return [&options](OptionVisitor& visitor) { Visit(visitor, options); };
}

}  // namespace cairn
