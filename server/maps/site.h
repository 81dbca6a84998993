// One site: its joint map, its map versions, and their publication. Robots pass their changed chunks to the
// site. At maps.publish_rate_hz the changed tiles are rendered, encoded, given the next version number and
// published.
//
// A switch to another map version is atomic for readers. Every session gets a correction through its own
// queue and continues with its part of that version. Changes that the sessions send meanwhile are stored
// apart. When all sessions have answered, the whole map changes at once under epoch + 1: every tile is
// published again, and removed tiles are published as deleted. What people have said about the map (map_edits.h) stays,
// and moves with the keyframes near it (edit_anchors.h).
// Thread rule: any thread may call; the work runs on the site's strand; readers get immutable snapshots. Work
// that ends with an exception is logged and dropped, and the site continues.
#pragma once

#include <asio/post.hpp>
#include <asio/strand.hpp>
#include <asio/thread_pool.hpp>
#include <atomic>
#include <chrono>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/mutex.h"
#include "common/service/generation.h"
#include "common/service/names.h"
#include "server/maps/edit_anchors.h"
#include "server/maps/grid_agreement.h"
#include "server/maps/joint_map.h"
#include "server/maps/map_edits.h"
#include "server/maps/map_snapshot.h"
#include "server/maps/map_versions.h"
#include "server/maps/maps_options.h"
#include "server/maps/memory_keeper.h"
#include "server/ops/heartbeat.h"
#include "server/ops/start_control.h"
#include "server/outbound.h"
#include "server/store/journal.h"

namespace cairn::server {

// Who wants a map version: a person who has chosen it, a job that a person has asked for, a person who has said where a
// robot is, a job that joins robots by itself, or one that fits robots to each other by itself. The last two must not
// undo what a person has chosen.
enum class EnabledBy : std::uint8_t { kPerson, kJob, kSaid, kJoin, kAlignment };

// A version switch under way. It is complete when no session is awaited.
struct VersionSwitch {
  std::uint32_t version = 0;
  EnabledBy by = EnabledBy::kPerson;
  std::set<SessionId> awaited;
  std::map<SessionId, slam::OccupancyGrid::Chunks> staged;  // The new grids of the sessions that have answered,
  DrawnPaths drawn;                                         // and where their keyframes lie in these.
  // Those that are not joined, because they could not follow or because the version says so.
  std::set<SessionId> apart;
  std::map<SessionId, RobotGrid> displaced;
  std::function<void(Result<std::uint32_t>)> done;
  std::shared_ptr<std::atomic<bool>> completed = std::make_shared<std::atomic<bool>>(false);  // Correction::completed.
};

class Site : public std::enable_shared_from_this<Site> {
 public:
  using Clock = std::chrono::steady_clock;
  // Receives a map version; called once, on the site's strand. INTERNAL if the work ended with an exception.
  using Done = std::function<void(Result<std::uint32_t>)>;
  // Asked once, on the site's strand, before the work begins; false: the work is not done, and the answer is CANCELLED.
  using Wanted = std::function<bool()>;

  // The epoch and the version with which the map begins: above those of a deleted site of the same name, because a
  // client may still know them. And the number of its coordinate frame (SessionState::map_frame).
  struct Beginning {
    std::uint32_t epoch = 0;
    std::uint64_t tile_version = 0;
    std::uint64_t map_frame = 1;
  };

  // `journal`: null if nothing is stored. `generation`: the number of this start of the server.
  Site(const std::string& name, double resolution_m, const MapsOptions& options, asio::thread_pool& pool,
       Outbound& outbound, Journal* journal = nullptr, Generation generation = 0,
       const Beginning& beginning = {0, 0, 1});

  // Restores what an earlier server has stored: the epoch, the versions, and the parts of the map that were drawn by
  // sessions that no longer exist. Records that cannot be read are set aside; without the enabled version, the newest
  // one that is there counts as enabled. REQUIRES: no other function was called before. FAILED_PRECONDITION: the cells
  // have another size here.
  Result<void> Restore(const StoredSite& stored, StartControl& control);
  // Whether the server of this generation completed the switch that began this epoch. REQUIRES: called before the
  // threads start.
  [[nodiscard]] bool Switched(std::uint32_t epoch, Generation generation) const;

