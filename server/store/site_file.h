// A site as one file: everything that a store holds of it, so that it can be kept, moved to another server and looked
// at years later. Written atomically. A file of every version of the format is kept in tests/golden and must load for
// ever.
//
// The bytes, numbers little-endian:
//   8 bytes   "cairnste"
//   4 bytes   version of the format: 2; 1 where no record is of the kind kRelations
//   then for each record: 4 bytes length (not 0), a SavedRecord (idl/cairn/record.proto). The site's record is the
//   first
//             one; a session's record comes before its checkpoint and its journal. Each is compressed with zstd and has
//             a checksum and a format version of its own (envelope.h).
//   4 bytes   0
//   8 bytes   number of records
//   8 bytes   checksum (checksum.h) of all bytes before these 8
#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "server/store/checksum.h"
#include "server/store/envelope.h"
#include "server/store/site_contents.h"

namespace cairn::server {

// The format of the files that are written; files of all formats up to this one are read.
inline constexpr std::uint32_t kSiteFileFormat = 2;
// Numbers of sessions and jobs in a file are smaller.
inline constexpr std::uint64_t kMaxSavedId = std::uint64_t{1} << 53;

// Reads a saved site from its first record to its last. Not thread-safe.
class SiteFileReader {
 public:
  // NOT_FOUND. DATA_LOSS: it is no saved site. FAILED_PRECONDITION: a newer program has written it.
  [[nodiscard]] static Result<SiteFileReader> Open(const std::filesystem::path& path);

  // Nothing after the last record, when the checksum of the whole file has been found right. DATA_LOSS: the file is
  // damaged; what was read before must not be used either.
  [[nodiscard]] Result<std::optional<Record>> Next();

 private:
  SiteFileReader(std::filesystem::path path, std::ifstream file, std::uint64_t size);
  [[nodiscard]] bool Take(char* to, std::uint64_t size);
  [[nodiscard]] tl::unexpected<Status> Damaged(const std::string& why) const;
  [[nodiscard]] Result<void> CheckEnd();

  std::filesystem::path path_;
  std::ifstream file_;
  std::uint64_t left_ = 0;  // Bytes that were not read yet.
  std::uint64_t records_ = 0;
  Checksum checksum_;
  std::unique_ptr<EnvelopeCodec> codec_ = std::make_unique<EnvelopeCodec>();
};

// What a saved site contains.
struct SiteFileSummary {
  StoredSite site;
  std::map<std::uint64_t, std::string> sessions;  // Id -> robot.
  std::set<std::uint64_t> jobs;
  // All numbers of sessions and of jobs in it, also of those that exist no more.
  std::set<std::uint64_t> session_numbers;
  std::set<std::uint64_t> job_numbers;
  std::uint64_t records = 0;
  std::uint64_t entries = 0;  // Number of entries in all journals.
};

// Asked before each record. If it returns false, the work ends with RESOURCE_EXHAUSTED, and nothing has changed.
using MayGoOn = std::function<bool()>;

// Reads the whole file and every record in it. Errors as of SiteFileReader, with the path and what is wrong.
[[nodiscard]] Result<SiteFileSummary> SurveySiteFile(const std::filesystem::path& path, const MayGoOn& may_go_on = {});

// Writes all records of the site. The store must not change meanwhile. NOT_FOUND: no such site. Errors of the disk,
// after which the path holds what it held before.
[[nodiscard]] Result<SiteFileSummary> WriteSiteFile(Store& store, const std::string& site,
                                                    const std::filesystem::path& path, const MayGoOn& may_go_on = {});
// The error when MayGoOn has returned false; `what` names the task.
[[nodiscard]] tl::unexpected<Status> TakesTooLong(const std::string& what);

}  // namespace cairn::server
