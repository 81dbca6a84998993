// What a constant's halving and doubling did to the figures of all drives, against what another seed does.
// Stateless.
#pragma once

#include <array>
#include <map>
#include <string>

#include "tests/studies/sensitivity/cases.h"

namespace cairn::studies {

// A figure as a multiple of the default's; above 1 is worse.
struct Ratio {
  double value = 1.0;
  std::string where;                  // Log and figure.
  [[nodiscard]] double size() const;  // Of its logarithm: how far from 1, either way.
};

struct Effect {
  std::map<std::string, Ratio> groups;  // By group, the ratio farthest from 1.
  Ratio largest;                        // Of those beyond 10 %, 2 mm and what another seed does.
  bool matters = false;
};

// By figure: how far from 1 other seeds bring it (size of the ratio).
using SeedNoise = std::map<std::string, double>;

// Takes the larger noise of those so far and of this run with another seed.
void AddNoise(const Figures& usual, const Figures& other_seed, SeedNoise& noise);

// Adds what one changed run shows.
void AddEffect(const std::string& group, const std::string& log, const Figures& usual, const Figures& changed,
               const SeedNoise& noise, Effect& effect);

}  // namespace cairn::studies
