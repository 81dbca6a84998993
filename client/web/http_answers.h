// The forms of answer that the page's requests share. Stateless, thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/http/http_server.h"
#include "common/status.h"

namespace cairn::web {

[[nodiscard]] HttpResponse JsonAnswer(std::string body);
// The server's error, or the client library's, with the HTTP status that says the same.
[[nodiscard]] HttpResponse Refused(const Status& status);
// One of PageFiles() with its tag; 304 where the client has it already.
[[nodiscard]] HttpResponse FileOfPage(const HttpRequest& request, std::string_view name);
// The parts of a path between its slashes.
[[nodiscard]] std::vector<std::string> SplitPath(const std::string& path);

}  // namespace cairn::web
