#include "common/http/http_server.h"

#include <httplib.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <exception>
#include <optional>
#include <thread>

#include "common/http/connection_stream.h"
#include "common/http/worker_threads.h"

namespace cairn {
namespace {

constexpr std::size_t kMaxPath = 512;

std::string First(const std::multimap<std::string, std::string>& values, const std::string& name) {
  const auto found = values.find(name);
  return found == values.end() ? std::string() : found->second;
}

std::string LowerCase(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::string Escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '"' || c == '\\') escaped += '\\';
    escaped += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return escaped;
}

bool IsPlainPath(const std::string& path) {
  return path.size() <= kMaxPath && !path.empty() && path[0] == '/' && path.find("..") == std::string::npos &&
         path.find('\\') == std::string::npos &&
         std::none_of(path.begin(), path.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

bool IsAddress(const std::string& host) {
  return host.front() == '[' || host.find_first_not_of("0123456789.") == std::string::npos;
}

// The name without the port.
bool IsAllowedHost(std::string host, const std::vector<std::string>& allowed) {
  if (host.empty()) return true;  // HTTP/1.0: no browser.
  if (host.front() != '[') host = LowerCase(host.substr(0, host.find(':')));
  return host.empty() || IsAddress(host) || host == "localhost" ||
         std::find(allowed.begin(), allowed.end(), host) != allowed.end();
}

// Why the request is not passed on; nothing if it is.
std::optional<HttpResponse> Refusal(const httplib::Request& request, const HttpOptions& options) {
  const bool reads = request.method == "GET" || request.method == "HEAD";
  if (!reads && request.method != "POST") return HttpError(405, "only GET, HEAD and POST are answered");
  if (!IsPlainPath(request.path)) return HttpError(400, "the path is too long, or no plain path");
  if (!IsAllowedHost(request.get_header_value("Host"), options.hosts))
    return HttpError(421, "this host name is not allowed; see --host");
  if (request.has_header("Range")) return HttpError(416, "ranges are not answered");
  if (request.has_header("Content-Encoding")) return HttpError(415, "compressed bodies are not read");
  const bool has_body = request.has_header("Transfer-Encoding") ||
                        (request.has_header("Content-Length") && request.get_header_value("Content-Length") != "0");
  if (reads && has_body) return HttpError(400, "a body is only read with POST");
  if (!reads && request.get_header_value("Content-Type").rfind("application/json", 0) != 0)
    return HttpError(415, "the body must be application/json");
  return std::nullopt;
}

HttpRequest Translate(const httplib::Request& from) {
  HttpRequest request;
  request.method = from.method == "POST" ? "POST" : "GET";
  request.path = from.path;
  for (const auto& [name, value] : from.params) request.query.emplace(name, value);
  for (const auto& [name, value] : from.headers) request.headers.emplace(LowerCase(name), value);
  request.body = from.body;
  return request;
}

}  // namespace

std::string HttpRequest::Query(const std::string& name) const {
  return First(query, name);
}

std::string HttpRequest::Header(const std::string& name) const {
  return First(headers, name);
}

HttpResponse HttpError(int status, std::string_view message) {
  HttpResponse response;
  response.status = status;
  response.type = "application/json";
  response.body = "{\"error\":\"" + Escaped(message) + "\"}\n";
  return response;
}

class HttpServer::Impl final : public httplib::Server {
 public:
  Impl(const HttpOptions& options, HttpServer::Handler handler) : options_(options), handler_(std::move(handler)) {
    new_task_queue = [this] { return new WorkerThreads(options_.max_connections, crowded_); };
    set_keep_alive_max_count(kMaxRequests);
    set_payload_max_length(options_.max_request_bytes);
    set_tcp_nodelay(true);
    // The library's own choice would let two programs listen on one port.
    set_socket_options([](socket_t socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      if (auto refusal = Refusal(request, options_)) {
        Answer(std::move(*refusal), response);
        response.set_header("Connection", "close");
        close_after_answer = true;
      } else if (request.method == "POST") {
        return HandlerResponse::Unhandled;  // Its body is read next.
      } else {
        Handle(request, response);
      }
      return HandlerResponse::Handled;
    });
    Post(".*", [this](const httplib::Request& request, httplib::Response& response) { Handle(request, response); });
    set_exception_handler([](const httplib::Request&, httplib::Response& response, const std::exception_ptr&) {
      response.status = 500;
      response.set_content("{\"error\":\"internal error\"}\n", "application/json");
    });
  }

  Result<void> Listen() {
    const bool any = options_.port == 0;
    port_ = any ? bind_to_any_port(options_.address) : options_.port;
    if (any ? port_ < 0 : !bind_to_port(options_.address, options_.port)) {
      return Fail(StatusCode::kUnavailable, "cannot listen on " + options_.address + ":" +
                                                std::to_string(options_.port) +
                                                ": the address is not this machine's, or the port is in use");
    }
    thread_ = std::thread([this] { listen_after_bind(); });
    // The library counts as stopped until its thread runs, and a stop before that would be lost.
    while (!is_running()) std::this_thread::yield();
    return {};
  }

  ~Impl() override {
    stopping_ = true;
    stop();
    if (thread_.joinable()) thread_.join();
  }

  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] int streams() const { return streams_; }

 private:
  static constexpr std::size_t kMaxRequests = 1000;  // Of one connection.
  // Of the connection that this thread serves: a refused request may have a body, which would be read as the next one.
  static inline thread_local bool close_after_answer = false;

  // Counts a stream as long as it lives.
  struct StreamPlace {
    explicit StreamPlace(std::atomic<int>& all) : count(all), number(++all) {}
    ~StreamPlace() { --count; }
    StreamPlace(const StreamPlace&) = delete;
    StreamPlace& operator=(const StreamPlace&) = delete;
    std::atomic<int>& count;
    const int number;
  };

  bool process_and_close_socket(socket_t socket) override {
    ConnectionStream connection(socket, options_, stopping_);
    for (std::size_t left = kMaxRequests; left > 0; --left) {
      // A new connection may always say what it wants; one that was served gives way where others wait.
      if (!connection.WaitForRequest(left == kMaxRequests ? stopping_ : crowded_)) break;
      bool closed = false;
      close_after_answer = false;
      if (!process_request(connection, left == 1, closed, nullptr) || closed) break;
      if (close_after_answer || !connection.intact()) break;
    }
    shutdown(socket, SHUT_RDWR);
    close(socket);
    return true;
  }

  void Handle(const httplib::Request& request, httplib::Response& response) {
    Answer(handler_(Translate(request)), response);
  }

  void Answer(HttpResponse&& from, httplib::Response& to) {
    std::shared_ptr<StreamPlace> place;
    if (from.stream) {
      place = std::make_shared<StreamPlace>(streams_);
      if (place->number > options_.max_streams) {
        from = HttpError(503, "too many streams are open");
        place.reset();
      }
    }
    to.status = from.status;
    for (const auto& [name, value] : from.headers) to.set_header(name, value);
    if (place != nullptr) {
      to.set_chunked_content_provider(
          from.type, [this, place, next = std::move(from.stream)](std::size_t, httplib::DataSink& sink) {
            try {
              std::string piece;
              if (stopping_ || !next(piece)) {
                sink.done();
                return true;
              }
              return piece.empty() || sink.write(piece.data(), piece.size());
            } catch (...) {  // The library catches only what the making of an answer throws.
              return false;
            }
          });
    } else if (from.status != 304 && from.status != 204) {
      to.set_content(from.body, from.type);
    }
  }

  const HttpOptions options_;
  const HttpServer::Handler handler_;
  std::atomic<bool> stopping_ = false;
  std::atomic<bool> crowded_ = false;
  std::atomic<int> streams_ = 0;
  int port_ = 0;
  std::thread thread_;
};

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
HttpServer::~HttpServer() = default;

Result<std::unique_ptr<HttpServer>> HttpServer::Start(const HttpOptions& options, Handler handler) {
  auto impl = std::make_unique<Impl>(options, std::move(handler));
  if (auto listening = impl->Listen(); !listening) return tl::unexpected(listening.error());
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

int HttpServer::port() const {
  return impl_->port();
}

int HttpServer::streams() const {
  return impl_->streams();
}

}  // namespace cairn
