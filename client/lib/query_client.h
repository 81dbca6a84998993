// Asks the server and waits for the whole answer. There is one method per question or command. A command that this
// program's permissions do not allow is refused here (kPermissionDenied). Each returns the answer, or the
// server's error (its code and message), or why there is no answer: kUnavailable where no server was found, and
// kDeadlineExceeded if the answer was late. The time needed to find the server counts towards the timeout.
// The client first waits for an answered ping. A question without an answer is asked again within the timeout; a
// command is not, because it may have been carried out.
// If no ping is answered for a second although a server is there, the client joins the domain again: forged messages
// may keep it from receiving (RobotClient).
// Thread rule: any number of threads may ask at once, and each waits for its own answer. Do not ask from a callback of
// the wire: the answer arrives on the thread that the callback would block.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/lib/deadline.h"
#include "client/lib/reply_assembly.h"
#include "common/map/occupancy_image.h"
#include "common/mutex.h"
#include "common/wire/bus.h"

namespace cairn::client {

struct QueryClientOptions {
  double timeout_s = 2.0;  // How long each method waits for its answer.
};

struct StatusAnswer {
  std::vector<RobotStatus> robots;
  // Why new data is not stored, and what was not restored; empty if there is neither, or if the server stores nothing.
  std::string degraded;
  Refusals refused;  // What the server has refused because of its sender.
  ServerLoad load;
};

struct PathAnswer {
  Trajectory poses;             // In the site's map frame, by increasing stamp.
  std::uint32_t map_epoch = 0;  // The map's epoch that the poses belong to.
};

// A part of the map as it was at one moment.
struct TileAnswer {
  Generation generation = 0;  // The server's; epoch and version count within it.
  std::uint32_t epoch = 0;
  std::uint64_t version = 0;
  std::vector<Tile> tiles;
};

struct TileQuery {
  std::string site;
  Area area;                // Only tiles that touch it. The default is the whole map.
  std::uint32_t level = 0;  // Level of the pyramid; 0 is the finest.
  // Only tiles that changed after this version of this epoch of this generation. Where the map has another epoch by
  // now, or the server another generation, all tiles come.
  Generation since_generation = 0;
  std::uint32_t since_epoch = 0;
  std::uint64_t since_version = 0;
  bool disagreement = false;  // Tiles that say by how much robots, or today and earlier runs, differ: 0..100.
};

class QueryClient {
 public:
  // `bus` outlives the client.
  [[nodiscard]] static Result<std::unique_ptr<QueryClient>> Create(wire::Bus& bus,
                                                                   const QueryClientOptions& options = {});
  ~QueryClient();

  // Times it joined anew: with a server that does not answer, and with DDS Security where none is found. Forged
  // messages can make either side deaf, and a handshake whose messages were lost may not come to an end.
  [[nodiscard]] int renewed() const;

  // The server's version.
  [[nodiscard]] Result<std::string> Ping();

  // The newest pose, or the pose at a stamp of the robot's clock, interpolated. Past poses lie where they are in the
  // present map, which may have been corrected since. kUnavailable: the server has not used a
  // scan that late yet; kOutOfRange: the stamp is before the robot's first scan.
  [[nodiscard]] Result<PoseReport> Pose(const std::string& robot, std::optional<Stamp> at = {});
  // The places where the robot may be, the most believed one first. While it is not localized: where a job, or its own
  // searches, have found that it may be, at the stamps of these places; none where that is not known.
  [[nodiscard]] Result<std::vector<PoseHypothesis>> Hypotheses(const std::string& robot);
  // All poses so far, where they lie in the present map, or those of the smoothing job whose map is enabled
  // (kFailedPrecondition if there is none).
  [[nodiscard]] Result<PathAnswer> Path(const std::string& robot, bool smoothed = false);
  // Session, newest pose and ledgers of all robots, or of one (kNotFound if the server does not know it), and the state
  // of the server itself.
  [[nodiscard]] Result<StatusAnswer> ServerStatus(const std::string& robot = "");
  [[nodiscard]] Result<std::vector<RobotStatus>> Robots(const std::string& robot = "");
  // The namespaces of ROS 2 that the server sees, and why their robots are not on the map.
  [[nodiscard]] Result<Ros2Report> Ros2();
  // Ends the robot's session for good.
  [[nodiscard]] Result<void> EndSession(const std::string& robot);
  // The robot is not where the server believes. It is not localized until it has been found: near `T_map_robot` where
  // that is given, else anywhere. A robot that is not joined with the map of its site is joined there by a job, if what
  // it has seen agrees with the map. kFailedPrecondition: its session has ended, or it is not joined and no scan of it
  // was used.
  // The job that looks for it in the whole map of its site, or that joins it with the map there, if there is one.
  [[nodiscard]] Result<std::optional<Job>> Relocalise(const std::string& robot,
                                                      const std::optional<Pose2>& T_map_robot = {});
  // From now on the robot is only localised, in the map of its site, and nothing is drawn of it. kNotFound: the site
  // has no map yet.
  [[nodiscard]] Result<void> Localise(const std::string& robot);
  // It maps again, from where it is. kFailedPrecondition: it is not joined with the map of its site.
  [[nodiscard]] Result<void> MapAgain(const std::string& robot);

