#include "server/jobs/relation_books.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

namespace cairn::server {
namespace {

RecordKey KeyOf(const slam::RelationBook::Pair& pair) {
  return {RecordKind::kRelations, pair.seen, pair.known};
}

}  // namespace

slam::RelationBook& RelationBooks::Open(const std::string& site, const std::vector<std::uint64_t>& sessions) {
  auto& [book, restored] = books_[site];
  for (const std::uint64_t session : sessions)
    if (restored.insert(session).second && journal_ != nullptr) Restore(book, session);
  book.BeginJob();
  return book;
}

void RelationBooks::Restore(slam::RelationBook& book, std::uint64_t session) const {
  const auto take = [&](std::uint64_t known, std::string_view bytes) -> Result<void> {
    return book.Restore({known, session}, bytes);
  };
  const auto unreadable = [&](std::uint64_t known, const Status& why) {
    spdlog::warn("what was measured between the sessions {} and {} cannot be read, and is measured again: {}", known,
                 session, why.message);
  };
  const auto read = ReadEach(journal_->store(), {.kind = RecordKind::kRelations, .owner = session}, take, unreadable);
  if (!read) spdlog::warn("what was measured with session {} cannot be read: {}", session, read.error().message);
}

void RelationBooks::Close(const std::string& site, const std::vector<std::uint64_t>& sessions,
                          const std::function<bool(const std::string& site)>& site_exists) {
  std::erase_if(books_, [&](const auto& one) { return one.first != site && !site_exists(one.first); });
  const auto found = books_.find(site);
  if (found == books_.end()) return;
  slam::RelationBook& book = found->second.book;
  book.EndJob([&](std::uint64_t session) { return std::ranges::find(sessions, session) != sessions.end(); });
  for (const slam::RelationBook::Pair& pair : book.TakeChanged()) {
    if (journal_ == nullptr) continue;
    std::string bytes = book.BytesOf(pair);
    const RecordKey key = KeyOf(pair);
    if (bytes.empty()) {
      journal_->Remove({.kind = key.kind, .owner = key.owner, .first = key.number, .last = key.number});
      continue;
    }
    const std::size_t size = bytes.size();
    journal_->Put(
        key, [bytes = std::move(bytes)] { return bytes; }, size);
  }
}

}  // namespace cairn::server
