#include "client/web/web_page.h"

#include <fmt/format.h>
#include <openssl/crypto.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "client/lib/last_request.h"
#include "client/web/http_answers.h"
#include "client/web/tile_picture.h"
#include "client/web/web_json.h"
#include "client/web/web_metrics.h"
#include "common/geometry/angle.h"
#include "common/geometry/pose2.h"
#include "common/map/occupancy_image.h"
#include "common/options/number_text.h"

namespace cairn::web {
namespace {

tl::unexpected<Status> ServerLost() {
  return Fail(StatusCode::kUnavailable, "the server does not answer");
}

// The files of a map as SaveMapYaml writes them, without a file.
Result<std::string> MapFileText(const OccupancyImage& map, const std::string& site, bool yaml) {
  MapSaveOptions options;
  if (yaml) return MapYamlText(map, site + ".png", options);
  auto image = EncodeMapImage(map, ".png", options);
  if (!image) return tl::unexpected(image.error());
  return std::string(image->begin(), image->end());
}

// Takes as long for every wrong text of the same length, so that nobody can guess a token letter by letter.
bool SameText(const std::string& a, const std::string& b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

// The body's object; nothing where it is none. An empty body is an empty object.
std::optional<nlohmann::json> Object(const std::string& body) {
  if (body.empty()) return nlohmann::json::object();
  auto json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  return json;
}

}  // namespace

Result<std::unique_ptr<WebPage>> WebPage::Create(wire::Bus& bus, const WebOptions& options) {
  std::unique_ptr<WebPage> page(new WebPage(bus, options));
  auto watch = ServerWatch::Create(bus);
  if (!watch) return tl::unexpected(watch.error());
  page->watch_ = std::move(*watch);
  auto queries = client::QueryClient::Create(bus, {.timeout_s = 5.0});
  if (!queries) return tl::unexpected(queries.error());
  page->queries_ = std::move(*queries);
  return page;
}

HttpResponse WebPage::Answer(const HttpRequest& request) {
  const auto begun = std::chrono::steady_clock::now();
  const Parts parts = SplitPath(request.path);
  const bool posted = request.method == "POST";
  client::TakeLastRequest();  // That of an earlier answer of this thread, which an exception ended.
  HttpResponse response = posted ? AnswerPost(request, parts) : AnswerGet(request, parts);
  const std::string id = client::TakeLastRequest();
  if (!id.empty()) response.headers.emplace_back("X-Request-Id", id);
  if (posted && !id.empty()) LogCommand(request, parts, id, response.status, begun);
  // Nothing from outside, no frames, no guessing of types.
  response.headers.insert(
      response.headers.end(),
      {{"Content-Security-Policy",
        "default-src 'self'; img-src 'self' data:; object-src 'none'; base-uri 'none'; frame-ancestors 'none'"},
       {"X-Content-Type-Options", "nosniff"},
       {"Referrer-Policy", "no-referrer"}});
  return response;
}

HttpResponse WebPage::AnswerGet(const HttpRequest& request, const Parts& parts) {
  if (parts.size() == 1) {
    if (parts[0] == "healthz") return {};
    if (parts[0] == "readyz") return watch_->view()->connected ? HttpResponse() : Refused(ServerLost().value());
    if (parts[0] == "metrics") return Metrics();
    return FileOfPage(request, parts[0].empty() ? "index.html" : parts[0]);
  }
  if (parts[0] != "api") return HttpError(404, "there is no such page");
  if (parts.size() == 2 && parts[1] == "events") return Events(request.Query("site"));
  if (parts.size() == 2 && parts[1] == "state") {
    const auto view = watch_->view();
    const std::string site = request.Query("site");
    if (!site.empty() && view->Sites().count(site) == 0) return HttpError(404, "the server has no such site");
    return JsonAnswer(*states_.Get(*view, site));
  }
  if (parts.size() == 2 && parts[1] == "doctor") return JsonAnswer(*states_.Doctor(*watch_->view()));
  if (parts.size() == 4 && parts[1] == "robots" && parts[3] == "path")
    return Path(parts[2], request.Query("smoothed") == "1");
  if (parts.size() == 4 && parts[1] == "robots" && parts[3] == "map.png") return FragmentMap(request, parts[2]);
  if (parts.size() >= 4 && parts[1] == "sites") return AnswerAboutSite(request, parts);
  return HttpError(404, "there is no such address");
}

HttpResponse WebPage::AnswerAboutSite(const HttpRequest& request, const Parts& parts) {
  const std::string& site = parts[2];
  if (watch_->view()->Sites().count(site) == 0) return HttpError(404, "the server has no such site");
  if (parts.size() == 7 && parts[3] == "tiles") return TileFile(request, parts);
  if (parts.size() != 4) return HttpError(404, "there is no such address");
  if (parts[3] == "landmarks") return Landmarks(site);
  if (parts[3] == "edits") return Edits(site);
  if (parts[3] == "disagreement.png") return Disagreement(site);
  if (parts[3] == "map.png" || parts[3] == "map.yaml") return MapFile(site, parts[3]);
  return HttpError(404, "there is no such address");
}

// .../tiles/LEVEL/X/Y.png
HttpResponse WebPage::TileFile(const HttpRequest& request, const Parts& parts) {
  constexpr std::string_view kEnd = ".png";
  std::string_view y = parts[6];
  TileKey key;
  if (y.size() <= kEnd.size() || y.substr(y.size() - kEnd.size()) != kEnd || !ParseNumber(parts[4], key.level) ||
      !ParseNumber(parts[5], key.x) || !ParseNumber(y.substr(0, y.size() - kEnd.size()), key.y)) {
    return HttpError(400, "a tile is LEVEL/X/Y.png");
  }
  auto map = maps_.Open(parts[2], *queries_);
  if (!map) return Refused(map.error());
  const Theme theme = request.Query("theme") == "dark" ? Theme::kDark : Theme::kLight;
  const auto picture = (*map)->Picture(key, theme, request.Header("if-none-match"));
  if (!picture) return Refused(picture.error());
  HttpResponse response;
  response.headers = {{"ETag", picture->etag}, {"Cache-Control", "no-cache"}};
  if (!picture->png) {
    response.status = 304;
    return response;
  }
  response.type = "image/png";
  response.body = *picture->png;
  return response;
}

HttpResponse WebPage::Events(const std::string& site) {
  if (!site.empty() && watch_->view()->Sites().count(site) == 0) return HttpError(404, "the server has no such site");
  std::shared_ptr<SiteMap> map;
  if (!site.empty()) {
    auto opened = maps_.Open(site, *queries_);
    if (!opened) return Refused(opened.error());
    map = std::move(*opened);
  }
  HttpResponse response;
  response.type = "text/event-stream";
  response.headers = {{"Cache-Control", "no-store"}, {"X-Accel-Buffering", "no"}};
  response.stream = [viewer = std::make_shared<Viewer>(*watch_, states_, site, std::move(map))](std::string& piece) {
    piece = viewer->NextPiece();
    return true;
  };
  return response;
}

HttpResponse WebPage::Metrics() const {
  HttpResponse response;
  response.type = "text/plain; version=0.0.4; charset=utf-8";
  response.headers = {{"Cache-Control", "no-store"}};
  response.body = MetricsText(*watch_->view());
  return response;
}

HttpResponse WebPage::Recent(const std::string& question, const AnswerCache::Ask& ask) {
  const auto answer = answers_.Get(question, [&]() -> Result<std::string> {
    if (!watch_->view()->connected) return ServerLost();
    return ask();
  });
  return answer ? JsonAnswer(**answer) : Refused(answer.error());
}

HttpResponse WebPage::Path(const std::string& robot, bool smoothed) {
  constexpr std::size_t kMostPoints = 3000;
  if (!ValidateName("robot", robot)) return HttpError(404, "the server has no such robot");
  return Recent((smoothed ? "smoothed " : "path ") + robot, [&] {
    return queries_->Path(robot, smoothed).map([](const client::PathAnswer& path) {
      return PathJson(path.poses, kMostPoints);
    });
  });
}

HttpResponse WebPage::Landmarks(const std::string& site) {
  return Recent("landmarks " + site, [&] {
    return queries_->Landmarks(site).map(
        [](const std::vector<LandmarkReport>& landmarks) { return LandmarksJson(landmarks); });
  });
}

HttpResponse WebPage::Edits(const std::string& site) {
  const auto view = watch_->view();
  const MapInfo* const map = view->Map(site);
  const std::uint64_t version = map == nullptr ? 0 : map->edits_version;
  return Recent("edits " + site + " " + std::to_string(version), [&] {
    return queries_->MapEdits(site).map([](const std::vector<MapEdit>& edits) { return EditsJson(edits); });
  });
}

namespace {

// The finest level at which the picture of the whole map stays small; nothing where none is.
std::optional<std::uint32_t> LevelOfPicture(const MapInfo& map) {
  constexpr double kMostCells = 4e6;
  double cells = (map.x_max_m - map.x_min_m) * (map.y_max_m - map.y_min_m) / (map.resolution_m * map.resolution_m);
  for (std::uint32_t level = 0; level < map.levels; ++level, cells /= 4.0) {
    if (cells <= kMostCells) return level;
  }
  return std::nullopt;
}

}  // namespace

// The area that the picture covers is in a header of its own, because that of the map may have changed meanwhile.
HttpResponse WebPage::Disagreement(const std::string& site) {
  const auto view = watch_->view();
  const MapInfo* const map = view->Map(site);
  if (map == nullptr) return HttpError(404, "the site has no map yet");
  const auto level = LevelOfPicture(*map);
  if (!level) return HttpError(413, "the map is too large for one picture");
  const auto text = pictures_.Get(site, [&]() -> Result<std::string> {
    if (!watch_->view()->connected) return ServerLost();
    const auto image = queries_->DisagreementImage(site, *level);
    if (!image && image.error().code == StatusCode::kUnavailable) return std::string();  // Nobody differs.
    if (!image) return tl::unexpected(image.error());
    const Pose2& low = image->T_map_origin;
    return DrawDisagreement(*image).map([&](const std::string& png) {
      return fmt::format("{} {} {} {}\n", low.x, low.y, low.x + image->width * image->resolution_m,
                         low.y + image->height * image->resolution_m) +
             png;
    });
  });
  if (!text) return Refused(text.error());
  HttpResponse response;
  if ((*text)->empty()) {
    response.status = 204;
    return response;
  }
  const std::size_t end = (*text)->find('\n');
  response.type = "image/png";
  response.body = (*text)->substr(end + 1);
  response.headers = {{"X-Map-Area", (*text)->substr(0, end)}, {"Cache-Control", "no-store"}};
  return response;
}

HttpResponse WebPage::MapFile(const std::string& site, const std::string& name) {
  const bool yaml = name == "map.yaml";
  const auto text = exports_.Get(site + " " + name, [&]() -> Result<std::string> {
    if (!watch_->view()->connected) return ServerLost();
    const auto image = queries_->MapImage(site);
    if (!image) return tl::unexpected(image.error());
    return MapFileText(*image, site, yaml);
  });
  if (!text) return Refused(text.error());
  HttpResponse response;
  response.type = yaml ? "application/yaml" : "image/png";
  response.body = **text;
  // Names of sites hold no character that would need quoting.
  response.headers = {{"Content-Disposition", "attachment; filename=\"" + site + (yaml ? ".yaml\"" : ".png\"")},
                      {"Cache-Control", "no-store"}};
  return response;
}

bool WebPage::MayCommand(const HttpRequest& request) const {
  return SameText(request.Header("authorization"), "Bearer " + options_.token);
}

HttpResponse WebPage::AnswerPost(const HttpRequest& request, const Parts& parts) {
  if (options_.token.empty()) return HttpError(403, "this page is read-only: cairn-web was started without --token");
  if (!MayCommand(request)) return HttpError(401, "wrong or missing token");
  if (parts.size() == 2 && parts[0] == "api" && parts[1] == "token") return JsonAnswer("{}");
  if (parts.size() != 4 || parts[0] != "api") return HttpError(404, "there is no such command");
  if (!watch_->view()->connected) return HttpError(503, "the server does not answer");
  HttpResponse response = HttpError(404, "there is no such command");
  std::uint64_t id = 0;
  if (parts[1] == "jobs" && parts[3] == "cancel" && ParseNumber(parts[2], id)) {
    const auto job = queries_->CancelJob(id);
    response = job ? JsonAnswer(JobJson(*job)) : Refused(job.error());
  } else if (parts[1] == "robots") {
    response = CommandRobot(parts[2], parts[3], request.body);
  } else if (parts[1] == "sites") {
    if (watch_->view()->Sites().count(parts[2]) == 0) return HttpError(404, "the server has no such site");
    response = CommandSite(parts[2], parts[3], request.body);
  }
  watch_->AskNow();
  return response;
}

void WebPage::LogCommand(const HttpRequest& request, const Parts& parts, const std::string& id, int status,
                         std::chrono::steady_clock::time_point begun) const {
  if (!options_.log || parts.size() < 3) return;
  LogSubject fields;
  fields.request = id;
  fields.client = id.substr(0, id.find('-'));
  if (parts[1] == "robots") fields.robot = parts[2];
  if (parts[1] == "sites") fields.site = parts[2];
  if (parts[1] == "jobs") static_cast<void>(ParseNumber(parts[2], fields.job));
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begun;
  options_.log(fmt::format("POST {}: {} after {:.1f} ms", request.path, status, took.count()), fields);
}

HttpResponse WebPage::CommandRobot(const std::string& robot, const std::string& command, const std::string& body) {
  const auto done = [](const auto& result) { return result ? JsonAnswer("{}") : Refused(result.error()); };
  if (command == "relocalise") return Relocalise(robot, body);
  if (command == "localise") return done(queries_->Localise(robot));
  if (command == "map") return done(queries_->MapAgain(robot));
  return HttpError(404, "there is no such command");
}

// The body holds x, y and theta, or nothing where nobody knows where the robot is.
HttpResponse WebPage::Relocalise(const std::string& robot, const std::string& body) {
  const auto arguments = Object(body);
  if (!arguments) return HttpError(400, "the body is no JSON object");
  std::optional<Pose2> T_map_robot;
  if (!arguments->empty()) {
    const auto number = [&](const char* name) {
      const auto at = arguments->find(name);
      return at != arguments->end() && at->is_number() ? at->get<double>() : std::numeric_limits<double>::quiet_NaN();
    };
    T_map_robot = Pose2{number("x"), number("y"), number("theta")};
    if (!T_map_robot->IsFinite()) return HttpError(400, "`x`, `y` and `theta` must be numbers, or all be left out");
    T_map_robot->theta = WrapAngle(T_map_robot->theta);
  }
  const auto done = queries_->Relocalise(robot, T_map_robot);
  return done ? JsonAnswer("{}") : Refused(done.error());
}

HttpResponse WebPage::CommandSite(const std::string& site, const std::string& command, const std::string& body) {
  const auto arguments = Object(body);
  if (!arguments) return HttpError(400, "the body is no JSON object");
  const auto done = [](const auto& result) { return result ? JsonAnswer("{}") : Refused(result.error()); };
  if (command == "smooth") {
    const auto enable = arguments->find("enable");
    if (enable != arguments->end() && !enable->is_boolean()) return HttpError(400, "`enable` must be true or false");
    const auto job = queries_->SubmitJob(site, JobKind::kSmooth, enable == arguments->end() || enable->get<bool>());
    return job ? JsonAnswer(JobJson(*job)) : Refused(job.error());
  }
  if (command == "enable") {
    const auto version = arguments->find("version");
    if (version == arguments->end() || !version->is_number_unsigned() || version->get<std::uint64_t>() > UINT32_MAX)
      return HttpError(400, "`version` must be the number of a map version");
    return done(queries_->EnableMap(site, version->get<std::uint32_t>()));
  }
  if (command == "rollback") return done(queries_->RollBackMap(site));
  if (command == "edit") {
    const auto edit = EditFromJson(*arguments);
    return edit ? done(queries_->AddMapEdit(site, *edit)) : Refused(edit.error());
  }
  if (command == "remove-edit") {
    const auto id = arguments->find("id");
    std::uint64_t number = 0;
    if (id == arguments->end() || !id->is_string() || !ParseNumber(id->get<std::string>(), number))
      return HttpError(400, "`id` must be the number of an edit");
    return done(queries_->RemoveMapEdit(site, number));
  }
  if (command == "save") return done(queries_->SaveSite(site));
  return HttpError(404, "there is no such command");
}

}  // namespace cairn::web
