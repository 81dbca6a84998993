// Asks the server and waits for the whole answer. One method per question; each returns the answer, the server's error
// (its code and message), or why there is none: kUnavailable where no server is there, kDeadlineExceeded where it was
// too slow. Finding the server counts towards the deadline.
// Thread rule: any number of threads may ask at once; each waits for its own answer. Not from a wire callback.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/lib/reply_assembly.h"
#include "common/mutex.h"
#include "common/wire/bus.h"

namespace cairn::client {

struct QueryClientOptions {
  double timeout_s = 2.0;  // Of every question that names no other.
};

// The map (or part of it) as of one moment.
struct TileAnswer {
  std::uint32_t epoch = 0;
  std::uint64_t version = 0;
  std::vector<Tile> tiles;
};

struct TileQuery {
  std::string site;
  Area area;
  std::uint32_t level = 0;
  std::uint32_t since_epoch = 0;
  std::uint64_t since_version = 0;  // With the map's epoch: only what changed since.
};

class QueryClient {
 public:
  [[nodiscard]] static Result<std::unique_ptr<QueryClient>> Create(wire::Bus& bus,
                                                                   const QueryClientOptions& options = {});
  ~QueryClient();

  // Any request, with the parts of its answer put together. Client and sequence are set here.
  [[nodiscard]] Result<Reply> Ask(const Request& request, double timeout_s);
  [[nodiscard]] Result<Reply> Ask(const Request& request) { return Ask(request, options_.timeout_s); }

  [[nodiscard]] Result<std::string> Ping();  // The server's version.
  [[nodiscard]] Result<PoseReport> Pose(const std::string& robot, std::optional<Stamp> at = {});
  [[nodiscard]] Result<Trajectory> Path(const std::string& robot, bool smoothed = false);
  [[nodiscard]] Result<TileAnswer> Tiles(const TileQuery& query);
  [[nodiscard]] Result<std::vector<LandmarkReport>> Landmarks(const std::string& site, const Area& area = {});
  [[nodiscard]] Result<std::vector<MapInfo>> Maps(const std::string& site = "");
  [[nodiscard]] Result<std::vector<RobotStatus>> Robots(const std::string& robot = "");
  [[nodiscard]] Result<Job> SubmitJob(const std::string& site, JobKind kind, bool enable = true);
  [[nodiscard]] Result<Job> GetJob(std::uint64_t id);
  [[nodiscard]] Result<Job> CancelJob(std::uint64_t id);
  [[nodiscard]] Result<std::vector<Job>> Jobs(const std::string& site = "");
  [[nodiscard]] Result<void> EndSession(const std::string& robot);
  [[nodiscard]] Result<void> EnableMap(const std::string& site, std::uint32_t map_version);

 private:
  using Deadline = std::chrono::steady_clock::time_point;

  QueryClient(wire::Bus& bus, const QueryClientOptions& options);
  void OnReply(Reply&& part);
  [[nodiscard]] Result<void> Greet(Deadline deadline, double timeout_s);
  [[nodiscard]] Result<Reply> AskOnce(Request request, Deadline deadline, double timeout_s);

  const wire::Bus& bus_;
  const QueryClientOptions options_;
  const ClientId id_;

  Mutex mutex_;
  CondVar changed_;
  bool greeted_ CAIRN_GUARDED_BY(mutex_) = false;
  std::int64_t sequence_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::map<std::int64_t, ReplyAssembly> pending_ CAIRN_GUARDED_BY(mutex_);  // By sequence; what a caller waits for.

  std::unique_ptr<wire::Publication<Request>> requests_;
  std::unique_ptr<wire::Subscription> replies_;  // Last: its callbacks use everything above.
};

}  // namespace cairn::client
