// The page's answers, against a fake server over DDS. Handlers are called directly; sockets are tests/common/http.
#include "client/web/web_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/lib/ros2_findings.h"
#include "client/web/tile_picture.h"
#include "common/map/image_codec.h"
#include "tests/client/lib/fake_server.h"
#include "tests/loopback.h"

namespace cairn::web {
namespace {

using namespace test;
using nlohmann::json;
using ::testing::HasSubstr;

TileSample Wall(int x, std::uint64_t version) {
  TileSample sample;
  sample.site_id = HashName("drawn");
  sample.tile.key = {0, x, 0};
  sample.tile.version = version;
  sample.tile.encoding = TileEncoding::kRaw;
  sample.tile.bytes.assign(kTileArea, kUnknownCell);
  sample.tile.bytes[0] = 100;  // Lower-left cell.
  return sample;
}

class Page : public ::testing::Test {
 protected:
  void Open(const std::string& token = "") {
    bus_ = MakeBus("page");
    page_ = Must(WebPage::Create(*bus_, {.token = token}));
  }
  void StartServer() {
    server_.emplace(LoopbackOptions());
    MapInfo info;
    info.site_id = HashName("drawn");
    info.site = "drawn";
    info.version = 1;
    info.levels = 4;
    info.tile_count = 1;
    server_->Publish(info);
    server_->Publish(Wall(0, 1));
  }
  [[nodiscard]] bool KnowsSite() const {
    return Eventually([&] { return page_->watch().view()->Sites().count("drawn") > 0; });
  }
  HttpResponse Get(const std::string& path, std::multimap<std::string, std::string> query = {},
                   std::multimap<std::string, std::string> headers = {}) {
    HttpRequest request;
    request.method = "GET";
    request.path = path;
    request.query = std::move(query);
    request.headers = std::move(headers);
    return page_->Answer(request);
  }
  HttpResponse Post(const std::string& path, const std::string& token, const std::string& body = "{}") {
    HttpRequest request;
    request.method = "POST";
    request.path = path;
    request.headers = {{"authorization", "Bearer " + token}};
    request.body = body;
    return page_->Answer(request);
  }

