// Writes the changes of all sessions, sites and jobs to the store, in the order in which they are handed over. No
// caller waits for the disk: a thread collects what arrives within store.commit_delay_ms and commits it as one group.
// So the disk always contains all changes up to some moment and none after it. Callbacks report a change only after it
// is on the disk.
//
// Overflow rule: the queue is bounded by bytes. While the disk fails, the group is tried again every second and the
// queue fills. If there is no room for an entry, its session is no longer stored from there on, because a journal with
// a gap could not be replayed. The entries before stay valid. The state is then `degraded` with the reason, until the
// session is stored again with a checkpoint of its present state (Recover). A record that is longer than the store can
// hold is left out in the same way; it must not keep others from being written. A record of a site or a job for which
// there is no room is missing until it is handed over again; each time, that is its whole newest form.
// Over store.max_gib the journal before a checkpoint is removed, of the session that was begun first, then of the next.
// A journal is removed as a whole up to the checkpoint, because a rest of it could not be processed again.
// Journals and checkpoints that nobody needs are removed piece by piece, each in a commit of its own, from the first
// record on. If the process ends meanwhile, the next one removes what is left of sessions that are gone.
// Thread rule: any thread; Start and Stop from one.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "common/delay_meter.h"
#include "common/mutex.h"
#include "server/store/checkpoint_writer.h"
#include "server/store/records.h"
#include "server/store/set_aside.h"
#include "server/store/store.h"
#include "server/store/store_options.h"

namespace cairn::server {

struct JournalHealth {
  bool degraded = false;
  std::string reason;
  bool disk_fails = false;   // The last commit failed.
  bool disk_hangs = false;   // The disk has not answered for seconds.
  bool over_budget = false;  // The store is larger than store.max_gib, and everything in it is needed.
};

// Since the start.
struct JournalCounts {
  std::uint64_t commits = 0;
  std::uint64_t entries = 0;
  std::uint64_t failed_commits = 0;
  std::uint64_t store_bytes = 0;  // What the records took when the budget was last checked.
  // From the arrival of the oldest change of a group until it was on the disk, over the last 4,096 groups.
  double delay_p50_ms = 0.0;
  double delay_p99_ms = 0.0;
};

class Journal {
 public:
  // Called on the journal's thread with the entries of the session that are on the disk now, in order. The first call
  // may have none; it reports that the session itself is on the disk.
  using Durable = std::function<void(const std::vector<JournalEntry>& entries)>;
  // Called on the journal's thread to make a record's bytes.
  using Bytes = std::function<std::string()>;

  Journal(Store& store, const StoreOptions& options);
  ~Journal();

  void Start();
  // Tries once to write what still waits, and ends the thread.
  void Stop();

  // Open: a new session, which is stored at once. Reopen: a session that was restored up to position `last`.
  void Open(const StoredSession& session, Durable durable);
  // `checkpointed` and `pieces` are the position of its newest checkpoint, 0 if there is none, and its pieces.
  void Reopen(std::uint64_t session, std::uint64_t last, Durable durable, std::uint64_t checkpointed = 0,
              StoredPieces pieces = {});
  // Returns the position of the entry, counted from 1; 0 if it is not stored, also because `session` is not open.
  std::uint64_t Append(std::uint64_t session, JournalEntry entry);
  // The position of the session's last entry; 0 if there is none, or if the session is not stored.
  [[nodiscard]] std::uint64_t position(std::uint64_t session) const;
  // Stores the session's state after exactly the entries up to `position`. `content` is called on the journal's thread.
  // Returns false if another checkpoint of the session is still being written, or if it has one at this position or a
  // later one.
  // `done`: called on the journal's thread, when it is on the disk (true) or could not be made (false).
  using Content = std::function<CheckpointContent()>;
  using Done = std::function<void(bool stored)>;
  bool Checkpoint(std::uint64_t session, std::uint64_t position, Content content, Done done = {});
  // A session that is no longer stored can be stored again: returns the position of a checkpoint that must be asked for
  // next, or 0 if this is not such a session, or the disk still fails or is far behind. Entries after that position are
  // kept in memory until the checkpoint is on the disk; then the journal before it is removed. Abandon: the checkpoint
  // could not be made, and the session is no longer stored again.
  [[nodiscard]] std::uint64_t Recover(std::uint64_t session);
  void Abandon(std::uint64_t session);
  // Whether the session is open and no longer stored.
  [[nodiscard]] bool IsLost(std::uint64_t session) const;
  // Whether a checkpoint of the session is being written, so that another one would be refused.
  [[nodiscard]] bool IsCheckpointing(std::uint64_t session) const;
  // Nothing of the session is written any more, and what is stored of it stays.
  void Close(std::uint64_t session);
  // Removes all records of a session that will not be restored, the large ones after the others.
  void Forget(std::uint64_t session);

