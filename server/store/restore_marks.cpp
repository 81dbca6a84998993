#include "server/store/restore_marks.h"

#include "cairn/record.pb.h"
#include "server/store/record_values.h"

namespace cairn::server {

Result<RestoreMarks> RestoreMarks::Read(Store& store) {
  RestoreMarks marks(store);
  const auto sessions = store.Owners(RecordKind::kRestoring);
  if (!sessions) return tl::unexpected(sessions.error());
  for (const std::uint64_t session : *sessions) {
    const auto take = [&](std::uint64_t, std::string_view bytes) -> Result<void> {
      record::Restoring from;
      if (!from.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return Unreadable("a mark");
      marks.failed_[session] = {from.attempts(), from.place()};
      return {};
    };
    const auto read = store.Read({.kind = RecordKind::kRestoring, .owner = session}, take);
    if (!read && read.error().code != StatusCode::kDataLoss) return tl::unexpected(read.error());
    if (!read) marks.failed_[session] = {1, 0};
  }
  return marks;
}

RestoreMarks::Failures RestoreMarks::FailuresOf(std::uint64_t session) const {
  const auto found = failed_.find(session);
  return found == failed_.end() ? Failures{} : found->second;
}

std::uint32_t RestoreMarks::failed(std::uint64_t session) const {
  return FailuresOf(session).count;
}

Record RestoreMarks::RecordOf(std::uint64_t session, std::uint32_t failures, std::uint64_t place) {
  record::Restoring to;
  to.set_attempts(failures);
  to.set_place(place);
  return {{RecordKind::kRestoring, session, 0}, to.SerializeAsString()};
}

Record RestoreMarks::MarkAt(std::uint64_t session, std::uint64_t place) const {
  const Failures before = FailuresOf(session);
  return RecordOf(session, before.place == place ? before.count + 1 : 1, place);
}

Result<void> RestoreMarks::Begin(const std::vector<std::uint64_t>& sessions) {
  RecordChanges changes;
  for (const std::uint64_t session : sessions) changes.put.push_back(MarkAt(session, 0));
  return changes.put.empty() ? Result<void>{} : store_->Commit(changes);
}

Result<void> RestoreMarks::BeginWithoutJournal(std::uint64_t session) {
  return store_->Commit({.removed = {}, .put = {MarkAt(session, FailuresOf(session).place)}});
}

Result<void> RestoreMarks::Reached(std::uint64_t session, std::uint64_t entries) const {
  if (entries == 0 || entries % kPlaceEntries != 0) return {};
  return store_->Commit({.removed = {}, .put = {MarkAt(session, entries / kPlaceEntries)}});
}

Result<void> RestoreMarks::Set(std::uint64_t session, std::uint32_t failures) {
  failed_[session].count = failures;
  return store_->Commit({.removed = {}, .put = {RecordOf(session, failures, failed_[session].place)}});
}

Result<void> RestoreMarks::Succeeded(const std::vector<std::uint64_t>& sessions) {
  RecordChanges changes;
  for (const std::uint64_t session : sessions) {
    failed_.erase(session);
    changes.removed.push_back({.kind = RecordKind::kRestoring, .owner = session});
  }
  return changes.removed.empty() ? Result<void>{} : store_->Commit(changes);
}

}  // namespace cairn::server
