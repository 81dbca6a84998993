// Who is here: every session by robot, and who may open one. The door's events are routed from here to the session they
// belong to; scans without one are counted as unclaimed.
// Rules of opening: a robot has one session. Whoever names it (its token) resumes it, where its owner is the same
// client or is not alive; its start pose is then ignored. A session that was started elsewhere and is not known here is
// refused (FAILED_PRECONDITION): its start pose is out of date. A new session of a robot whose owner is not alive
// replaces the one it has where the request says where the robot starts; otherwise it goes on with it, and the robot
// has to be found in its map before it is localized (slam/recovery.h), because nobody knows whether it is still where
// it was, or even the same robot. The client that loses its session is told; another live client is refused
// (ALREADY_EXISTS). An ended session gives way to a new one. When max_robots is reached, the ended session that is
// oldest is forgotten first (its part of the map stays), then the one suspended for longest. A session suspended for
// too long is ended. Thread rule: any thread; nothing here waits for an estimator.
#pragma once

#include <asio/thread_pool.hpp>
#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "server/maps/atlas.h"
#include "server/outbound.h"
#include "server/robots/robots_options.h"
#include "server/robots/session.h"
#include "server/robots/unclaimed_streams.h"
#include "server/store/journal.h"

namespace cairn::server {

class Roster {
 public:
  // Sessions draw the sites of the atlas; a robot that opens a session enters its site there.
  // `journal`: null where nothing is stored.
  Roster(const RobotsOptions& options, const slam::MapperOptions& mapper, asio::thread_pool& pool, Outbound& outbound,
         Atlas& atlas, Journal* journal = nullptr);

  ~Roster();

  // The sessions of the servers before this one, taken up where their journals end, in parallel on the pool; the sites
  // must have been restored. Before anything else is called. FAILED_PRECONDITION: a newer server has written them. A
  // session whose records are damaged is left out, with the reason in the log.
  Result<void> Restore();

  // Opens, resumes, refuses or ends; the answer goes out as a SessionState.
  void Take(const SessionRequest& request);
  void Take(ScanArrival&& arrival);
  void Take(OdometryArrival&& arrival);
  void Take(const ClientLiveliness& liveliness);
  // NOT_FOUND without such a session.
  Result<void> End(const std::string& robot);
  // Publishes what is due, and ends sessions whose robots stayed away for too long.
  void Tick();

  [[nodiscard]] std::shared_ptr<Session> Find(const std::string& robot) const;
  [[nodiscard]] std::vector<std::shared_ptr<Session>> All() const;
  [[nodiscard]] std::vector<std::shared_ptr<Session>> InSite(const std::string& site) const;
  [[nodiscard]] std::uint64_t unclaimed_overflow() const;

 private:
  Result<void> Admit(const SessionRequest& request);
  static Result<void> MayTakeOver(const Session& session, const SessionRequest& request);
  Result<void> Resume(Session& session, const SessionRequest& request);
  Result<void> Replace(Session& session, const SessionRequest& request);
  void TellDisplaced(const SessionState& before, const SessionRequest& request);
  Result<void> Open(const SessionRequest& request);
  std::shared_ptr<Session> Make(SessionId id, const SessionRequest& request, std::uint32_t map_epoch,
                                const std::shared_ptr<Site>& site) const;
  Journal::Durable DurableFor(const std::shared_ptr<Session>& session) const;
  Result<std::shared_ptr<Session>> RestoreOne(SessionId id);
  // The session that has to be removed before this robot can have a new one; null where there is room.
  Result<std::shared_ptr<Session>> GivesWay(NameId robot_id) const CAIRN_REQUIRES(mutex_);
  void Refuse(const SessionRequest& request, Status status);
  void RetireGone();
  void SendRefusals();

  const RobotsOptions options_;
  const slam::MapperOptions mapper_;
  asio::thread_pool& pool_;
  Outbound& outbound_;
  Atlas& atlas_;
  Journal* const journal_;
  // The roster is being destroyed: sessions that go now have not left.
  const std::shared_ptr<std::atomic<bool>> closing_ = std::make_shared<std::atomic<bool>>(false);

  mutable Mutex mutex_;
  std::map<NameId, std::shared_ptr<Session>> sessions_ CAIRN_GUARDED_BY(mutex_);
  UnclaimedStreams unclaimed_ CAIRN_GUARDED_BY(mutex_);
  std::deque<SessionRefusal> unsent_ CAIRN_GUARDED_BY(mutex_);           // Refusals the outbound lane had no room for.
  std::vector<std::shared_ptr<Session>> gone_ CAIRN_GUARDED_BY(mutex_);  // Removed, and not retired on the wire yet.
  SessionId next_id_ CAIRN_GUARDED_BY(mutex_) = 1;
};

}  // namespace cairn::server
