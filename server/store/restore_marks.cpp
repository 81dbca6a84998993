#include "server/store/restore_marks.h"

#include <algorithm>

#include "cairn/record.pb.h"
#include "server/store/record_values.h"

namespace cairn::server {

Result<RestoreMarks> RestoreMarks::Read(Store& store, const Crashed& crashed) {
  RestoreMarks marks(store);
  const auto sessions = store.Owners(RecordKind::kRestoring);
  if (!sessions) return tl::unexpected(sessions.error());
  for (const std::uint64_t session : *sessions) {
    const auto take = [&](std::uint64_t, std::string_view bytes) -> Result<void> {
      record::Restoring from;
      if (!from.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return Unreadable("a mark");
      Ends& ends =
          marks.ends_[session] = {from.attempts(), from.kills(), from.place(), from.driving(), from.driving_s()};
      if (from.open() && crashed.restoring != session) {
        if (ends.crashes > 0) --ends.crashes;
        if (!crashed.restoring) ++ends.kills;
      }
      return {};
    };
    const auto read = store.Read({.kind = RecordKind::kRestoring, .owner = session}, take);
    if (!read && read.error().code != StatusCode::kDataLoss) return tl::unexpected(read.error());
    if (!read) marks.ends_[session] = {.crashes = 1};
  }
  if (crashed.driving) {
    Ends& ends = marks.ends_[*crashed.driving];
    const bool together = crashed.now_s >= ends.driving_s && crashed.now_s - ends.driving_s <= kDrivingTogetherS;
    ends.driving = together ? ends.driving + 1 : 1;
    ends.driving_s = crashed.now_s;
  }
  return marks;
}

// On a full disk there are no marks: a session whose restoring ends the process then ends the next start as well. That
// is better than a server that does not start at all until somebody makes room.
Result<void> RestoreMarks::Commit(const RecordChanges& changes) const {
  auto committed = store_->Commit(changes);
  if (!committed && committed.error().code == StatusCode::kResourceExhausted) return {};
  return committed;
}

Result<void> RestoreMarks::Settle() {
  RecordChanges changes;
  for (const auto& [session, ends] : ends_) changes.put.push_back(RecordOf(session, ends, false));
  return changes.put.empty() ? Result<void>{} : Commit(changes);
}

RestoreMarks::Ends RestoreMarks::EndsOf(std::uint64_t session) const {
  const auto found = ends_.find(session);
  return found == ends_.end() ? Ends{} : found->second;
}

std::uint32_t RestoreMarks::failed(std::uint64_t session) const {
  const Ends ends = EndsOf(session);
  const std::uint32_t restoring = ends.crashes + ends.kills / kKillsPerFailure;
  return ends.driving >= kDrivingCrashes ? std::max(restoring, kWithoutJournal) : restoring;
}

Status RestoreMarks::Why(std::uint64_t session) const {
  const std::uint32_t driving = EndsOf(session).driving;
  if (driving >= kDrivingCrashes) {
    return {StatusCode::kInvalidArgument,
            "the server crashed " + std::to_string(driving) + " times in what the robot of this session sent"};
  }
  return {StatusCode::kAborted,
          "the server ended " + std::to_string(failed(session)) + " times while it restored this session"};
}

Record RestoreMarks::RecordOf(std::uint64_t session, const Ends& ends, bool open) {
  record::Restoring to;
  to.set_attempts(ends.crashes);
  to.set_place(ends.place);
  to.set_kills(ends.kills);
  to.set_open(open);
  to.set_driving(ends.driving);
  to.set_driving_s(ends.driving_s);
  return {{RecordKind::kRestoring, session, 0}, to.SerializeAsString()};
}

// Should the process end now without a note, it counts as a crash for a server that knows no notes.
Record RestoreMarks::MarkAt(std::uint64_t session, std::uint64_t place) const {
  Ends ends = EndsOf(session);
  if (ends.place != place) ends = {.place = place, .driving = ends.driving, .driving_s = ends.driving_s};
  ++ends.crashes;
  return RecordOf(session, ends, true);
}

Result<void> RestoreMarks::Begin(const std::vector<std::uint64_t>& sessions) {
  RecordChanges changes;
  for (const std::uint64_t session : sessions) changes.put.push_back(MarkAt(session, 0));
  return changes.put.empty() ? Result<void>{} : Commit(changes);
}

Result<void> RestoreMarks::BeginWithoutJournal(std::uint64_t session) {
  return Commit({.removed = {}, .put = {MarkAt(session, EndsOf(session).place)}});
}

Result<void> RestoreMarks::Reached(std::uint64_t session, std::uint64_t entries) const {
  if (entries == 0 || entries % kPlaceEntries != 0) return {};
  return Commit({.removed = {}, .put = {MarkAt(session, entries / kPlaceEntries)}});
}

Result<void> RestoreMarks::Set(std::uint64_t session, std::uint32_t failures) {
  Ends& ends = ends_[session];
  ends.crashes = failures;
  ends.kills = 0;
  return Commit({.removed = {}, .put = {RecordOf(session, ends, false)}});
}

Result<void> RestoreMarks::Succeeded(const std::vector<std::uint64_t>& sessions) {
  RecordChanges changes;
  for (const std::uint64_t session : sessions) {
    const Ends ends = EndsOf(session);
    ends_.erase(session);
    if (ends.driving == 0) {
      changes.removed.push_back({.kind = RecordKind::kRestoring, .owner = session});
    } else {
      ends_[session] = {.driving = ends.driving, .driving_s = ends.driving_s};
      changes.put.push_back(RecordOf(session, ends_[session], false));
    }
  }
  return changes.removed.empty() && changes.put.empty() ? Result<void>{} : Commit(changes);
}

}  // namespace cairn::server
