// The lines that the server's log writes on standard error while a CapturedLog lives. Only one at a time.
#pragma once

#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "server/ops/logging.h"

namespace cairn::server::testing {

class CapturedLog {
 public:
  CapturedLog(LogLevel level, LogFormat format) {
    ::testing::internal::CaptureStderr();
    StartLogging(level, format);
  }
  ~CapturedLog() {
    if (!taken_) Take();
  }
  CapturedLog(const CapturedLog&) = delete;
  CapturedLog& operator=(const CapturedLog&) = delete;

  // Ends the capture. REQUIRES: no other thread logs any more.
  std::vector<std::string> Take() {
    taken_ = true;
    spdlog::set_default_logger(before_);
    std::vector<std::string> lines;
    std::istringstream text(::testing::internal::GetCapturedStderr());
    for (std::string line; std::getline(text, line);) lines.push_back(std::move(line));
    return lines;
  }
  // The same for JSON. A line that is no object fails the test.
  std::vector<nlohmann::json> TakeObjects() {
    std::vector<nlohmann::json> objects;
    for (const std::string& line : Take()) {
      auto object = nlohmann::json::parse(line, nullptr, false);
      EXPECT_TRUE(object.is_object()) << line;
      if (object.is_object()) objects.push_back(std::move(object));
    }
    return objects;
  }

 private:
  const std::shared_ptr<spdlog::logger> before_ = spdlog::default_logger();
  bool taken_ = false;
};

}  // namespace cairn::server::testing
