// A small HTTP/1.1 server for what people and monitoring look at: pages, figures, streams of events. It bounds what a
// stranger can cost: connections, streams, bytes and time of a request. It is not made for the open internet: put a
// reverse proxy with TLS before it.
// - When all connections are in use, further ones wait in the system's queue until one is free. Connections that were
//   served and are only kept open are closed for them at once.
// - A request over its bytes or its time is refused, and the connection is closed. Paths with control characters or
//   with `..`, bodies that are not JSON, compressed bodies and ranges are refused before the handler sees them.
// - With `hosts`, requests that name another host are refused, because a page from elsewhere could otherwise read the
//   answers in the browser of somebody on this machine (DNS rebinding). Addresses and `localhost` are always allowed.
// The handler runs on many threads at once. It must not throw; where it does, the client gets 500.
// Library: cpp-httplib, which only this room includes.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/status.h"

namespace cairn {

struct HttpOptions {
  std::string address = "127.0.0.1";
  int port = 0;  // 0: any that is free.
  int max_connections = 128;
  int max_streams = 64;                   // Of these, how many may be streams; others are refused with 503.
  std::size_t max_request_bytes = 65536;  // Request line, headers and body together.
  std::chrono::milliseconds request_time{10000};
  std::chrono::milliseconds idle_time{5000};  // Between two requests of a connection.
  std::vector<std::string> hosts;             // Names, without a port, under which the server may be asked.
};

struct HttpRequest {
  std::string method;  // GET (also for HEAD) or POST.
  std::string path;    // Percent-decoded, without the query.
  std::multimap<std::string, std::string> query;
  std::multimap<std::string, std::string> headers;  // Names in lower case.
  std::string body;

  // The first value, or an empty text.
  [[nodiscard]] std::string Query(const std::string& name) const;
  [[nodiscard]] std::string Header(const std::string& name) const;
};

struct HttpResponse {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;
  // A stream: called again and again for its next piece, which may be empty. It returns false to end, and should wait
  // no longer than a second. Destroyed when the stream has ended or the client has left.
  std::function<bool(std::string& piece)> stream;
};

class HttpServer {
 public:
  using Handler = std::function<HttpResponse(const HttpRequest&)>;

  // Listens when it returns. kUnavailable: the address or the port cannot be used.
  [[nodiscard]] static Result<std::unique_ptr<HttpServer>> Start(const HttpOptions& options, Handler handler);
  // Ends the streams, finishes the requests, and returns when no handler runs any more.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  [[nodiscard]] int port() const;
  [[nodiscard]] int streams() const;  // Open now.

 private:
  class Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  const std::unique_ptr<Impl> impl_;
};

// {"error": message} with the status.
[[nodiscard]] HttpResponse HttpError(int status, std::string_view message);

}  // namespace cairn
