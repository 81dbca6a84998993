// What a browser or a stranger sends to cairn-web: the bytes of a connection, through a socket and the HTTP server as
// it runs, and what the page reads in a request: the parts of its path and the JSON of an edit of a map.
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <exception>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/web/http_answers.h"
#include "client/web/web_json.h"
#include "common/http/http_server.h"
#include "tests/fuzz/fuzz_target.h"

namespace cairn::fuzz {
namespace {

constexpr std::size_t kMaxRequestBytes = 8192;

HttpResponse AnswerEdit(const std::string& body) {
  const auto json = nlohmann::json::parse(body, nullptr, false);
  if (!json.is_object()) return HttpError(400, "the body is no JSON object");
  auto edit = web::EditFromJson(json);
  if (!edit) return web::Refused(edit.error());
  Must(ValidateMapEdit(*edit).has_value(), "an accepted edit is valid");
  std::string text = web::EditsJson({*edit});
  const auto again = web::EditFromJson(nlohmann::json::parse(text).at(0));
  Must(again.has_value() && *again == *edit, "what the page shows of an edit reads back as the same edit");
  return web::JsonAnswer(std::move(text));
}

class WebServer {
 public:
  WebServer() {
    HttpOptions options;
    options.max_connections = 8;
    options.max_request_bytes = kMaxRequestBytes;
    auto started = HttpServer::Start(options, [this](const HttpRequest& request) { return Answer(request); });
    Must(started.has_value(), "the HTTP server starts");
    server_ = std::move(*started);
  }

  // The answers to all that is sent. The connection is closed for writing afterwards, so nothing waits for more.
  std::string Exchange(std::string_view bytes) {
    const int connection = Connect();
    // Less is sent where the server has refused and closed.
    static_cast<void>(send(connection, bytes.data(), bytes.size(), MSG_NOSIGNAL));
    shutdown(connection, SHUT_WR);
    std::string answers;
    std::array<char, 4096> buffer{};
    for (ssize_t count = 0; (count = recv(connection, buffer.data(), buffer.size(), 0)) > 0;)
      answers.append(buffer.data(), static_cast<std::size_t>(count));
    close(connection);
    return answers;
  }

  [[nodiscard]] int handled() const { return handled_; }

 private:
  // A connection that was closed keeps its port for a minute, and one address has not enough of them: each connection
  // comes from another address of this machine (127.1.x.y). Where all of them were used within that minute, the port
  // that the system chooses may still be kept; the next one is tried.
  int Connect() {
    constexpr int kMostTries = 10;
    for (int attempt = 0; attempt < kMostTries; ++attempt) {
      const int connection = socket(AF_INET, SOCK_STREAM, 0);
      sockaddr_in address{};
      address.sin_family = AF_INET;
      address.sin_addr.s_addr = htonl(INADDR_LOOPBACK + 0x10000 + (connections_++ & 0xffff));
      Must(bind(connection, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0,
           "an address of this machine");
      address.sin_port = htons(static_cast<std::uint16_t>(server_->port()));
      address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      if (connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) return connection;
      close(connection);
    }
    Must(false, "it can be asked");
    return -1;
  }

  // The server would answer an exception with an error.
  HttpResponse Answer(const HttpRequest& request) {
    try {
      return AnswerOrThrow(request);
    } catch (const std::exception& error) {
      Must(false, error.what());
      return {};
    }
  }
  HttpResponse AnswerOrThrow(const HttpRequest& request) {
    ++handled_;
    Must(request.method == "GET" || request.method == "POST", "other methods are refused");
    Must(request.body.size() <= kMaxRequestBytes, "a body is within its bound");
    Must(request.path.front() == '/' && request.path.find("..") == std::string::npos, "a path stays in its folder");
    Must(std::none_of(request.path.begin(), request.path.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }),
         "a path has no control characters");
    Must(!web::SplitPath(request.path).empty(), "a path has parts");
    if (request.method == "POST") return AnswerEdit(request.body);
    return web::FileOfPage(request, web::SplitPath(request.path).back());
  }

  std::atomic<int> handled_{0};
  std::uint32_t connections_ = 0;
  std::unique_ptr<HttpServer> server_;  // The last member, because its threads use the others.
};

bool RunHttp(std::string_view input) {
  static WebServer web;
  const int before = web.handled();
  const std::string answers = web.Exchange(input);
  Must(answers.empty() || answers.starts_with("HTTP/1.1 "), "an answer is HTTP");
  return web.handled() > before;
}

std::vector<std::string> SeedsOfHttp() {
  const auto post = [](const std::string& body) {
    return "POST /api/sites/lab/edit HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer t\r\nContent-Type: "
           "application/json\r\nContent-Length: " +
           std::to_string(body.size()) + "\r\n\r\n" + body;
  };
  const std::string get = "GET /style.css?theme=dark&site=a%20b HTTP/1.1\r\nHost: 127.0.0.1:80\r\n";
  return {
      get + "\r\n",
      get + "If-None-Match: \"1\"\r\nAccept-Encoding: gzip\r\n\r\n" + get + "Connection: close\r\n\r\n",
      "HEAD /index.html HTTP/1.0\r\n\r\n",
      post(R"({"kind":"occupied","points":[[0,0],[3,1.5]],"width":0.1,"note":"a wall"})"),
      post(R"({"kind":"keep_out","points":[[0,0],[3,0],[3,2]]})") + get + "\r\n",
      "POST /x HTTP/1.1\r\nContent-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n0\r\n\r\n",
  };
}

const bool kHttpTarget = Register({"http", &RunHttp, &SeedsOfHttp});

}  // namespace
}  // namespace cairn::fuzz
