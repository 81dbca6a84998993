#include "common/service/request.h"

#include <array>

namespace cairn {

std::string_view RequestKindName(RequestKind kind) {
  static constexpr std::array<std::string_view, kRequestKindCount> kNames = {
      "ping",       "pose",       "path",      "tiles",      "landmarks",  "map_info",
      "status",     "job_submit", "job_get",   "job_cancel", "job_list",   "session_end",
      "map_enable", "saved_list", "site_save", "site_load",  "site_delete"};
  const auto index = static_cast<std::size_t>(kind);
  return index < kNames.size() ? kNames[index] : "unknown";
}

}  // namespace cairn
