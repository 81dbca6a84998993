// All sessions by robot, and the rules by which they are opened. Incoming events are passed to the session to which
// they belong; scans without a session are counted as unclaimed. Rules: a robot has one session.
// - A request that names the robot's session (its token) resumes it if it comes from the owner, or if the owner is not
//   alive. The start pose of the request is then ignored.
// - A request that is `started` and names a session that the server does not know is refused (FAILED_PRECONDITION),
//   because its start pose is out of date.
// - A request for a new session of a robot whose owner is not alive replaces the robot's present session if it says
//   where the robot starts, or if no scan of the present session was used yet: the start that the former owner said
//   holds only for what it saw. Otherwise it continues the present session, and the robot must be found in its map
//   before it is localized (slam/recovery/recovery.h), because nobody knows whether it is still where it was, or even
//   the same robot. The former owner is told. If another client that is alive owns the session, the request is refused
//   (ALREADY_EXISTS).
// - A session that has ended is replaced by a new one. It is kept as an earlier session (robots.max_earlier), so that
//   jobs can fit the robot to what it saw then.
// - A new session that does not say where the robot starts, in a site that has a map, is a fragment: its part is not
//   shown, and its robot is not localized, until a map version joins it (jobs/joiner.h).
// When max_robots is reached, the oldest ended session is removed first (its part of the map stays), then the one that
// has been suspended for longest, and for robots.place_kept_s at least: after a start of the server all robots are away
// for a moment. A session that has been suspended for too long is ended. Thread rule: any thread;
// nothing here waits for an estimator.
#pragma once

#include <asio/thread_pool.hpp>
#include <atomic>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "common/delay_meter.h"
#include "common/mutex.h"
#include "server/maps/atlas.h"
#include "server/maps/shared_known_grids.h"
#include "server/ops/start_control.h"
#include "server/outbound.h"
#include "server/robots/robots_options.h"
#include "server/robots/session.h"
#include "server/robots/unclaimed_streams.h"
#include "server/store/journal.h"

namespace cairn::server {

class CrashNote;
class RestoreMarks;

class Roster {
 public:
  // Sessions draw the sites of the atlas; a robot that opens a session enters its site there.
  // `journal`: null if nothing is stored.
  Roster(const RobotsOptions& options, const slam::MapperOptions& mapper, asio::thread_pool& pool, Outbound& outbound,
         Atlas& atlas, Journal* journal = nullptr);

  ~Roster();

  // Restores the sessions of earlier servers from their checkpoints and journals, in parallel on the pool. REQUIRES:
  // the sites were restored before, and no other function was called. A session whose records are damaged, or were
  // written by a newer server, is set aside (store/set_aside.h): its records stay, and its robot is told to open a new
  // one. A session during whose restoring earlier servers failed (RestoreMarks) is restored alone; after two failures
  // it is set aside, and only its part of the map is shown, from its checkpoint; after three, not even this. After
  // three crashes of its thread while its robot drove (RestoreMarks::kDrivingTogetherS) it is set aside as after two
  // failures, and its client is refused (INVALID_ARGUMENT): it would send again what the estimator cannot process.
  // A session whose checkpoint was made with other options of the estimator is restored from its whole journal, if that
  // is there and short; otherwise it keeps its options. `control`: CANCELLED if it was given up, after which the next
  // start does the same again.
  Result<void> Restore(StartControl& control);

  // Sessions that are loaded while the server runs. `first` of so many numbers that no other session gets.
  [[nodiscard]] SessionId ReserveIds(std::uint64_t count);
  // RESOURCE_EXHAUSTED: so many sessions more are too many (robots.max_robots). ALREADY_EXISTS: one of the robots has
  // one.
  [[nodiscard]] Result<void> HasRoomFor(const std::set<std::string>& robots) const;
  // Opens the loaded sessions as Restore does; their site is open. Where a robot has opened a session meanwhile, that
  // one stays and the loaded one has ended. Returns how many were opened. May take minutes; `control` ends it early.
  std::size_t OpenStored(const std::vector<SessionId>& ids, StartControl& control);
  // Ends all sessions of the site and removes them from memory; their records stay. The site is not found any more.
  // FAILED_PRECONDITION: a robot is active in it. NOT_FOUND: no such site.
  Result<std::shared_ptr<Site>> RemoveSite(const std::string& site);

