#include "tests/studies/sensitivity/verdict.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cairn::studies {
namespace {

constexpr double kChange = 1.1;
constexpr double kChangeM = 0.002;
const std::string kNotAnError = "not localized";

// NaN where there is nothing to compare with; infinite where the changed run has no figure.
double RatioOf(double usual, double changed) {
  if (!(usual > 0.0)) return std::numeric_limits<double>::quiet_NaN();
  return std::isfinite(changed) ? std::max(changed, 1e-9) / usual : std::numeric_limits<double>::infinity();
}

}  // namespace

double Ratio::size() const {
  return std::abs(std::log(value));
}

void AddNoise(const Figures& usual, const Figures& other_seed, SeedNoise& noise) {
  for (std::size_t i = 0; i < usual.size() && i < other_seed.size(); ++i) {
    const Ratio ratio{RatioOf(usual[i].second, other_seed[i].second), {}};
    if (!std::isnan(ratio.value)) noise[usual[i].first] = std::max(noise[usual[i].first], ratio.size());
  }
}

void AddEffect(const std::string& group, const std::string& log, const Figures& usual, const Figures& changed,
               const SeedNoise& noise, Effect& effect) {
  for (std::size_t i = 0; i < usual.size() && i < changed.size(); ++i) {
    const auto& [name, before] = usual[i];
    const double after = changed[i].second;
    const Ratio ratio{RatioOf(before, after), log + ", " + name};
    if (name == kNotAnError || std::isnan(ratio.value)) continue;
    Ratio& farthest = effect.groups[group];
    if (farthest.where.empty() || ratio.size() > farthest.size()) farthest = ratio;
    const auto seed = noise.find(name);
    const double at_most = std::max(std::log(kChange), seed == noise.end() ? 0.0 : seed->second);
    if (ratio.size() <= at_most || std::abs(after - before) < kChangeM) continue;
    if (!effect.matters || ratio.size() > effect.largest.size()) effect.largest = ratio;
    effect.matters = true;
  }
}

}  // namespace cairn::studies