  // A session that draws here. One that has ended stays a member while its GridOwner exists, because its part of the
  // map can still be corrected; so a robot may have several.
  struct Member {
    SessionId session = 0;
    NameId robot = 0;
    std::weak_ptr<GridOwner> owner;
    std::uint32_t epoch = 0;  // Of the map, that the session was told last.
    bool fragment = false;    // What it draws is not shown until a map version joins it (RobotGrid::fragment).
    bool ended = false;
  };
  void Join(Member member);
  [[nodiscard]] std::uint64_t map_frame() const { return map_frame_; }
  // The map goes on in the frame of another one, for example of a server that has lost its state. REQUIRES: nothing is
  // drawn yet.
  void AdoptFrame(std::uint64_t map_frame);
  // Others have begun the map: some of it is shown, or a part of it cannot be read or is still being loaded. A robot
  // that does not say where it is must not begin the map anew. Thread rule: any thread.
  [[nodiscard]] bool begun() const { return lost_part_ || loading_ || snapshot()->drawn; }
  void LosePart() { lost_part_ = true; }
  // Whether the stored site names the session among those that draw it. Thread rule: any thread, after Restore.
  [[nodiscard]] bool WasDrawnBy(SessionId session) const { return stored_members_.contains(session); }
  void SetLoading(bool loading) { loading_ = loading; }
  // What the session draws is not shown from now on, as that of a fragment.
  void Hide(SessionId session);
  // Compares what the session has drawn with what earlier ones have drawn there. `refuses` is asked once, on the
  // strand; if it says so, what the session draws is not shown from then on, as that of a fragment. While the map is
  // being switched nothing is compared. The robot has begun at `T_map_robot_start`.
  using Refuses = std::function<bool(const GridAgreement&)>;
  void CheckStart(SessionId session, const Pose2& T_map_robot_start, Refuses refuses);
  // Changes that wait for the strand are merged: the newest form of each chunk is kept, so that a site that is slow
  // holds at most the chunks that its sessions have.
  void Change(GridChange&& change);
  // The session has ended: what it has drawn is the past from now on (layer_sum.h).
  void End(SessionId session);
  // Called when the session is removed. Its part of the map stays and is stored, because the session no longer is.
  void Leave(SessionId session);
  // The site is deleted: after this it stores and publishes nothing. `done` receives what it had published
  // last, on the strand, when everything that was asked before is finished. A switch of the map version under way
  // fails.
  void Retire(std::function<void(std::shared_ptr<const MapSnapshot>)> done);
  // The server stops: after this no session is told anything, because its pool is about to end. `done` is called on the
  // strand when everything that was asked before is finished, and what that changed is published. A switch of the map
  // version under way fails.
  void Close(std::function<void()> done);
  // Adds a disabled version; `done` receives its number.
  void AddVersion(MapVersion&& version, Done done, Wanted wanted = {});
  using EnabledBy = server::EnabledBy;
  // UNAVAILABLE: another switch is under way. NOT_FOUND: the version does not exist or has been removed.
  // FAILED_PRECONDITION: kAlignment, and a person has chosen the enabled version; or kJoin or kAlignment, and the
  // version joins a session that is kept apart.
  void Enable(std::uint32_t version, Done done, Wanted wanted = {}, EnabledBy by = EnabledBy::kPerson);
  // Whether a job may enable a version without being asked: no person has chosen the enabled one, and there is no newer
  // one about which a person has not decided. Thread rule: any thread.
  [[nodiscard]] bool MayBeAligned() const;
  // Sessions that a person has taken out of the map, by enabling a version in which they are fragments. No job joins
  // them by itself, until a person enables a version in which they are joined, or a job that a person has asked for
  // joins them. Thread rule: any thread.
  [[nodiscard]] std::set<SessionId> kept_apart() const {
    const MutexLock lock(mutex_);
    return kept_apart_;
  }
  // What a person says about the map (common/map/map_edit.h); `done` receives the edit's number, on the strand.
  // FAILED_PRECONDITION: nothing is drawn yet, or not near it. NOT_FOUND: the site is deleted. Else errors of
  // MapEdits::Add.
  using EditDone = std::function<void(Result<std::uint64_t>)>;
  void AddEdit(MapEdit&& edit, EditDone done);
  // `done` receives the number of this change. NOT_FOUND: there is no such edit, or the site is deleted.
  void RemoveEdit(std::uint64_t id, EditDone done);
  // A robot is about to begin the map. Where nothing is drawn, edits belong to a map that is gone, and are removed.
  void ForgetEditsOfLostMap();
  // Renders and publishes what changed, soon; does nothing where an earlier call still waits for the strand. Then calls
  // `then`, if there is one.
  void Publish(std::function<void()> then = {}, Clock::time_point now = Clock::now());
  // Called once, on the strand; INTERNAL if the work ended with an exception.
  using SnapshotDone = std::function<void(Result<std::shared_ptr<const MapSnapshot>>)>;
  // The map with the layer of disagreement as it is now. The layer costs as much as the map itself, so it is made when
  // somebody asks for it, and kept up to date until nobody has asked for a minute before the `now` of Publish.
  void AskDisagreement(SnapshotDone done, Clock::time_point now = Clock::now());
  // What one session alone has drawn, as a map of its own: for a fragment in its own frame. Only tiles of `level` are
  // in it. NOT_FOUND: the session has drawn nothing. REQUIRES: there is such a level.
  void AskPartOf(SessionId session, int level, SnapshotDone done);
  // Of all sites together (memory_shares.h); 0: no limit. `clearly_below`: all together take clearly less than they
  // may. Thread rule: any thread.
  void SetMemoryShare(std::uint64_t bytes, bool clearly_below) { memory_.SetShare(bytes, clearly_below); }
  // The map takes more memory than it may, and nothing is left that it could give up. So it is called until it takes
  // clearly less (memory_shares.h). Thread rule: any thread.
  [[nodiscard]] bool gives_no_more() const { return memory_.gives_no_more(); }
  // A session that has ended and that the site can do without, because others have drawn all of its area; 0: none. It
  // may be removed, if no robot goes on with it: then Leave is called. Thread rule: any thread.
  [[nodiscard]] SessionId spare_session() const { return memory_.spare_session(); }
  // Does nothing but call `done` on the strand, to show that the strand makes progress.
  void Probe(std::function<void()> done);

