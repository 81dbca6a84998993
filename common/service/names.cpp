#include "common/service/names.h"

#include <algorithm>
#include <string>

namespace cairn {
namespace {

// Not std::isalnum: its answer depends on the locale.
bool IsNameCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-';
}

}  // namespace

Result<void> ValidateName(std::string_view what, std::string_view name) {
  constexpr std::size_t kLongest = 64;
  const auto refuse = [&](const std::string& why) {
    std::string shown;
    for (const char c : name.substr(0, kLongest)) shown += c >= ' ' && c <= '~' ? c : '?';
    return Fail(StatusCode::kInvalidArgument, std::string(what) + " name '" + shown + "' " + why);
  };
  if (name.empty()) return refuse("is empty");
  if (name.size() > kLongest) return refuse("is longer than 64 characters");
  if (!std::all_of(name.begin(), name.end(), IsNameCharacter)) return refuse("may hold only A-Z a-z 0-9 . _ -");
  if (name.front() == '.' || name.front() == '-') return refuse("must not start with '.' or '-'");
  return {};
}

}  // namespace cairn