  // All maps.
  [[nodiscard]] Result<std::vector<MapInfo>> Maps();
  // The map of one site. kNotFound if the server has none of that name.
  [[nodiscard]] Result<MapInfo> Map(const std::string& site);
  [[nodiscard]] Result<TileAnswer> Tiles(const TileQuery& query);
  // What one robot alone has drawn: of a robot that is not joined with the map of its site, in the frame of its start,
  // else in that of the map. kNotFound: the server does not know it, or it has drawn nothing.
  [[nodiscard]] Result<std::vector<Tile>> RobotTiles(const std::string& robot, std::uint32_t level = 0);
  // The whole map at one level. kUnavailable where nothing is drawn yet.
  [[nodiscard]] Result<OccupancyImage> MapImage(const std::string& site, std::uint32_t level = 0);
  // By how much robots, or today and earlier runs, differ: 0..100 in cells that at least two have seen. kUnavailable
  // where nobody differs.
  [[nodiscard]] Result<OccupancyImage> DisagreementImage(const std::string& site, std::uint32_t level = 0);
  [[nodiscard]] Result<std::vector<LandmarkReport>> Landmarks(const std::string& site, const Area& area = {});
  // Switches the site to one of its map versions. Returns the map as it is then.
  [[nodiscard]] Result<MapInfo> EnableMap(const std::string& site, std::uint32_t map_version);
  // Switches to the highest version below the enabled one; kFailedPrecondition if there is none.
  [[nodiscard]] Result<MapInfo> RollBackMap(const std::string& site);

  // What people have said about the map, in the order in which they did; later edits count where they overlap.
  [[nodiscard]] Result<std::vector<MapEdit>> MapEdits(const std::string& site);
  // Returns the edit with its number. kInvalidArgument: ValidateMapEdit. kFailedPrecondition: nothing is drawn yet.
  // kResourceExhausted: the site has as many as it may have.
  [[nodiscard]] Result<MapEdit> AddMapEdit(const std::string& site, const MapEdit& edit);
  // kNotFound: there is no such site or edit.
  [[nodiscard]] Result<void> RemoveMapEdit(const std::string& site, std::uint64_t id);

  // The sites that the server keeps as files.
  [[nodiscard]] Result<std::vector<SavedSite>> SavedSites();
  // Writes everything that the server has stored of the site into the file of this name, in place of one that is there;
  // an empty name is the site's. kNotFound: nothing is stored of such a site.
  [[nodiscard]] Result<SavedSite> SaveSite(const std::string& site, const std::string& name = "");
  // Loads a saved site; an empty site is named as in the file. kAlreadyExists: there is such a site, or one of its
  // robots has a session. kDataLoss: the file is damaged. kFailedPrecondition: a newer server has written it.
  [[nodiscard]] Result<void> LoadSite(const std::string& name, const std::string& site = "");
  // With all that is stored of it. kFailedPrecondition: a robot is active in it, or a job has not ended.
  [[nodiscard]] Result<void> DeleteSite(const std::string& site);
  // The file only; a site that was loaded from it stays.
  [[nodiscard]] Result<void> DeleteSavedSite(const std::string& name);

