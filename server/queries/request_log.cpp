#include "server/queries/request_log.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <string>

#include "common/service/request_id.h"
#include "server/ops/log_context.h"

namespace cairn::server {
namespace {

// Only what the request names.
std::string ObjectsOf(const Request& request) {
  std::string objects;
  const auto add = [&objects](const std::string& object) { objects += (objects.empty() ? " (" : ", ") + object; };
  if (!request.robot.empty()) add("robot '" + request.robot + "'");
  if (!request.site.empty()) add("site '" + request.site + "'");
  if (!request.saved.empty()) add("file '" + request.saved + "'");
  if (request.job != 0) add("job " + std::to_string(request.job));
  if (request.kind == RequestKind::kMapEnable) add("version " + std::to_string(request.map_version));
  if (request.kind == RequestKind::kMapEditRemove) add("edit " + std::to_string(request.edit.id));
  return objects.empty() ? objects : objects + ")";
}

void LogRequest(spdlog::level::level_enum level, const Request& request, const Status& status) {
  if (!spdlog::should_log(level)) return;
  try {
    const LogContext context(FieldsOf(request));
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - request.received;
    spdlog::log(level, "{} {}{} of client {}: {}{} after {:.1f} ms", IsCommand(request.kind) ? "command" : "question",
                RequestKindName(request.kind), ObjectsOf(request), ShortClientId(request.client),
                StatusCodeName(status.code), status.ok() ? "" : ", " + status.message, took.count());
  } catch (const std::exception&) {
    // Memory is short. The answer counts more than its line.
  }
}

}  // namespace

LogSubject FieldsOf(const Request& request) {
  LogSubject fields;
  fields.request = RequestId(request.client, request.sequence);
  fields.client = ShortClientId(request.client);
  fields.robot = request.robot;
  fields.site = request.site;
  fields.job = request.job;
  return fields;
}

void LogAnswered(const Request& request, const Status& status) {
  LogRequest(IsCommand(request.kind) ? spdlog::level::info : spdlog::level::debug, request, status);
}

void LogRefused(const Request& request, const Status& status) {
  LogRequest(spdlog::level::debug, request, status);
}

}  // namespace cairn::server
