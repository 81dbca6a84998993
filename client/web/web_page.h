// Answers the requests of the page: its files, the state of the server as a stream of events, tiles, paths, downloads,
// and, for those who have the token, commands. Everything is asked through the client library, so a server sees one
// client, however many people look. The README has the table of addresses.
// Thread rule: Answer from any thread.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/lib/query_client.h"
#include "client/web/answer_cache.h"
#include "client/web/server_watch.h"
#include "client/web/site_maps.h"
#include "client/web/viewer.h"
#include "common/http/http_server.h"
#include "common/log_line.h"

namespace cairn::web {

struct WebOptions {
  std::string token;  // Who sends it may send commands. Empty: nobody may.
  // Called after each command that was sent to the server, on the thread that answers. Null: nothing is logged.
  std::function<void(const std::string& message, const LogSubject& fields)> log = nullptr;
};

class WebPage {
 public:
  // `bus` outlives the page, and the page outlives the HTTP server and its streams.
  [[nodiscard]] static Result<std::unique_ptr<WebPage>> Create(wire::Bus& bus, const WebOptions& options);

  // If the server was asked for the answer, its header X-Request-Id holds the id of the request (RequestId).
  [[nodiscard]] HttpResponse Answer(const HttpRequest& request);
  [[nodiscard]] ServerWatch& watch() { return *watch_; }
  [[nodiscard]] const SiteMaps& maps() const { return maps_; }

 private:
  using Parts = std::vector<std::string>;  // Of a path, between its slashes.

  WebPage(wire::Bus& bus, const WebOptions& options) : options_(options), maps_(bus), states_(!options.token.empty()) {}
  [[nodiscard]] HttpResponse AnswerGet(const HttpRequest& request, const Parts& parts);
  [[nodiscard]] HttpResponse AnswerAboutSite(const HttpRequest& request, const Parts& parts);
  [[nodiscard]] HttpResponse AnswerPost(const HttpRequest& request, const Parts& parts);
  [[nodiscard]] HttpResponse CommandRobot(const std::string& robot, const std::string& command,
                                          const std::string& body);
  [[nodiscard]] HttpResponse Relocalise(const std::string& robot, const std::string& body);
  [[nodiscard]] HttpResponse CommandSite(const std::string& site, const std::string& command, const std::string& body);
  [[nodiscard]] HttpResponse Events(const std::string& site);
  [[nodiscard]] HttpResponse TileFile(const HttpRequest& request, const Parts& parts);
  [[nodiscard]] HttpResponse MapFile(const std::string& site, const std::string& name);
  [[nodiscard]] HttpResponse Disagreement(const std::string& site);
  // What one robot alone has drawn, for those that are not joined with the map of their site (fragment_picture.h).
  [[nodiscard]] HttpResponse FragmentMap(const HttpRequest& request, const std::string& robot);
  [[nodiscard]] HttpResponse Metrics() const;
  [[nodiscard]] HttpResponse Landmarks(const std::string& site);
  [[nodiscard]] HttpResponse Edits(const std::string& site);
  [[nodiscard]] HttpResponse Path(const std::string& robot, bool smoothed);
  // The newest answer to a question that many people ask.
  [[nodiscard]] HttpResponse Recent(const std::string& question, const AnswerCache::Ask& ask);
  [[nodiscard]] bool MayCommand(const HttpRequest& request) const;
  void LogCommand(const HttpRequest& request, const Parts& parts, const std::string& id, int status,
                  std::chrono::steady_clock::time_point begun) const;

  const WebOptions options_;
  std::unique_ptr<ServerWatch> watch_;
  std::unique_ptr<client::QueryClient> queries_;
  SiteMaps maps_;
  StateTexts states_;
  AnswerCache answers_{std::chrono::seconds(4), 64};
  AnswerCache pictures_{std::chrono::seconds(10), 8};
  AnswerCache fragments_{std::chrono::seconds(4), 32};
  AnswerCache exports_{std::chrono::seconds(4), 2};  // A large map takes 100 MB while it is drawn: one at a time.
};

}  // namespace cairn::web
