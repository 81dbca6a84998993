// The little JSON that reports are written in: numbers that are none become null, texts are quoted and escaped. A
// failure is the object that `cairn --json` prints.
#pragma once

#include <cmath>
#include <cstdio>
#include <string>
#include <string_view>

#include "common/status.h"

namespace cairn::server {

[[nodiscard]] inline std::string JsonNumber(double value) {
  if (!std::isfinite(value)) return "null";
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

[[nodiscard]] inline std::string JsonText(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const bool printable = static_cast<unsigned char>(c) >= 0x20 && static_cast<unsigned char>(c) < 0x7f;
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += printable ? c : '?';
  }
  return quoted + '"';
}

[[nodiscard]] inline std::string ErrorJson(const Status& status) {
  return "{\"error\":{\"code\":" + JsonText(StatusCodeName(status.code)) + ",\"message\":" + JsonText(status.message) +
         "}}\n";
}

}  // namespace cairn::server
