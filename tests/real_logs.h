// The published robot logs in tests (real_log_path.h says where they are): a test that needs one says
// CAIRN_NEED_LOG(path, "intel.clf") and is skipped with a reason without it.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/real_log_path.h"

#define CAIRN_NEED_LOG(variable, name)                                                              \
  const std::filesystem::path variable = ::cairn::RealLog(name);                                    \
  if (!std::filesystem::exists(variable)) {                                                         \
    GTEST_SKIP() << "SKIPPED: " << variable << " is not there; set CAIRN_DATA to the logs' folder"; \
  }                                                                                                 \
  static_assert(true)
