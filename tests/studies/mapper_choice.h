// Estimator options from assignments as `cairn-offline --set` takes them ("slam.filter=none"), so that a
// study can name a matcher or filter that this build may not have and say so.
#pragma once

#include <string>
#include <vector>

#include "server/slam/mapper_options.h"
#include "tests/studies/study.h"

namespace cairn::studies {

// The defaults, changed by these assignments, with the seed of the study.
[[nodiscard]] Result<slam::MapperOptions> MapperWith(const std::vector<std::string>& assignments, std::uint64_t seed);

// The choices of an option of `slam`, e.g. "slam.filter" or "slam.matcher", in their order; none where there
// is no such option.
[[nodiscard]] std::vector<std::string> ChoicesOf(const std::string& key);

}  // namespace cairn::studies