  // Opens, resumes, refuses or ends; the answer goes out as a SessionState.
  void Take(const SessionRequest& request);
  void Take(ScanArrival&& arrival);
  void Take(OdometryArrival&& arrival);
  void Take(const ClientLiveliness& liveliness);
  // NOT_FOUND without such a session.
  Result<void> End(const std::string& robot, std::shared_ptr<Receipt> receipt = nullptr);
  // See Session::Relocalise. NOT_FOUND without a session, INVALID_ARGUMENT for a pose that is not finite or absurd.
  Result<void> Relocalise(const std::string& robot, std::optional<Pose2> T_map_robot,
                          const std::shared_ptr<Receipt>& receipt = nullptr);
  // From now on the robot is only localised in the map of its site, or it maps again. NOT_FOUND without a session, or
  // without a map. See Session::Localise.
  Result<void> Localise(const std::string& robot, bool only, const std::shared_ptr<Receipt>& receipt = nullptr);
  // Publishes what is due, and ends sessions whose robots stayed away for too long.
  void Tick();

  [[nodiscard]] std::shared_ptr<Session> Find(const std::string& robot) const;
  [[nodiscard]] Result<std::shared_ptr<Session>> FindOrFail(const std::string& robot) const;
  [[nodiscard]] std::vector<std::shared_ptr<Session>> All() const;
  // All sessions that draw the site, also the earlier ones of its robots.
  [[nodiscard]] std::vector<std::shared_ptr<Session>> InSite(const std::string& site) const;
  // The maps in which robots are localised.
  [[nodiscard]] SharedKnownGrids& known_grids() const { return *known_grids_; }
  [[nodiscard]] std::uint64_t unclaimed_overflow() const;
  // How long the robots' work has waited for a thread, over the last turns of all sessions.
  [[nodiscard]] DelayMeter::Quantiles waits() const;