  // Writes or replaces a record. `size` is an estimate of its bytes, for the bound of the queue.
  void Put(const RecordKey& key, Bytes bytes, std::size_t size = 1024);
  void Remove(const RecordRange& range);
  // Several of these in one commit: first the removals. Each record counts with 1,024 bytes. Returns false, and does
  // nothing, if there is no room for all.
  struct Edit {
    std::vector<RecordRange> removed;
    std::vector<std::pair<RecordKey, Bytes>> put;
    std::vector<std::uint64_t> forgotten;  // Sessions: Forget.
  };
  bool Apply(Edit edit);

  // Calls `work` on the journal's thread when everything that was handed over before is on the disk. Nothing else is
  // written until it returns, so it sees the store at one moment, and its own commit is the only one. What comes
  // meanwhile waits. `work` is destroyed without a call if the journal stops before.
  using Work = std::function<void(Store&)>;
  void Between(Work work);
  // Whether at most half of the queue's room is taken. A work that may take long should end when this is false: where
  // the queue overflows, sessions are no longer stored.
  [[nodiscard]] bool HasTimeToSpare() const;
  // Calls `told` on the journal's thread when everything that was handed over before is on the disk, and sees to it
  // that this is soon; also where that fails, because a disk that fails may do so for long. `told` is destroyed without
  // a call if the journal stops before.
  void WhenStored(std::function<void()> told);

  [[nodiscard]] Store& store() { return store_; }
  // What was not restored from this store.
  [[nodiscard]] SetAside& set_aside() { return set_aside_; }
  [[nodiscard]] const SetAside& set_aside() const { return set_aside_; }
  [[nodiscard]] JournalHealth health() const;
  [[nodiscard]] JournalCounts counts() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Line {  // One open session.
    std::uint64_t next = 1;
    std::string lost = {};          // Why nothing of it is stored any more; empty: it is.
    std::uint64_t recovers_at = 0;  // Where it is stored again: the position of its checkpoint. 0: it is stored.
    std::optional<StoredSession> unwritten = {};  // The session itself, until it is on the disk.
    bool checkpointing = false;
    std::uint64_t checkpointed = 0;  // Position of the newest complete checkpoint.
    StoredPieces pieces = {};        // Those of the newest complete checkpoint.
    Durable durable;
  };
  struct Appended {
    std::uint64_t session = 0;
    std::uint64_t position = 0;
    JournalEntry entry;
  };
  struct Written {
    RecordKey key;
    Bytes bytes;
    std::size_t size = 0;  // That it counts with.
  };
  struct Forgotten {
    std::uint64_t session = 0;
  };
  using Change = std::variant<Appended, Written, RecordRange, Forgotten>;
  struct Batch {
    std::uint64_t first = 0;
    std::vector<JournalEntry> entries;
  };
  struct Prepared {
    RecordChanges changes;
    std::map<std::uint64_t, Batch> batches;  // By session; empty where only the session itself is new.
    std::vector<std::uint64_t> forgotten;    // Sessions of which the large records are to be removed later.
    [[nodiscard]] bool empty() const { return changes.removed.empty() && changes.put.empty() && batches.empty(); }
  };
  struct WantedCheckpoint {
    std::uint64_t session = 0;
    std::uint64_t position = 0;
    Content content;
    Done done;
  };
  // Changes that are committed together.
  struct Group {
    std::list<Change> changes;
    std::vector<Work> works;  // After the commit.
    std::vector<std::function<void()>> told;
    std::optional<WantedCheckpoint> checkpoint;
    Clock::time_point oldest;
  };
  // Samples count against the bound of the queue. Other changes are small and must not be lost, so they have the same
  // room again.
  enum class Room { kForSamples, kWithReserve };

  void CloseLocked(std::uint64_t session) CAIRN_REQUIRES(mutex_);
  void Lose(std::uint64_t session, Line& line, std::string why) CAIRN_REQUIRES(mutex_);
  void ReleaseHeld(std::uint64_t session, Line& line) CAIRN_REQUIRES(mutex_);
  [[nodiscard]] std::size_t BytesOfQueue() const;
  [[nodiscard]] bool HasRoom(std::size_t size, Room room) const CAIRN_REQUIRES(mutex_);
  bool RemoveStatesOf(std::uint64_t session, std::size_t size, Room room) CAIRN_REQUIRES(mutex_);
  bool Push(Change change, std::size_t size, Room room = Room::kForSamples) CAIRN_REQUIRES(mutex_);
  bool PushRecord(const RecordKey& key, Bytes bytes, std::size_t size, Room room) CAIRN_REQUIRES(mutex_);
  void Run(const std::stop_token& stop);
  [[nodiscard]] bool RunOnce(Group&& group, const std::stop_token& stop);
  void StartOver(const std::string& why) CAIRN_EXCLUDES(mutex_);
  void FindRests();
  void TellOrders();
  // While it exists, the store is asked for something, which takes long where the disk hangs.
  class Asking;
  void RemovePiece() CAIRN_EXCLUDES(mutex_);
  std::optional<Group> Next(const std::stop_token& stop);
  std::optional<WantedCheckpoint> TakeCheckpoint() CAIRN_REQUIRES(mutex_);
  static Prepared Prepare(Group&& group);
  void LeaveOutTooLong(Prepared& prepared) CAIRN_EXCLUDES(mutex_);
  void DropForgottenCheckpoint() CAIRN_EXCLUDES(mutex_);
  void WriteCheckpoint(std::optional<WantedCheckpoint> wanted, RecordChanges& changes) CAIRN_EXCLUDES(mutex_);
  void AddRecovered(std::uint64_t session, RecordChanges& changes) CAIRN_EXCLUDES(mutex_);
  void BeginCheckpoint(WantedCheckpoint wanted) CAIRN_EXCLUDES(mutex_);
  bool CommitOnce(const RecordChanges& changes);
  bool CommitPatiently(const RecordChanges& changes, const std::stop_token& stop);
  void Tell(const Prepared& prepared, Clock::time_point oldest);
  void EndCheckpoint() CAIRN_EXCLUDES(mutex_);
  void KeepBudget() CAIRN_EXCLUDES(mutex_);

