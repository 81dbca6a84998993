#include "common/service/request.h"

#include <array>

namespace cairn {

std::string_view RequestKindName(RequestKind kind) {
  static constexpr std::array<std::string_view, kRequestKindCount> kNames = {
      "ping",       "pose",       "path",      "tiles",      "landmarks",    "map_info",
      "status",     "job_submit", "job_get",   "job_cancel", "job_list",     "session_end",
      "map_enable", "saved_list", "site_save", "site_load",  "site_delete",  "ros2",
      "relocalise", "localise",   "map",       "map_edits",  "map_edit_add", "map_edit_remove"};
  const auto index = static_cast<std::size_t>(kind);
  return index < kNames.size() ? kNames[index] : "unknown";
}

bool IsCommand(RequestKind kind) {
  switch (kind) {
    case RequestKind::kJobSubmit:
    case RequestKind::kJobCancel:
    case RequestKind::kSessionEnd:
    case RequestKind::kMapEnable:
    case RequestKind::kSiteSave:
    case RequestKind::kSiteLoad:
    case RequestKind::kSiteDelete:
    case RequestKind::kRelocalise:
    case RequestKind::kLocalise:
    case RequestKind::kMap:
    case RequestKind::kMapEditAdd:
    case RequestKind::kMapEditRemove:
      return true;
    case RequestKind::kPing:
    case RequestKind::kPose:
    case RequestKind::kPath:
    case RequestKind::kTiles:
    case RequestKind::kLandmarks:
    case RequestKind::kMapInfo:
    case RequestKind::kStatus:
    case RequestKind::kJobGet:
    case RequestKind::kJobList:
    case RequestKind::kSavedList:
    case RequestKind::kRos2:
    case RequestKind::kMapEdits:
      break;
  }
  return false;
}

}  // namespace cairn
