// The HTTP server, asked through plain sockets: what a stranger may send and what it costs.
#include "common/http/http_server.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>

#include "tests/eventually.h"
#include "tests/must.h"

namespace cairn {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class Connection {
 public:
  explicit Connection(int port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{.tv_sec = 20, .tv_usec = 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    connected_ = connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  }
  ~Connection() { close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // False where the other side has closed.
  bool Send(const std::string& text) const {
    return connected_ && send(socket_, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  }
  // Until the text has come, or the end.
  std::string ReadUntil(const std::string& text) {
    std::string got;
    std::array<char, 4096> buffer{};
    while (got.find(text) == std::string::npos) {
      const ssize_t count = recv(socket_, buffer.data(), buffer.size(), 0);
      if (count <= 0) break;
      got.append(buffer.data(), static_cast<std::size_t>(count));
    }
    return got;
  }
  std::string ReadAll() { return ReadUntil(std::string(1, '\0') + "never"); }

 private:
  const int socket_;
  bool connected_ = false;
};

class Http : public ::testing::Test {
 protected:
  void Start(HttpOptions options = {}) {
    server_ = test::Must(HttpServer::Start(options, [this](const HttpRequest& request) {
      ++handled_;
      HttpResponse response;
      response.body = request.method + " " + request.path + " q=" + request.Query("q") + " " + request.body;
      if (request.path == "/stream") response.stream = [](std::string& piece) { return piece = "tick\n", true; };
      if (request.path == "/throws") throw std::runtime_error("no");
      return response;
    }));
  }
  // One request on a connection of its own.
  std::string Ask(const std::string& text) const {
    Connection connection(server_->port());
    connection.Send(text);
    return connection.ReadAll();
  }
  std::string Get(const std::string& target, const std::string& headers = "") const {
    return Ask("GET " + target + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" + headers + "\r\n");
  }

  std::atomic<int> handled_ = 0;
  std::unique_ptr<HttpServer> server_;
};

TEST_F(Http, PathQueryAndBodyReachTheHandler) {
  Start();
  EXPECT_THAT(Get("/a%20b?q=x%2Fy"), HasSubstr("GET /a b q=x/y "));
  EXPECT_THAT(Ask("POST /p HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: application/json\r\n"
                  "Content-Length: 2\r\n\r\n{}"),
              HasSubstr("POST /p q= {}"));
  EXPECT_THAT(Get("/throws"), StartsWith("HTTP/1.1 500"));
}

TEST_F(Http, WhatIsNoPlainRequestIsRefusedBeforeTheHandler) {
  Start();
  EXPECT_THAT(Get("/../../etc/passwd"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(Get("/%2e%2e/%2e%2e/etc/passwd"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(Get("/a%00b"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(Get("/" + std::string(600, 'a')), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(Get("/", "Range: bytes=0-1,0-1,0-1\r\n"), StartsWith("HTTP/1.1 416"));
  EXPECT_THAT(Get("/", "Content-Length: 5\r\n"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(Ask("DELETE / HTTP/1.1\r\nHost: localhost\r\n\r\n"), StartsWith("HTTP/1.1 405"));
  EXPECT_THAT(Ask("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n"), StartsWith("HTTP/1.1 421"));
  const std::string form =
      "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1\r\nContent-Type: text/plain\r\n\r\nx";
  EXPECT_THAT(Ask(form), StartsWith("HTTP/1.1 415"));
  // What follows a refused request on its connection is its body, and no request.
  const std::string smuggled = "GET /smuggled HTTP/1.1\r\nHost: localhost\r\n\r\n";
  EXPECT_THAT(Ask("PUT / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 50\r\n\r\n" + smuggled),
              Not(HasSubstr("smuggled")));
  EXPECT_EQ(handled_, 0);
}

TEST_F(Http, ARequestWithoutEndCostsABoundedNumberOfBytes) {
  HttpOptions options;
  options.max_request_bytes = 20000;
  Start(options);
  Connection connection(server_->port());
  connection.Send("GET / HTTP/1.1\r\n");
  std::size_t sent = 0;
  while (sent < 50'000'000 && connection.Send("X: " + std::string(900, 'a') + "\r\n")) sent += 900;
  EXPECT_LT(sent, 50'000'000U) << "the server has read on and on";
  EXPECT_EQ(handled_, 0);
}

TEST_F(Http, ARequestThatDripsIsClosedWhenItsTimeIsOver) {
  HttpOptions options;
  options.request_time = std::chrono::milliseconds(200);
  Start(options);
  Connection connection(server_->port());
  EXPECT_TRUE(connection.Send("GET / HTTP/1.1\r\nHost:"));
  EXPECT_THAT(connection.ReadAll(), Not(HasSubstr("200 OK")));
  EXPECT_EQ(handled_, 0);
}

TEST_F(Http, StreamsAreBoundedAndTheirPlacesComeBack) {
  HttpOptions options;
  options.max_streams = 1;
  Start(options);
  {
    Connection first(server_->port());
    first.Send("GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n");
    EXPECT_THAT(first.ReadUntil("tick"), HasSubstr("tick"));
    EXPECT_THAT(Get("/stream"), StartsWith("HTTP/1.1 503"));
    EXPECT_THAT(Get("/"), StartsWith("HTTP/1.1 200"));
  }
  EXPECT_TRUE(test::Eventually([&] { return server_->streams() == 0; }));
}

TEST_F(Http, ConnectionsOverTheBoundWaitAndAreServedLater) {
  HttpOptions options;
  options.max_connections = 2;
  options.idle_time = std::chrono::milliseconds(300);
  Start(options);
  // These say nothing, and are closed after the idle time.
  const Connection idle1(server_->port()), idle2(server_->port()), idle3(server_->port());
  EXPECT_THAT(Get("/"), StartsWith("HTTP/1.1 200"));
}

TEST_F(Http, ConnectionsThatWereServedGiveWayToNewOnes) {
  HttpOptions options;
  options.max_connections = 2;
  options.idle_time = std::chrono::hours(1);
  Start(options);
  Connection first(server_->port()), second(server_->port());
  for (Connection* kept : {&first, &second}) {
    kept->Send("GET /kept HTTP/1.1\r\nHost: localhost\r\n\r\n");
    EXPECT_THAT(kept->ReadUntil("/kept"), HasSubstr("GET /kept"));
  }
  EXPECT_THAT(Get("/new"), HasSubstr("GET /new"));
}

TEST_F(Http, AStopEndsStreamsAndAPortInUseIsSaid) {
  Start();
  HttpOptions same;
  same.port = server_->port();
  const auto second = HttpServer::Start(same, [](const HttpRequest&) { return HttpResponse(); });
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, StatusCode::kUnavailable);
  Connection stream(server_->port());
  stream.Send("GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_THAT(stream.ReadUntil("tick"), HasSubstr("tick"));
  server_.reset();
}

}  // namespace
}  // namespace cairn