  std::optional<FakeServer> server_;
  std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<WebPage> page_;
};

TEST_F(Page, ItsFilesComeWithATagAndNothingFromOutside) {
  Open();
  const HttpResponse index = Get("/");
  EXPECT_EQ(index.status, 200);
  EXPECT_THAT(index.body, HasSubstr("<title>Cairn</title>"));
  EXPECT_THAT(index.body, Not(HasSubstr("http://")));
  EXPECT_THAT(index.body, Not(HasSubstr("https://")));
  EXPECT_EQ(Get("/", {}, {{"if-none-match", index.headers[0].second}}).status, 304);
  for (const char* file : {"/leaflet.js", "/leaflet.css", "/style.css", "/main.js", "/map.js", "/icon.svg"})
    EXPECT_EQ(Get(file).status, 200) << file;
  for (const char* none : {"/nothing", "/api", "/api/sites/x", "/etc/passwd", "//", "/api//tiles/0/0/0.png"})
    EXPECT_EQ(Get(none).status, 404) << none;
}

TEST_F(Page, WithoutAServerItSaysSo) {
  Open();
  const json state = json::parse(Get("/api/state").body);
  EXPECT_EQ(state["connected"], false);
  EXPECT_EQ(Get("/api/robots/r1/path").status, 503);
  EXPECT_EQ(Get("/api/robots/r1/map.png").status, 404);
  EXPECT_EQ(Get("/api/robots/../map.png").status, 404);
  EXPECT_EQ(Get("/api/sites/hall/tiles/0/0/0.png").status, 404);
}

TEST_F(Page, FiguresForMonitoringSayWhetherTheServerAnswers) {
  Open();
  EXPECT_EQ(Get("/healthz").status, 200);
  EXPECT_EQ(Get("/readyz").status, 503);
  EXPECT_THAT(Get("/metrics").body, HasSubstr("\ncairn_up 0\n"));
  EXPECT_THAT(Get("/metrics").body, Not(HasSubstr("cairn_degraded")));
  StartServer();
  ASSERT_TRUE(KnowsSite());
  EXPECT_EQ(Get("/readyz").status, 200);
  const std::string text = Get("/metrics").body;
  EXPECT_THAT(text, HasSubstr("# TYPE cairn_up gauge\ncairn_up 1\n"));
  EXPECT_THAT(text, HasSubstr("cairn_map_tiles{site=\"drawn\"} 1\n"));
}

TEST(TilePicture, OnlyCellsAboutWhichRobotsDifferAreDrawn) {
  OccupancyImage image{.resolution_m = 0.05, .T_map_origin = {}, .width = 2, .height = 2, .cells = {0, 100, 50, 255}};
  const auto png = DrawDisagreement(image);
  ASSERT_TRUE(png);
  const auto drawn = Must(DecodeImage({png->begin(), png->end()}));
  EXPECT_EQ(drawn.channels, 4);
  std::vector<int> alpha;
  for (std::size_t i = 3; i < drawn.samples.size(); i += 4) alpha.push_back(drawn.samples[i]);
  EXPECT_EQ(alpha, (std::vector<int>{0, 0, 0, 230})) << "the highest row first";
}

TEST_F(Page, TilesArePicturesWithATagPerContentAndTheme) {
  StartServer();
  Open();
  ASSERT_TRUE(KnowsSite());
  HttpResponse tile;
  ASSERT_TRUE(Eventually([&] { return (tile = Get("/api/sites/drawn/tiles/0/0/0.png")).status == 200; }));
  const auto picture = Must(DecodeImage({tile.body.begin(), tile.body.end()}));
  EXPECT_EQ(picture.channels, 4);
  const auto pixel = [&](int row, int column) {
    return &picture.samples[static_cast<std::size_t>((row * 128 + column) * 4)];
  };
  EXPECT_EQ(pixel(127, 0)[3], 255) << "the lowest row is the last one of the picture";
  EXPECT_LT(pixel(127, 0)[0], 80);
  EXPECT_EQ(pixel(0, 0)[3], 0) << "unknown cells are transparent";

  const std::string tag = tile.headers[0].second;
  EXPECT_EQ(Get("/api/sites/drawn/tiles/0/0/0.png", {}, {{"if-none-match", tag}}).status, 304);
  EXPECT_EQ(Get("/api/sites/drawn/tiles/0/0/0.png", {{"theme", "dark"}}, {{"if-none-match", tag}}).status, 200);
  server_->Publish(Wall(0, 2));
  EXPECT_TRUE(Eventually([&] {
    return Get("/api/sites/drawn/tiles/0/0/0.png", {}, {{"if-none-match", tag}}).status == 200;
  }));
  EXPECT_EQ(Get("/api/sites/drawn/tiles/0/7/0.png").status, 404);
  EXPECT_EQ(Get("/api/sites/drawn/tiles/0/x/0.png").status, 400);
  EXPECT_EQ(Get("/api/sites/other/tiles/0/0/0.png").status, 404);
  EXPECT_EQ(page_->maps().open(), 1U) << "a site that the server does not know opens no map";
}

// All tiles of a large map come in seconds; a picture of it must not wait for them. The fake server never publishes
// this tile, and answers it.
TEST_F(Page, TheCoarsestTilesAreThereAtOnce) {
  StartServer();
  Open();
  ASSERT_TRUE(KnowsSite());
  EXPECT_EQ(Get("/api/sites/drawn/tiles/3/0/0.png").status, 200);
  std::string piece;
  EXPECT_TRUE(Get("/api/events", {{"site", "drawn"}}).stream(piece));
  EXPECT_THAT(piece, HasSubstr("[3,0,0,1]"));
}

TEST_F(Page, TheEventsTellTheStateAndEachTileOnce) {
  StartServer();
  Open();
  ASSERT_TRUE(KnowsSite());
  EXPECT_EQ(Get("/api/events", {{"site", "other"}}).status, 404);
  const HttpResponse events = Get("/api/events", {{"site", "drawn"}});
  ASSERT_TRUE(events.stream);
  std::string said;
  const auto hears = [&](const std::string& text) {
    return Eventually([&] {
      std::string piece;
      EXPECT_TRUE(events.stream(piece));
      said += piece;
      return said.find(text) != std::string::npos;
    });
  };
  EXPECT_TRUE(hears("event: state"));
  EXPECT_TRUE(hears("\"site\":\"drawn\""));
  EXPECT_TRUE(hears("[0,0,0,1]"));
  said.clear();
  server_->Publish(Wall(3, 2));
  EXPECT_TRUE(hears("[0,3,0,2]"));
  EXPECT_THAT(said, Not(HasSubstr("[0,0,0,1]")));
}

TEST_F(Page, TheServerMayLeaveAndComeBack) {
  StartServer();
  Open();
  ASSERT_TRUE(KnowsSite());
  const auto looking = page_->watch().Look();
  server_.reset();
  EXPECT_TRUE(Eventually([&] { return !page_->watch().view()->connected; }));
  EXPECT_EQ(page_->watch().view()->Sites().count("drawn"), 1U) << "what it said last stays";
  EXPECT_EQ(Get("/api/sites/drawn/map.png").status, 503);
  StartServer();
  EXPECT_TRUE(Eventually([&] { return page_->watch().view()->connected; }));
}

TEST_F(Page, CommandsNeedTheToken) {
  StartServer();
  Open("secret");
  ASSERT_TRUE(KnowsSite());
  const auto asked = [&](RequestKind kind) {
    const auto all = server_->asked();
    return std::count(all.begin(), all.end(), kind);
  };
  EXPECT_EQ(Post("/api/sites/drawn/smooth", "").status, 401);
  EXPECT_EQ(Post("/api/sites/drawn/smooth", "secreT").status, 401);
  EXPECT_EQ(Post("/api/sites/drawn/smooth", "secretsecret").status, 401);
  EXPECT_EQ(asked(RequestKind::kJobSubmit), 0);
  EXPECT_EQ(Post("/api/token", "secret").status, 200);
  const HttpResponse job = Post("/api/sites/drawn/smooth", "secret");
  EXPECT_EQ(job.status, 200) << job.body;
  EXPECT_EQ(json::parse(job.body)["id"], "42");
  EXPECT_EQ(asked(RequestKind::kJobSubmit), 1);
  EXPECT_EQ(Post("/api/jobs/42/cancel", "secret").status, 200);
  EXPECT_EQ(asked(RequestKind::kJobCancel), 1);
  EXPECT_EQ(Post("/api/sites/drawn/enable", "secret", R"({"version":2})").status, 200);
  EXPECT_EQ(Post("/api/sites/drawn/enable", "secret", R"({"version":99})").status, 404);
  for (const char* body : {"[", "[]", R"({"version":-1})", R"({"version":"2"})", R"({"version":1e30})", "{}"})
    EXPECT_EQ(Post("/api/sites/drawn/enable", "secret", body).status, 400) << body;
  EXPECT_EQ(Post("/api/sites/other/smooth", "secret").status, 404);
  EXPECT_EQ(Post("/api/jobs/x/cancel", "secret").status, 404);
}

TEST_F(Page, SomebodySaysWhereARobotIs) {
  StartServer();
  Open("secret");
  ASSERT_TRUE(KnowsSite());
  const auto relocalise = [&](const std::string& body) {
    return Post("/api/robots/r1/relocalise", "secret", body).status;
  };
  EXPECT_EQ(Post("/api/robots/r1/relocalise", "").status, 401);
  EXPECT_EQ(relocalise(R"({"x":1.5,"y":-2,"theta":1.5707963267948966})"), 200);
  EXPECT_EQ(relocalise(R"({"x":1.5,"y":-2,"theta":0})"), 409) << "the server says that this is no place for it";
  EXPECT_EQ(relocalise("{}"), 409);
  for (const char* body : {"[]", R"({"x":1})", R"({"x":1,"y":2,"theta":"3"})", R"({"x":1,"y":1e999,"theta":0})"})
    EXPECT_EQ(relocalise(body), 400) << body;
  const auto asked = server_->asked();
  EXPECT_EQ(std::count(asked.begin(), asked.end(), RequestKind::kRelocalise), 3);
}

TEST_F(Page, PeopleEditAMap) {
  StartServer();
  Open("secret");
  ASSERT_TRUE(KnowsSite());
  const auto edits = json::parse(Get("/api/sites/drawn/edits").body);
  ASSERT_EQ(edits.size(), 2U);
  EXPECT_EQ(edits[0]["kind"], "free");
  EXPECT_EQ(edits[0]["points"][1], json({1.0, 0.0}));
  const std::string wall = R"({"kind":"occupied","points":[[0,0],[1,2.5]],"width":0.1,"note":"glass"})";
  EXPECT_EQ(Post("/api/sites/drawn/edit", "", wall).status, 401);
  EXPECT_EQ(Post("/api/sites/drawn/edit", "secret", wall).status, 200);
  for (const char* body :
       {"[]", "{}", R"({"kind":"hole","points":[[0,0],[1,0],[1,1]]})", R"({"kind":"free","points":[[0,0],[1,1]]})",
        R"({"kind":"free","points":7})", R"({"kind":"free","points":[[0,0],[1,0],[1]]})",
        R"({"kind":"free","points":[[0,0],[1,0],[1,"1"]]})", R"({"kind":"free","points":[[0,0],[1,0],[1,1e999]]})",
        R"({"kind":"free","points":[[0,0],[1,0],[1,1]],"width":"1"})",
        R"({"kind":"free","points":[[0,0],[1,0],[1,1]],"note":7})",
        R"({"kind":"free","points":[[0,0],[1,0],[1,1]],"note":"\u001b"})"})
    EXPECT_EQ(Post("/api/sites/drawn/edit", "secret", body).status, 400) << body;
  EXPECT_EQ(Post("/api/sites/drawn/remove-edit", "", R"({"id":"5"})").status, 401);
  EXPECT_EQ(Post("/api/sites/drawn/remove-edit", "secret", R"({"id":"5"})").status, 200);
  EXPECT_EQ(Post("/api/sites/drawn/remove-edit", "secret", R"({"id":"6"})").status, 404);
  for (const char* body : {"{}", R"({"id":5})", R"({"id":"-5"})", R"({"id":"5 "})"})
    EXPECT_EQ(Post("/api/sites/drawn/remove-edit", "secret", body).status, 400) << body;
  const auto asked = server_->asked();
  EXPECT_EQ(std::count(asked.begin(), asked.end(), RequestKind::kMapEditAdd), 1);
}

TEST_F(Page, ARobotIsOnlyLocalisedOrMapsAgain) {
  StartServer();
  Open("secret");
  ASSERT_TRUE(KnowsSite());
  for (const char* mode : {"localise", "map"}) {
    const std::string path = std::string("/api/robots/robot1/") + mode;
    EXPECT_EQ(Post(path, "").status, 401);
    EXPECT_EQ(Post(path, "secret").status, 200);
    EXPECT_EQ(Post(std::string("/api/robots/nobody/") + mode, "secret").status, 404);
  }
  EXPECT_EQ(Post("/api/robots/robot1/fly", "secret").status, 404);
  const auto asked = server_->asked();
  EXPECT_EQ(std::count(asked.begin(), asked.end(), RequestKind::kLocalise), 2);
  EXPECT_EQ(std::count(asked.begin(), asked.end(), RequestKind::kMap), 2);
}

TEST_F(Page, TheDoctorSaysWhatTheCommandLinePrints) {
  Open();
  EXPECT_EQ(json::parse(Get("/api/doctor").body)["ros2"], nullptr);
  StartServer();
  ASSERT_TRUE(KnowsSite());
  const auto client = Must(client::QueryClient::Create(*bus_));
  const std::string printed = client::FormatRos2(client::FindingsOf(Must(client->Ros2())));
  json doctor;
  ASSERT_TRUE(Eventually([&] { return !(doctor = json::parse(Get("/api/doctor").body))["ros2"].is_null(); }));
  EXPECT_THAT(printed, HasSubstr(doctor["ros2"]["where"].get<std::string>() + "\n"));
  ASSERT_EQ(doctor["ros2"]["namespaces"].size(), 1U);
  const json& one = doctor["ros2"]["namespaces"][0];
  EXPECT_THAT(printed, HasSubstr(one["name"].get<std::string>() + "  " + one["who"].get<std::string>() + ": NOT"));
  ASSERT_EQ(one["problems"].size(), 1U);
  EXPECT_THAT(printed, HasSubstr("  - " + one["problems"][0].get<std::string>() + "\n"));

  // It is told to who looks as well, also where no site is looked at.
  const HttpResponse events = Get("/api/events");
  std::string said;
  EXPECT_TRUE(Eventually([&] {
    std::string piece;
    EXPECT_TRUE(events.stream(piece));
    said += piece;
    return said.find("event: doctor") != std::string::npos;
  }));
  EXPECT_THAT(said, HasSubstr("no odometry"));
}

TEST_F(Page, WithoutATokenItIsReadOnly) {
  StartServer();
  Open();
  ASSERT_TRUE(KnowsSite());
  EXPECT_EQ(Post("/api/sites/drawn/smooth", "").status, 403);
}

}  // namespace
}  // namespace cairn::web