  // `enable`: the server switches the site to the job's map version as soon as the job succeeds.
  [[nodiscard]] Result<Job> SubmitJob(const std::string& site, JobKind kind, bool enable = true);
  [[nodiscard]] Result<Job> GetJob(std::uint64_t id);
  [[nodiscard]] Result<Job> CancelJob(std::uint64_t id);
  // Jobs of all sites, or of one.
  [[nodiscard]] Result<std::vector<Job>> Jobs(const std::string& site = "");
  // Asks for the job ten times a second until it has ended, and returns its last state. The timeout bounds each single
  // answer and not the whole wait. kAborted: a server without a state has started again, and the number is that of
  // another job. `keep_waiting` sees every state; where it returns false, the wait ends there.
  [[nodiscard]] Result<Job> WaitForJob(std::uint64_t id, const std::function<bool(const Job&)>& keep_waiting = {});

 private:
  QueryClient(wire::Bus& bus, const QueryClientOptions& options);
  void OnReply(Reply&& part);
  // kUnavailable with `none` where there is no tile.
  [[nodiscard]] Result<OccupancyImage> ImageOf(const TileQuery& query, const std::string& none);
  struct Wire {
    std::unique_ptr<wire::Bus> own;  // Null for the first, which uses the caller's.
    wire::Bus* bus = nullptr;
    // A new one each time: replies come in the partition that it chooses (wire/partitions.h), and forged messages may
    // have spoiled one of them.
    ClientId client = 0;
    std::unique_ptr<wire::Publication<Request>> requests;
    // Not every identity may send commands.
    Result<std::unique_ptr<wire::Publication<Command>>> commands = nullptr;

    [[nodiscard]] Result<void> Publish(const Request& request) const;
    std::unique_ptr<wire::Subscription> replies;
  };
  [[nodiscard]] Result<std::shared_ptr<Wire>> Connect(wire::Bus& bus);
  [[nodiscard]] std::shared_ptr<Wire> CurrentWire();
  [[nodiscard]] bool MayBeDeaf();
  void RenewIfSilent(Deadline began, std::chrono::seconds patience);
  void RenewIfAlone(bool secure);
  [[nodiscard]] bool CommandsMatched() const CAIRN_REQUIRES(mutex_);
  [[nodiscard]] Result<void> WaitForServer(bool command, Deadline deadline);
  [[nodiscard]] bool PingOnce(Deadline began, Deadline deadline);
  [[nodiscard]] Result<Reply> Ask(const Request& request);
  [[nodiscard]] Result<Job> AskForJob(const Request& request);
  // `begun`: until when the first part must be here. `every`: how long after one question it is sent again, as long as
  // no part of an answer is here; only for what may be asked twice.
  [[nodiscard]] Result<Reply> Exchange(Request request, Deadline begun, Deadline deadline, Deadline::duration every);

  wire::Bus& bus_;
  const QueryClientOptions options_;

  mutable Mutex mutex_;
  CondVar changed_;
  bool server_found_ CAIRN_GUARDED_BY(mutex_) = false;
  bool pinging_ CAIRN_GUARDED_BY(mutex_) = false;  // A thread waits for an answer to its ping.
  std::int64_t sequence_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::map<std::int64_t, ReplyAssembly> pending_ CAIRN_GUARDED_BY(mutex_);  // By sequence; what callers wait for.
  Deadline last_answer_ CAIRN_GUARDED_BY(mutex_);                           // Last answer, however late.
  Deadline renewed_ CAIRN_GUARDED_BY(mutex_);                               // Last time it joined anew, or began to,
  std::optional<Deadline> alone_since_ CAIRN_GUARDED_BY(mutex_);            // No server is found.
  std::chrono::seconds renewal_pause_ CAIRN_GUARDED_BY(mutex_){1};          // and how long until it may again.
  int times_renewed_ CAIRN_GUARDED_BY(mutex_) = 0;
  std::shared_ptr<Wire> wire_ CAIRN_GUARDED_BY(mutex_);  // Last: its callbacks use everything above.
};

}  // namespace cairn::client
