// What the map of a site takes in memory, how much it may take, and what it gives up to take less. What is least needed
// goes first:
// 1. the layer of disagreement, which is made again when somebody asks for it;
// 2. map versions that are not enabled, the oldest first. The one before the enabled version stays, because a roll back
//    goes there, and the newest one, because a job has just made it;
// 3. the oldest layers of sessions that exist no more: two become one, and the map shows the same;
// 4. what an earlier session saw, where others have drawn all of its area. Its layer stays. Jobs cannot fit it again;
// 5. the newest version, a minute after it was made, and then the one before the enabled one.
// The enabled version, the map and what robots draw today are what they are localised in, and always stay. The coarse
// levels of the map stay as well: all of them together are a third of the finest one, and each change of the map and
// each client needs them.
// Thread rule: used on the site's strand only, but for the functions that say otherwise.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/maps/memory_count.h"
#include "server/maps/robot_grid.h"
#include "server/store/records.h"

namespace cairn::server {

// A map that can give something up (Site).
class MemoryHolder {
 public:
  virtual ~MemoryHolder() = default;
  [[nodiscard]] virtual bool HasDisagreement() const = 0;
  virtual void DropDisagreement() = 0;
  // As MapVersions::LeastNeeded. What goes is gone from the store as well, which knows MemoryKeeper::given_up by then.
  [[nodiscard]] virtual std::optional<std::uint32_t> LeastNeededVersion(bool last) const = 0;
  virtual void RemoveVersion(std::uint32_t version) = 0;
  [[nodiscard]] virtual std::size_t Layers() const = 0;
  // REQUIRES: there are two.
  virtual void MergeOldestLayers() = 0;
  // Sessions that have ended, the oldest first, and whether the map can do without what one of them saw.
  [[nodiscard]] virtual std::vector<SessionId> EndedSessions() const = 0;
  [[nodiscard]] virtual bool IsSpare(SessionId session) const = 0;
  // Draws what is left, and has it counted (MemoryKeeper::Count).
  virtual void ShowWhatIsLeft() = 0;
};

class MemoryKeeper {
 public:
  using Clock = std::chrono::steady_clock;

  // `limit`: of this site, in bytes; 0: none. `is_limited`: by this, or with all other sites.
  MemoryKeeper(std::uint64_t limit, bool is_limited) : limit_(limit), is_limited_(is_limited) {}

  // What all sites together may take leaves so many bytes to this one; 0: no limit. `clearly_below`: all together take
  // clearly less than they may (memory_shares.h). Thread rule: any thread.
  void SetShare(std::uint64_t bytes, bool clearly_below) {
    share_ = bytes;
    total_clearly_below_ = clearly_below;
  }
  // More is taken than may be, and nothing is left that could be given up. So it is called until clearly less is taken.
  // Thread rule: any thread.
  [[nodiscard]] bool gives_no_more() const { return gives_no_more_; }
  // The session that may leave; 0: none. Thread rule: any thread.
  [[nodiscard]] SessionId spare_session() const { return spare_session_; }

  // What an earlier server gave up.
  void Restore(const GivenUp& given_up);
  [[nodiscard]] const GivenUp& given_up() const { return given_up_; }

  // The map has changed. It is counted at most every ten seconds, ...
  void NoteChange() { changed_ = true; }
  // ... or at the next occasion, after what may have changed much.
  void CountSoon();
  // A version that a job has made, which it will enable next.
  void NoteNewVersion(Clock::time_point now);
  // A session has left; if it is the spare one, it was given up.
  void NoteLeft(SessionId session);
  [[nodiscard]] bool IsToBeCounted(Clock::time_point now) const;
  // Counts, if it is to be counted. Without memory for the count, the last one stays.
  void Count(Clock::time_point now, const std::function<void(MemoryCount&)>& count) noexcept;
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

  // Gives up what is least needed until the map takes no more than it may. Returns whether the note is another one now.
  bool Keep(Clock::time_point now, MemoryHolder& map);
  // What is said about memory to those who watch the map; empty: nothing.
  [[nodiscard]] const std::string& note() const { return note_; }

 private:
  enum class GaveUp : std::uint8_t { kSomething, kLaterPerhaps, kNothing };
  [[nodiscard]] std::uint64_t Limit() const;
  GaveUp GiveUpLeastNeeded(Clock::time_point now, MemoryHolder& map);
  bool GiveUpVersion(bool last, MemoryHolder& map);
  bool GiveUpLayer(MemoryHolder& map);
  bool OfferSpareSession(Clock::time_point now, const MemoryHolder& map);
  void NoteLimits(bool is_above);
  [[nodiscard]] std::string NoteNow() const;

  const std::uint64_t limit_;
  const bool is_limited_;
  std::optional<Clock::time_point> counted_;
  std::uint64_t bytes_ = 0;  // As counted then, ...
  bool changed_ = false;     // ... and whether the map has changed since.
  GivenUp given_up_;
  bool disagreement_given_up_ = false;
  bool above_own_ = false, above_share_ = false;  // Above which limits the map is called.
  std::string note_;
  std::set<SessionId> offered_;                  // As spare_session, in this round.
  std::optional<Clock::time_point> next_offer_;  // Not before.
  std::optional<Clock::time_point> version_added_;
  std::atomic<std::uint64_t> share_{0};
  std::atomic<bool> total_clearly_below_{true};
  std::atomic<bool> gives_no_more_{false};
  std::atomic<SessionId> spare_session_{0};
};

}  // namespace cairn::server
