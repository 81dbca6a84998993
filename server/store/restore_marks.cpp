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
      marks.failed_[session] = from.attempts();
      return {};
    };
    const auto read = store.Read({.kind = RecordKind::kRestoring, .owner = session}, take);
    if (!read && read.error().code != StatusCode::kDataLoss) return tl::unexpected(read.error());
    if (!read) marks.failed_[session] = 1;
  }
  return marks;
}

std::uint32_t RestoreMarks::failed(std::uint64_t session) const {
  const auto found = failed_.find(session);
  return found == failed_.end() ? 0 : found->second;
}

Record RestoreMarks::RecordOf(std::uint64_t session, std::uint32_t failures) {
  record::Restoring to;
  to.set_attempts(failures);
  return {{RecordKind::kRestoring, session, 0}, to.SerializeAsString()};
}

Result<void> RestoreMarks::Set(std::uint64_t session, std::uint32_t failures) {
  failed_[session] = failures;
  return store_->Commit({.removed = {}, .put = {RecordOf(session, failures)}});
}

Result<void> RestoreMarks::Begin(const std::vector<std::uint64_t>& sessions) {
  RecordChanges changes;
  for (const std::uint64_t session : sessions) changes.put.push_back(RecordOf(session, failed(session) + 1));
  return changes.put.empty() ? Result<void>{} : store_->Commit(changes);
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
