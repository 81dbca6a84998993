// Remembers on the disk which sessions a server is about to restore, and how far it has come, so that a session whose
// restoring ends the process does not end every later start as well: what is still marked at a start was being restored
// when the process ended. If the process crashed, a note says which session did it (crash_note.h); the others are
// not to blame. If it was killed, none may be, but memory that is not enough ends a process in this way too: so many
// kills count as one failure. What ends the process does so at the same place of the journal each time, so only ends at
// the same place are counted together.
// A scan that a session cannot process may also crash the process while the robot drives. It is not on the disk then,
// so that the session is restored well, and the robot sends the scan again. Crashes of a session in a short time are
// therefore counted as well.
// Thread rule: Reached from any thread, the others from one.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "server/store/store.h"

namespace cairn::server {

class RestoreMarks {
 public:
  // A place is a stretch of so many entries of a journal.
  static constexpr std::uint64_t kPlaceEntries = 10'000;

  static constexpr std::uint32_t kKillsPerFailure = 8;
  // After so many failures a session's journal is not used, and after so many neither is its checkpoint.
  static constexpr std::uint32_t kWithoutJournal = 2, kWithoutCheckpoint = 3;

  // After so many crashes while its robot drove, each within kDrivingTogetherS of the last, a session is restored
  // without its journal, as after two failures, and then set aside.
  static constexpr std::uint32_t kDrivingCrashes = 3;
  static constexpr std::int64_t kDrivingTogetherS = 3600;

  // Whose thread crashed when the last process ended, if one did: while it was restored, or while its robot drove, as
  // seen at this time.
  struct Crashed {
    std::optional<std::uint64_t> restoring{};
    std::optional<std::uint64_t> driving{};
    std::int64_t now_s = 0;  // Since 1970.
  };
  // A damaged mark counts as one failure.
  [[nodiscard]] static Result<RestoreMarks> Read(Store& store, const Crashed& crashed);
  // Writes down what was read, so that the next start need not know who crashed.
  [[nodiscard]] Result<void> Settle();

  // How many processes failed in a row at the same place of this session.
  [[nodiscard]] std::uint32_t failed(std::uint64_t session) const;
  // Why it is not restored, or not completely. INVALID_ARGUMENT: because of what its robot has sent, and would send
  // again.
  [[nodiscard]] Status Why(std::uint64_t session) const;
  // These return when the change is on the disk, or when the disk is full. Begin: from the first entry, or from a
  // checkpoint.
  [[nodiscard]] Result<void> Begin(const std::vector<std::uint64_t>& sessions);
  // The session is restored without its journal: if that ends the process too, it is one failure more.
  [[nodiscard]] Result<void> BeginWithoutJournal(std::uint64_t session);
  // So many entries of the session's journal have been processed. Writes only where a place begins.
  [[nodiscard]] Result<void> Reached(std::uint64_t session, std::uint64_t entries) const;
  [[nodiscard]] Result<void> Set(std::uint64_t session, std::uint32_t failures);
  [[nodiscard]] Result<void> Succeeded(const std::vector<std::uint64_t>& sessions);

 private:
  struct Ends {
    std::uint32_t crashes = 0;
    std::uint32_t kills = 0;
    std::uint64_t place = 0;
    std::uint32_t driving = 0;
    std::int64_t driving_s = 0;
  };
  explicit RestoreMarks(Store& store) : store_(&store) {}
  [[nodiscard]] Result<void> Commit(const RecordChanges& changes) const;
  [[nodiscard]] static Record RecordOf(std::uint64_t session, const Ends& ends, bool open);
  // The mark of a session that is at this place now.
  [[nodiscard]] Record MarkAt(std::uint64_t session, std::uint64_t place) const;
  [[nodiscard]] Ends EndsOf(std::uint64_t session) const;

  Store* store_;
  std::map<std::uint64_t, Ends> ends_;
};

}  // namespace cairn::server
