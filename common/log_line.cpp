#include "common/log_line.h"

#include <cstddef>
#include <cstdio>
#include <ctime>

#include "common/code_points.h"

namespace cairn {
namespace {

void AppendEscaped(std::string& line, std::string_view text, LogFormat format) {
  while (!text.empty()) {
    const CodePoint next = FirstCodePoint(text);
    if (next.bytes == 0) {
      line += "\xef\xbf\xbd";
      text.remove_prefix(1);
      continue;
    }
    if (next.value == '\n') {
      line += "\\n";
    } else if (IsControl(next.value)) {
      std::array<char, 8> escape{};
      std::snprintf(escape.data(), escape.size(), "\\u%04x", next.value & 0xffffU);
      line += escape.data();
    } else {
      if (format == LogFormat::kJson && (next.value == '"' || next.value == '\\')) line += '\\';
      line += text.substr(0, next.bytes);
    }
    text.remove_prefix(next.bytes);
  }
}

void AppendMember(std::string& line, std::string_view name, std::string_view value) {
  line += line.empty() ? "{\"" : ",\"";
  line += name;
  line += "\":\"";
  AppendEscaped(line, value, LogFormat::kJson);
  line += '"';
}

// RFC 3339, UTC.
std::string TimeText(std::chrono::system_clock::time_point time) {
  const auto second = std::chrono::floor<std::chrono::seconds>(time);
  const auto milliseconds = std::chrono::duration_cast<std::chrono::milliseconds>(time - second).count();
  const std::time_t since_1970 = std::chrono::system_clock::to_time_t(second);
  std::tm utc{};
  gmtime_r(&since_1970, &utc);
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", utc.tm_year + 1900, utc.tm_mon + 1,
                utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec, static_cast<int>(milliseconds));
  return text.data();
}

}  // namespace

std::string LogLine(LogFormat format, std::chrono::system_clock::time_point time, std::string_view level,
                    std::string_view message, const LogSubject& fields) {
  std::string line;
  if (format == LogFormat::kText) {
    line = TimeText(time) + ' ';
    line += level;
    line += ' ';
    AppendEscaped(line, message, format);
    if (!fields.request.empty()) line += " request=" + fields.request;
    return line;
  }
  AppendMember(line, "time", TimeText(time));
  AppendMember(line, "level", level);
  AppendMember(line, "message", message);
  if (!fields.request.empty()) AppendMember(line, "request", fields.request);
  if (!fields.client.empty()) AppendMember(line, "client", fields.client);
  if (!fields.robot.empty()) AppendMember(line, "robot", fields.robot);
  if (!fields.site.empty()) AppendMember(line, "site", fields.site);
  if (fields.job != 0) line += ",\"job\":" + std::to_string(fields.job);
  return line + '}';
}

}  // namespace cairn
