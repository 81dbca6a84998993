// Records on disk: bytes under a key, written in groups. Of each group either all or nothing is on the disk. records.h
// defines what the bytes mean. Every record carries its format version and a checksum over key and content, so that
// damaged bytes are an error and never wrong data. This is the interface of every store. The only one so far is SQLite
// (sqlite_store.h). Keys are plain numbers, so that another database can replace it. Thread rule: any thread;
// Commit waits for the disk; code that must not wait uses the journal (journal.h).
#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/status.h"

namespace cairn::server {

// Numbers on disk: never renumber.
enum class RecordKind : std::uint8_t {
  kServer = 0,      // Owner 0, number 0.
  kSession = 1,     // Owner: session id.
  kJournal = 2,     // Owner: session id; number: position of the last entry.
  kCheckpoint = 3,  // Owner: session id; number: see checkpoint_writer.h.
  kSite = 4,        // Owner: HashName of the site.
  kMapVersion = 5,  // Owner: HashName of the site; number: the version.
  kLayer = 6,       // Owner: HashName of the site; number: session id.
  kJob = 7,         // Owner: job id.
  kRestoring = 8,   // Owner: session id; number 0.
  kRemoved = 9,     // Owner: the id of a session that was removed, while something is left of it; number 0.
  // Owner: the id of a session; number: that of another one in which it was looked for. What smoothing jobs have
  // measured between them: bytes of slam/site/relation_book.h, which this folder does not read.
  kRelations = 10,
};

struct RecordKey {
  RecordKind kind = RecordKind::kServer;
  std::uint64_t owner = 0;
  std::uint64_t number = 0;
  auto operator<=>(const RecordKey&) const = default;
};

struct Record {
  RecordKey key;
  std::string bytes;
};

// The records of one kind and owner with numbers first..last.
struct RecordRange {
  RecordKind kind = RecordKind::kServer;
  std::uint64_t owner = 0;
  std::uint64_t first = 0;
  std::uint64_t last = UINT64_MAX;
  [[nodiscard]] bool Covers(const RecordKey& key) const {
    return key.kind == kind && key.owner == owner && key.number >= first && key.number <= last;
  }
};

// What one commit changes: first the removals, then the new or replaced records.
struct RecordChanges {
  std::vector<RecordRange> removed;
  std::vector<Record> put;
};

// How many records are removed with one commit where there may be many (Store::RemoveFirst): some megabytes.
[[nodiscard]] constexpr std::size_t RemovedAtOnce(RecordKind kind) {
  return kind == RecordKind::kCheckpoint ? 8 : 512;
}

class Store {
 public:
  // Called with a number and the record's bytes, which may be moved from; an error ends the reading and is returned.
  using Visit = std::function<Result<void>(std::uint64_t number, std::string&& bytes)>;

  virtual ~Store() = default;

  // Returns when all changes are on the disk. After an error none of them is visible; the same changes may be tried
  // again. RESOURCE_EXHAUSTED: the disk is full. OUT_OF_RANGE: a record is longer than max_record_bytes. UNAVAILABLE:
  // any other failure of the disk.
  virtual Result<void> Commit(const RecordChanges& changes) = 0;
  // As Commit, of records that are too many for the memory: `next` gives one after the other, nothing at the end, or an
  // error, after which none of them is there and which is returned. `next` must not use the store.
  using Next = std::function<Result<std::optional<Record>>()>;
  virtual Result<void> CommitEach(const Next& next) = 0;
  // Removes the first `count` records of the range, in the order of their numbers, in one commit. Returns how many
  // there were. For ranges of any size: a commit needs room on the disk beside what it removes. Errors as of Commit.
  virtual Result<std::size_t> RemoveFirst(const RecordRange& range, std::size_t count) = 0;
  // Visits records in the order of their numbers. DATA_LOSS: a record is damaged. FAILED_PRECONDITION: a newer server
  // has written it.
  virtual Result<void> Read(const RecordRange& range, const Visit& visit) = 0;
  // The owners of records of this kind, in ascending order.
  virtual Result<std::vector<std::uint64_t>> Owners(RecordKind kind) = 0;
  // The numbers of the records of this range, in ascending order. Their content is not read, and may be damaged.
  virtual Result<std::vector<std::uint64_t>> Numbers(const RecordRange& range) = 0;
  // Longer records cannot be written. SQLite's limit is 10^9 bytes with all that is around them.
  [[nodiscard]] virtual std::size_t max_record_bytes() const { return 900'000'000; }
  // Where its files are; empty if it has none.
  [[nodiscard]] virtual std::filesystem::path directory() const { return {}; }
  // Disk space that the records use. The files have up to 64 MiB more for the write-ahead log, and they do not get
  // smaller: the space of removed records is used again.
  virtual Result<std::uint64_t> bytes_used() = 0;
};

}  // namespace cairn::server