 private:
  Result<void> Admit(const SessionRequest& request);
  static Result<void> MayTakeOver(const Session& session, const SessionRequest& request);
  Result<void> Resume(Session& session, const SessionRequest& request);
  Result<void> Replace(Session& session, const SessionRequest& request);
  void TellDisplaced(const SessionState& before, const SessionRequest& request);
  Result<void> Open(const SessionRequest& request);
  void StoreQuiet() CAIRN_REQUIRES(mutex_);
  [[nodiscard]] Status WhyNotKnown(const std::string& robot) const;
  // Whether a map of the site was begun, by others than `gone`, a session that gives way, if that has drawn nothing.
  [[nodiscard]] bool HasBegun(const std::string& name, const Site& site, const Session* gone) const
      CAIRN_REQUIRES(mutex_);
  [[nodiscard]] bool BeginsFragment(const SessionRequest& request, const Site& site, bool map_begun) const;
  std::shared_ptr<Session> Make(const StoredSession& stored, const std::shared_ptr<Site>& site,
                                const slam::MapperOptions& mapper) const;
  static void Enter(Site& site, const std::shared_ptr<Session>& session);
  // `gone`: the session that gives way, if one does. False, and nothing is changed: the site is not there any more, or
  // the robot has another session.
  bool TakePlace(const std::shared_ptr<Session>& session, const std::shared_ptr<Session>& gone, const Site& site);
  void Place(const std::shared_ptr<Session>& session, bool first) CAIRN_REQUIRES(mutex_);
  Journal::Durable DurableFor(const std::shared_ptr<Session>& session) const;
  // What restores sessions; the marks are null for sessions that are loaded while the server runs.
  struct Restoring {
    StartControl& control;
    RestoreMarks* marks = nullptr;
    bool with_journal = true;
  };
  using RestoredSession = Result<std::shared_ptr<Session>>;
  void MakeEarlier(const std::shared_ptr<Session>& ended) CAIRN_EXCLUDES(mutex_);
  std::vector<RestoredSession> RestoreEach(const std::vector<SessionId>& ids, const Restoring& how);
  Result<void> RestoreAll(const std::vector<SessionId>& ids, SessionId last, RestoreMarks& marks,
                          const std::filesystem::path& note, StartControl& control);
  Result<void> RestoreTogether(const std::vector<SessionId>& ids, const Restoring& how);
  Result<void> RestoreDoubtful(SessionId id, Restoring how);
  void Register(SessionId id, RestoredSession restored);
  RestoredSession NotRestored(SessionId id, Status why);
  RestoredSession RestoreOne(SessionId id, const Restoring& how);
  std::shared_ptr<Session> ReadCheckpointOnly(SessionId id, Restoring how);
  // One session as the store has it.
  struct Stored {
    StoredSession session;
    std::shared_ptr<Site> site;
    Result<std::optional<StoredCheckpoint>> checkpoint;
  };
  RestoredSession ReadBack(SessionId id, const Restoring& how);
  // A session in the state after the entries of its journal up to `position`, and the pieces of that checkpoint.
  struct Begun {
    std::shared_ptr<Session> session;
    std::uint64_t position = 0;
    StoredPieces pieces;
  };
  std::shared_ptr<Session> MakeToRestore(const Stored& stored, const slam::MapperOptions& mapper) const;
  Result<Begun> LoadCheckpoint(const Stored& stored, const slam::MapperOptions& mapper) const;
  RestoredSession FromJournal(const Stored& stored, const Restoring& how);
  RestoredSession GoOn(const Stored& stored, Begun begun, const Restoring& how);
  // The session that has to be removed before this robot can have a new one; null if there is room.
  Result<std::shared_ptr<Session>> GivesWay(NameId robot_id) const CAIRN_REQUIRES(mutex_);
  void Refuse(const SessionRequest& request, Status status);
  void RetireGone();
  void ForgetSpareSessions() CAIRN_EXCLUDES(mutex_);
  void SendRefusals();

  const RobotsOptions options_;
  const slam::MapperOptions mapper_;
  asio::thread_pool& pool_;
  Outbound& outbound_;
  Atlas& atlas_;
  Journal* const journal_;
  const std::shared_ptr<SharedKnownGrids> known_grids_ = std::make_shared<SharedKnownGrids>();
  // The roster is being destroyed. Sessions that are destroyed now stay in the store.
  const std::shared_ptr<std::atomic<bool>> closing_ = std::make_shared<std::atomic<bool>>(false);
  // Sessions may outlive the roster.
  struct Waits {
    Mutex mutex;
    DelayMeter meter CAIRN_GUARDED_BY(mutex);
  };
  const std::shared_ptr<Waits> waits_ = std::make_shared<Waits>();
  std::unique_ptr<CrashNote> crash_note_;  // Of the sessions, from when they are restored.

  mutable Mutex mutex_;
  std::map<NameId, std::shared_ptr<Session>> sessions_ CAIRN_GUARDED_BY(mutex_);
  UnclaimedStreams unclaimed_ CAIRN_GUARDED_BY(mutex_);
  std::deque<SessionRefusal> unsent_ CAIRN_GUARDED_BY(mutex_);  // Refusals not sent yet: the lane was full.
  // Sessions that are not the present ones of their robots any more, and whose keys are not retired yet.
  struct Leaving {
    std::shared_ptr<Session> session;
    bool keep = false;  // It becomes an earlier session.
  };
  std::vector<Leaving> gone_ CAIRN_GUARDED_BY(mutex_);
  std::map<SessionId, std::shared_ptr<Session>> earlier_ CAIRN_GUARDED_BY(mutex_);  // Ended; others follow them.
  SessionId next_id_ CAIRN_GUARDED_BY(mutex_) = 1;
  std::map<std::string, Status> not_restored_ CAIRN_GUARDED_BY(mutex_);  // By robot: why.
};

}  // namespace cairn::server
