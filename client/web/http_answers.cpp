#include "client/web/http_answers.h"

#include <algorithm>
#include <utility>

#include "client/web/page_files.h"
#include "common/service/names.h"

namespace cairn::web {
namespace {

int HttpStatusOf(StatusCode code) {
  switch (code) {
    case StatusCode::kNotFound:
      return 404;
    case StatusCode::kInvalidArgument:
    case StatusCode::kOutOfRange:
      return 400;
    case StatusCode::kPermissionDenied:
      return 403;
    case StatusCode::kAlreadyExists:
    case StatusCode::kFailedPrecondition:
      return 409;
    case StatusCode::kDeadlineExceeded:
      return 504;
    case StatusCode::kUnavailable:
    case StatusCode::kResourceExhausted:
      return 503;
    default:
      return 500;
  }
}

std::string TypeOf(std::string_view name) {
  const auto ends = [&](std::string_view end) {
    return name.size() >= end.size() && name.substr(name.size() - end.size()) == end;
  };
  if (ends(".html")) return "text/html; charset=utf-8";
  if (ends(".css")) return "text/css; charset=utf-8";
  if (ends(".js")) return "application/javascript";
  if (ends(".svg")) return "image/svg+xml";
  return "application/octet-stream";
}

}  // namespace

HttpResponse JsonAnswer(std::string body) {
  HttpResponse response;
  response.type = "application/json";
  response.body = std::move(body);
  response.headers = {{"Cache-Control", "no-store"}};
  return response;
}

HttpResponse Refused(const Status& status) {
  return HttpError(HttpStatusOf(status.code), status.message);
}

HttpResponse FileOfPage(const HttpRequest& request, std::string_view name) {
  const auto files = PageFiles();
  const auto file = std::find_if(files.begin(), files.end(), [&](const PageFile& one) { return one.name == name; });
  if (file == files.end()) return HttpError(404, "there is no such page");
  HttpResponse response;
  const std::string etag = "\"" + std::to_string(HashName(file->bytes)) + "\"";
  response.headers = {{"ETag", etag}, {"Cache-Control", "no-cache"}};
  if (request.Header("if-none-match") == etag) {
    response.status = 304;
  } else {
    response.type = TypeOf(name);
    response.body = file->bytes;
  }
  return response;
}

std::vector<std::string> SplitPath(const std::string& path) {
  std::vector<std::string> parts;
  std::size_t begin = 1;
  while (begin <= path.size()) {
    const std::size_t end = std::min(path.find('/', begin), path.size());
    parts.push_back(path.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

}  // namespace cairn::web