  [[nodiscard]] std::shared_ptr<const MapSnapshot> snapshot() const {
    const MutexLock lock(mutex_);
    return snapshot_;
  }
  // The highest number that a version knows. REQUIRES: called before the threads start.
  [[nodiscard]] SessionId LastSession() const;
  [[nodiscard]] Pulse pulse() const { return {handled_ + encoded_, handled_ != asked_}; }

 private:
  class Ticket;
  class GivesUp;
  struct Drawing {
    slam::OccupancyGrid::Chunks chunks;  // A null chunk: removed.
    slam::OccupancyGrid::Looks looks;
    DrawnPath drawn;  // The newest.
  };
  using Changes = std::map<SessionId, Drawing>;

  static void Merge(GridChange&& change, Changes& into);
  // Does `act` on the strand, after everything that was asked for before. If that throws, nothing was asked for.
  template <typename Act>
  void Run(Act act) CAIRN_EXCLUDES(mutex_);
  template <typename Act>
  void Post(Act act) CAIRN_REQUIRES(mutex_);
  void LogFailure(const std::exception& error) const;
  // The functions below run on the strand only.
  void Apply(SessionId session, const Drawing& drawing);
  void Begin(std::uint32_t version, Done done, EnabledBy by);
  void KeepApart(const VersionSwitch& complete);
  void FailSwitch(StatusCode code, const std::string& why);
  void Settle(std::uint32_t version, SessionId session, std::optional<Adopted>&& adopted);
  std::shared_ptr<GridOwner> OwnerOf(SessionId session) const;
  bool GiveMissedPart(const Member& member);
  void StageGone(SessionId session);
  void SetHidden(SessionId session);
  void CommitIfComplete();
  void Render();
  void RenderAll();
  [[nodiscard]] std::vector<TileKey> RenderDisagreement();
  void CountMemory(const MapSnapshot& snapshot) noexcept;
  void StayWithinMemory(Clock::time_point now);
  [[nodiscard]] std::vector<TileKey> DropDisagreement();
  void ExpireDisagreement(Clock::time_point now);
  // Stores what people have said about the map, and publishes it. Returns its version.
  std::uint64_t ShowEdits();
  [[nodiscard]] Result<void> CheckNear(const MapEdit& edit) const;
  // Keyframes lie elsewhere now, or there are other ones: edits move with them, and are stored.
  void FollowPaths(const DrawnPaths& changed);
  // Nothing can hang on keyframes of this session any more.
  void ForgetPath(SessionId session);
  // What hangs on keyframes of this session hangs on those of sessions that still exist from now on, where there are
  // some.
  void AnchorElsewhere(SessionId session);
  [[nodiscard]] bool AnchorNew();
  enum class AnchorTo : std::uint8_t { kLiving, kAll };
  [[nodiscard]] EditAnchors AnchorsOf(const MapEdit& edit, AnchorTo to) const;
  [[nodiscard]] bool Sees(const Eigen::Vector2d& from, const Eigen::Vector2d& point) const;
  // `differing`: changed tiles of the layer of disagreement. `all`: those that did not change get the new epoch, too.
  void Refresh(const std::vector<TileKey>& changed, const std::vector<TileKey>& differing, bool all);
  [[nodiscard]] std::map<TileKey, TileSet::TilePtr> Encoded(const std::vector<TileKey>& changed,
                                                            const std::map<TileKey, JointMap::Cells>& cells,
                                                            const TileSet& before, bool all);
  void Send();
  void StoreSite();
  void StoreVersion(std::uint32_t version);
  void StoreLayer(SessionId session);
  // Everything that `act` stores is on the disk together, or nothing of it.
  template <typename Act>
  void StoreTogether(const Act& act);
  void Put(const RecordKey& key, Journal::Bytes bytes);
  void RemoveRecords(const RecordRange& range);
  void StoreEverything();
  void KeepAsLayer(SessionId session);
  [[nodiscard]] RobotGrid PartOfGone(SessionId session) const;
  void RemoveOtherLayers();
  [[nodiscard]] std::vector<SessionId> ShownLayers() const;  // The one that ended first comes first.
  void MergeOldestLayers(std::size_t most);
  void RemoveOldVersions();
  Result<void> RestoreVersions(const StoredSite& stored, StartControl& control);
  Result<void> RestoreLayers(StartControl& control);
  void PutAside(const std::string& what, const Status& why);
  MapInfo InfoOf(const TileSet& tiles) const;

