// What a test or a study cannot do without: the value of a result, or std::runtime_error with what is wrong.
#pragma once

#include <stdexcept>
#include <utility>

#include "common/status.h"

namespace cairn::test {

inline void Must(const Result<void>& result) {
  if (!result) throw std::runtime_error(result.error().message);
}

template <typename T>
T Must(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(*result);
}

}  // namespace cairn::test
