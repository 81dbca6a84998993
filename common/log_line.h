// One line of a program's log, as text for people or as a JSON object for programs that collect logs. Names and
// messages may come from strangers. Therefore nothing in them can begin another line or end a JSON string: control
// characters become escape sequences (\n, \u001b), and bytes that are not UTF-8 become U+FFFD. Pure function,
// thread-safe.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

namespace cairn {

enum class LogFormat { kText = 0, kJson };
inline constexpr std::array<std::string_view, 2> kLogFormats = {"text", "json"};

// What a line is about. What is empty, or 0, is not known and left out.
struct LogSubject {
  std::string request;  // RequestId.
  std::string client;   // ShortClientId.
  std::string robot;
  std::string site;
  std::uint64_t job = 0;
};

// The line without a line break at its end.
// Text: 2025-01-31T12:00:00.123Z info the message request=1a2b3c4d-7
// JSON: {"time":"2025-01-31T12:00:00.123Z","level":"info","message":"the message","request":"1a2b3c4d-7",
//        "client":"1a2b3c4d","robot":"r1","site":"hall","job":7}
// Text leaves out the other fields, because the messages name them.
[[nodiscard]] std::string LogLine(LogFormat format, std::chrono::system_clock::time_point time, std::string_view level,
                                  std::string_view message, const LogSubject& fields = {});

}  // namespace cairn
