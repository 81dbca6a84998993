#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "client/web/fragment_picture.h"
#include "client/web/http_answers.h"
#include "client/web/web_page.h"
#include "common/service/names.h"

namespace cairn::web {
namespace {

// The map of the site in which the robot is; null where the server knows of no such robot or map.
const MapInfo* MapOfRobot(const ServerView& view, const std::string& robot) {
  const auto& robots = view.status.robots;
  const auto found =
      std::find_if(robots.begin(), robots.end(), [&](const RobotStatus& one) { return one.session.robot == robot; });
  return found == robots.end() ? nullptr : view.Map(found->session.site);
}

}  // namespace

// The area comes in a header, as that of the disagreement does. Both are kept as one text, which the tag is of.
HttpResponse WebPage::FragmentMap(const HttpRequest& request, const std::string& robot) {
  if (!ValidateName("robot", robot)) return HttpError(404, "the server has no such robot");
  const auto view = watch_->view();
  const MapInfo* const map = MapOfRobot(*view, robot);
  if (map == nullptr) return HttpError(404, "the server has no such robot, or its site has no map");
  const Theme theme = request.Query("theme") == "dark" ? Theme::kDark : Theme::kLight;
  const std::string question = robot + (theme == Theme::kDark ? " dark" : " light");
  const auto text = fragments_.Get(question, [&]() -> Result<std::string> {
    if (!view->connected) return Fail(StatusCode::kUnavailable, "the server does not answer");
    const auto ask = [&](std::uint32_t level) { return queries_->RobotTiles(robot, level); };
    return DrawFragment(ask, map->resolution_m, theme).map([](const FragmentPicture& picture) {
      return fmt::format("{} {} {} {}\n", picture.x_min, picture.y_min, picture.x_max, picture.y_max) + picture.png;
    });
  });
  if (!text) return Refused(text.error());
  HttpResponse response;
  const std::size_t end = (*text)->find('\n');
  const std::string etag = "\"" + std::to_string(HashName(**text)) + "\"";
  response.headers = {{"ETag", etag}, {"X-Map-Area", (*text)->substr(0, end)}, {"Cache-Control", "no-cache"}};
  if (request.Header("if-none-match") == etag) {
    response.status = 304;
    return response;
  }
  response.type = "image/png";
  response.body = (*text)->substr(end + 1);
  return response;
}

}  // namespace cairn::web
