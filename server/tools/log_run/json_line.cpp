#include "server/tools/log_run/json_line.h"

namespace cairn::server {

std::string JsonLine(const Json& object) {
  return object.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
}

std::string ErrorJson(const Status& status) {
  return JsonLine({{"error", {{"code", StatusCodeName(status.code)}, {"message", status.message}}}});
}

}  // namespace cairn::server
