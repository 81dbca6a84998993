// What the journal has written, read back (journal.h).
#include <algorithm>
#include <utility>

#include "server/store/checkpoint_writer.h"
#include "server/store/journal.h"
#include "server/store/record_values.h"

namespace cairn::server {

namespace {

// Reads this many records at a time, so that the store is not locked while their entries are used.
constexpr std::size_t kPage = 64;

struct Page {
  std::vector<std::pair<std::uint64_t, std::string>> records;
  bool last = true;
};

Result<Page> ReadPage(Store& store, const RecordRange& range) {
  Page page;
  const auto take = [&page](std::uint64_t number, std::string_view bytes) -> Result<void> {
    page.last = page.records.size() < kPage;
    if (!page.last) return Fail(StatusCode::kCancelled, "the page is full");
    page.records.emplace_back(number, bytes);
    return {};
  };
  if (auto read = store.Read(range, take); !read && page.last) return tl::unexpected(read.error());
  return page;
}

}  // namespace

Result<std::uint64_t> ReadJournal(
    Store& store, std::uint64_t session, std::uint64_t position,
    const std::function<Result<void>(std::uint64_t position, JournalEntry&& entry)>& visit) {
  std::uint64_t last = position;
  const auto take = [&](std::uint64_t number, std::string_view bytes) -> Result<void> {
    auto batch = BatchOf(bytes);
    if (!batch) return tl::unexpected(batch.error());
    if (batch->entries.empty() || batch->first + batch->entries.size() - 1 != number) return Unreadable("a journal");
    if (batch->first > last + 1) {
      return Fail(StatusCode::kDataLoss, "the journal of session " + std::to_string(session) + " misses entries " +
                                             std::to_string(last + 1) + " to " + std::to_string(batch->first - 1));
    }
    for (std::size_t i = last + 1 - batch->first; i < batch->entries.size(); ++i) {
      last = batch->first + i;
      if (auto visited = visit(last, std::move(batch->entries[i])); !visited) return visited;
    }
    return {};
  };
  for (;;) {
    const auto page = ReadPage(store, {.kind = RecordKind::kJournal, .owner = session, .first = last + 1});
    if (!page) return tl::unexpected(page.error());
    for (const auto& [number, bytes] : page->records) {
      if (auto taken = take(number, bytes); !taken) return tl::unexpected(taken.error());
    }
    if (page->last) return last;
  }
}

Result<std::uint64_t> EntriesAfterCheckpoint(Store& store, std::uint64_t session) {
  const auto position = PositionOfCheckpoint(store, session);
  if (!position) return tl::unexpected(position.error());
  const auto numbers = store.Numbers({.kind = RecordKind::kJournal, .owner = session, .first = *position + 1});
  if (!numbers) return tl::unexpected(numbers.error());
  return numbers->empty() ? 0 : numbers->back() - *position;  // The number of a record is that of its last entry.
}

Result<std::uint64_t> NextGeneration(Store& store, std::uint64_t milliseconds) {
  const RecordKey key{};
  record::Server server;
  const auto take = [&server](std::uint64_t, std::string_view bytes) -> Result<void> {
    if (!server.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return Unreadable("a generation");
    return {};
  };
  // A damaged one is replaced: the clock gives a larger number, unless it was set back.
  if (auto read = store.Read({.kind = key.kind, .owner = key.owner, .first = 0, .last = 0}, take);
      !read && read.error().code != StatusCode::kDataLoss)
    return tl::unexpected(read.error());
  const std::uint64_t generation = std::max(server.generation() + 1, milliseconds);
  server.set_generation(generation);
  // On a full disk the clock alone makes the next one larger; a server that does not start would be worse.
  auto kept = store.Commit({.removed = {}, .put = {{key, server.SerializeAsString()}}});
  if (!kept && kept.error().code != StatusCode::kResourceExhausted) return tl::unexpected(kept.error());
  return generation;
}

}  // namespace cairn::server