  const std::string name_;
  const NameId site_id_;
  const double resolution_m_;
  Outbound& outbound_;
  const Generation generation_;
  asio::strand<asio::thread_pool::executor_type> strand_;

  // The members below are used on the strand only.
  Journal* journal_;  // Null where nothing is stored.
  bool retired_ = false;
  JointMap joint_;
  MapEdits edits_;
  DrawnPaths paths_;  // Of sessions that are shown, as far as they are known.
  MapVersions versions_;
  MemoryKeeper memory_;
  std::uint32_t epoch_ = 0;
  std::uint64_t tile_version_ = 0;
  std::map<SessionId, Member> members_;
  Switches switches_;
  // Removed sessions whose parts of the map stay. One number may stand for several of them (MergeOldestLayers).
  std::set<SessionId> layers_;
  std::set<SessionId> merged_;             // Those of them that stand for several sessions.
  std::set<SessionId> unreadable_layers_;  // They stay in the store as they are.
  std::optional<Journal::Edit> together_;  // What StoreTogether has gathered.
  // An earlier one had no room, so that the next one stores everything; and the sessions that it was to forget.
  bool incomplete_ = false;
  std::vector<SessionId> unforgotten_;
  std::set<std::uint32_t> stored_versions_;
  bool info_changed_ = true;
  std::optional<VersionSwitch> switch_;
  std::atomic<bool> chosen_ = false;  // The enabled version, by a person. Written on the strand only.
  std::set<TileKey> unsent_;          // Tiles (or tombstones) to publish.
  // Until then the layer of disagreement is kept up to date.
  std::optional<Clock::time_point> disagreement_wanted_;

  std::atomic<bool> lost_part_{false}, loading_{false};
  std::set<SessionId> stored_members_;  // Set by Restore, before others know the site.
  std::atomic<std::uint64_t> map_frame_;
  std::atomic<std::uint64_t> asked_{0}, handled_{0};  // Pieces of work posted to the strand, and finished on it.
  std::atomic<std::uint64_t> encoded_{0};             // Tiles: a piece of work that encodes thousands is progress.
  mutable Mutex mutex_;
  std::shared_ptr<const MapSnapshot> snapshot_ CAIRN_GUARDED_BY(mutex_);
  std::set<SessionId> kept_apart_ CAIRN_GUARDED_BY(mutex_);    // Written on the strand only.
  std::shared_ptr<Changes> waiting_ CAIRN_GUARDED_BY(mutex_);  // To be added to, until the strand takes them.
  std::atomic<bool> publish_waits_ = false;
};

template <typename Act>
void Site::Run(Act act) {
  const MutexLock lock(mutex_);
  waiting_.reset();  // Later changes belong after `act`.
  Post(std::move(act));
}

template <typename Act>
void Site::Post(Act act) {
  ++asked_;
  try {
    asio::post(strand_, [self = shared_from_this(), act = std::move(act)]() mutable {
      try {
        act(*self);
      } catch (const std::exception& error) {
        self->LogFailure(error);
      }
      ++self->handled_;
    });
  } catch (...) {
    --asked_;  // Otherwise the site would seem to be busy for ever.
    throw;
  }
}

template <typename Act>
void Site::StoreTogether(const Act& act) {
  together_.emplace();
  try {
    act();
    if (incomplete_) StoreEverything();
  } catch (...) {
    together_.reset();
    incomplete_ = true;
    throw;
  }
  Journal::Edit edit = *std::exchange(together_, std::nullopt);
  if (journal_ == nullptr) return;
  edit.forgotten.insert(edit.forgotten.end(), unforgotten_.begin(), unforgotten_.end());
  unforgotten_ = edit.forgotten;
  incomplete_ = !journal_->Apply(std::move(edit));
  if (!incomplete_) unforgotten_.clear();
}

}  // namespace cairn::server