  Store& store_;
  const StoreOptions options_;
  SetAside set_aside_;

  mutable Mutex mutex_;
  CondVar arrived_;
  std::map<std::uint64_t, Line> lines_ CAIRN_GUARDED_BY(mutex_);
  std::list<Change> queue_ CAIRN_GUARDED_BY(mutex_);
  // The newest form of each record that is in the queue. An older one is not needed any more.
  std::map<RecordKey, std::list<Change>::iterator> queued_records_ CAIRN_GUARDED_BY(mutex_);
  // Records of which the newest form found no room, until there is a newer one.
  std::set<RecordKey> omitted_ CAIRN_GUARDED_BY(mutex_);
  std::size_t queued_bytes_ CAIRN_GUARDED_BY(mutex_) = 0;      // Bytes in queue_.
  std::size_t committing_bytes_ CAIRN_GUARDED_BY(mutex_) = 0;  // Bytes of the group being committed.
  std::deque<Appended> held_ CAIRN_GUARDED_BY(mutex_);         // Of sessions that wait for the checkpoint of Recover.
  std::size_t held_bytes_ CAIRN_GUARDED_BY(mutex_) = 0;
  Clock::time_point oldest_ CAIRN_GUARDED_BY(mutex_);
  bool urgent_ CAIRN_GUARDED_BY(mutex_) = false;
  std::optional<Clock::time_point> asking_since_ CAIRN_GUARDED_BY(mutex_);
  std::string disk_fault_ CAIRN_GUARDED_BY(mutex_);        // Why the last commit failed; empty if it did not.
  std::string left_out_ CAIRN_GUARDED_BY(mutex_);          // What else than a session is no longer stored, and why.
  std::string checkpoint_fault_ CAIRN_GUARDED_BY(mutex_);  // Why the last checkpoint is missing.
  bool over_budget_ CAIRN_GUARDED_BY(mutex_) = false;
  JournalCounts counts_ CAIRN_GUARDED_BY(mutex_);
  DelayMeter delays_ CAIRN_GUARDED_BY(mutex_);
  std::deque<WantedCheckpoint> checkpoints_ CAIRN_GUARDED_BY(mutex_);
  std::vector<Work> works_ CAIRN_GUARDED_BY(mutex_);
  std::vector<std::function<void()>> told_ CAIRN_GUARDED_BY(mutex_);

  // Used by the thread only.
  std::optional<CheckpointWriter> writing_;
  Done written_;  // Told what became of that.
  Clock::time_point budget_checked_{};
  bool rests_known_ = false;
  std::vector<std::function<void()>> telling_;  // Of WhenStored.
  std::deque<RecordRange> unwanted_;            // What is removed piece by piece.
  Clock::time_point next_piece_{};              // Later where the disk fails.

  std::jthread thread_;  // The last member: it stops before the members it uses are destroyed.
};

// Calls `visit` with every entry of the session's journal after `position`, in order. DATA_LOSS: an entry is damaged or
// missing. Returns the last position.
[[nodiscard]] Result<std::uint64_t> ReadJournal(
    Store& store, std::uint64_t session, std::uint64_t position,
    const std::function<Result<void>(std::uint64_t position, JournalEntry&& entry)>& visit);

// How many entries of the session's journal follow its checkpoint. Reads neither; their content may be damaged.
[[nodiscard]] Result<std::uint64_t> EntriesAfterCheckpoint(Store& store, std::uint64_t session);

// Returns the number of this start: larger than that of every earlier start on this store, and at least `milliseconds`
// (since 1970). It is on the disk when this returns.
[[nodiscard]] Result<std::uint64_t> NextGeneration(Store& store, std::uint64_t milliseconds);

}  // namespace cairn::server
