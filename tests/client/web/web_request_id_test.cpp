// The id of the request to the server is in the header of the page's answer and in the line about the command.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/web/web_page.h"
#include "tests/client/lib/fake_server.h"
#include "tests/loopback.h"

namespace cairn::web {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::SizeIs;

// Empty where the answer has none.
std::string IdOf(const HttpResponse& response) {
  const auto header = std::find_if(response.headers.begin(), response.headers.end(),
                                   [](const auto& one) { return one.first == "X-Request-Id"; });
  return header == response.headers.end() ? std::string() : header->second;
}

class RequestIds : public ::testing::Test {
 protected:
  void SetUp() override {
    MapInfo info;
    info.site_id = HashName("drawn");
    info.site = "drawn";
    info.version = 1;
    info.levels = 4;
    server_.Publish(info);
    ASSERT_TRUE(test::Eventually([&] { return page_->watch().view()->Sites().count("drawn") > 0; }));
  }
  HttpResponse Get(const std::string& path) const {
    HttpRequest request;
    request.method = "GET";
    request.path = path;
    return page_->Answer(request);
  }
  HttpResponse Post(const std::string& path, const std::string& body = "{}") const {
    HttpRequest request;
    request.method = "POST";
    request.path = path;
    request.headers = {{"authorization", "Bearer secret"}};
    request.body = body;
    return page_->Answer(request);
  }

  std::vector<std::pair<std::string, LogSubject>> logged_;
  test::FakeServer server_{test::LoopbackOptions()};
  const std::unique_ptr<wire::Bus> bus_ = test::MakeBus("page");
  const std::unique_ptr<WebPage> page_ = test::Must(
      WebPage::Create(*bus_, {.token = "secret", .log = [this](const std::string& message, const LogSubject& fields) {
                                logged_.emplace_back(message, fields);
                              }}));
};

TEST_F(RequestIds, AreInTheHeaderOfWhatTheServerWasAsked) {
  for (const char* own : {"/", "/healthz", "/metrics", "/api/state", "/api/nothing"}) EXPECT_EQ(IdOf(Get(own)), "");
  EXPECT_THAT(IdOf(Get("/api/sites/drawn/landmarks")), MatchesRegex("[0-9a-f]+-[0-9]+"));
  EXPECT_THAT(logged_, SizeIs(0)) << "a question is no command";
}

TEST_F(RequestIds, AreInTheLineOfEachCommand) {
  const std::string smooth = IdOf(Post("/api/sites/drawn/smooth"));
  const HttpResponse refused = Post("/api/robots/nobody/localise");
  EXPECT_EQ(refused.status, 404);
  const std::string cancel = IdOf(Post("/api/jobs/42/cancel"));
  EXPECT_THAT(smooth, MatchesRegex("[0-9a-f]+-[0-9]+"));
  EXPECT_NE(smooth, cancel);
  ASSERT_THAT(logged_, SizeIs(3));
  EXPECT_THAT(logged_[0].first, HasSubstr("POST /api/sites/drawn/smooth: 200 after "));
  EXPECT_EQ(logged_[0].second.request, smooth);
  EXPECT_EQ(logged_[0].second.site, "drawn");
  EXPECT_EQ(logged_[1].second.request, IdOf(refused)) << "also of an error";
  EXPECT_EQ(logged_[1].second.robot, "nobody");
  EXPECT_EQ(logged_[2].second.request, cancel);
  EXPECT_EQ(logged_[2].second.job, 42U);
  for (const auto& [message, fields] : logged_) EXPECT_EQ(fields.request.find(fields.client + "-"), 0U) << message;
}

TEST_F(RequestIds, AreMissingWhereNothingWasSent) {
  EXPECT_EQ(IdOf(Post("/api/jobs/x/cancel")), "");
  EXPECT_EQ(IdOf(Post("/api/sites/drawn/enable", "[]")), "");
  EXPECT_EQ(IdOf(Post("/api/token")), "");
  EXPECT_THAT(logged_, SizeIs(0));
}

}  // namespace
}  // namespace cairn::web
