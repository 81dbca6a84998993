#include "server/store/site_file.h"

#include <algorithm>
#include <array>
#include <set>
#include <system_error>
#include <utility>

#include "common/file/atomic_file.h"
#include "common/file/number_bytes.h"
#include "server/store/record_values.h"

namespace cairn::server {
namespace {

constexpr std::string_view kMagic = "cairnste";
constexpr std::uint64_t kHeaderBytes = 12;
constexpr std::uint64_t kEndBytes = 16;  // After the last length.
// Longer records are not allocated: the length is a number in a file.
constexpr std::uint32_t kMaxBlock = 1U << 30;

// Appends and adds up.
class Writer {
 public:
  explicit Writer(AtomicFile file) : file_(std::move(file)) {}
  Result<void> Append(std::string_view bytes) {
    checksum_.Add(bytes);
    return file_.Append(bytes);
  }
  Result<void> Append(const Record& record) {
    record::SavedRecord saved;
    saved.set_kind(static_cast<std::uint32_t>(record.key.kind));
    saved.set_owner(record.key.owner);
    saved.set_number(record.key.number);
    saved.set_envelope(codec_.Seal(record.key, record.bytes));
    const std::string bytes = saved.SerializeAsString();
    if (bytes.size() > kMaxBlock)
      return Fail(StatusCode::kOutOfRange, "a record is too long for a file of a saved site");
    ++records_;
    if (auto length = Append(BytesOfNumber(static_cast<std::uint32_t>(bytes.size()))); !length) return length;
    return Append(bytes);
  }
  Result<void> Finish() {
    if (auto end = Append(BytesOfNumber(std::uint32_t{0}) + BytesOfNumber(records_)); !end) return end;
    if (auto sum = file_.Append(BytesOfNumber(checksum_.value())); !sum) return sum;
    return file_.Commit();
  }

 private:
  AtomicFile file_;
  Checksum checksum_;
  EnvelopeCodec codec_;
  std::uint64_t records_ = 0;
};

// Takes the records of a file in their order and says what is wrong with them as a whole.
class Survey {
 public:
  Result<void> Take(const Record& record) {
    ++summary_.records;
    const RecordKey& key = record.key;
    if ((key.kind == RecordKind::kSite) != (summary_.records == 1)) return Unreadable("a site in another place");
    switch (key.kind) {
      case RecordKind::kSite:
        return TakeSite(record);
      case RecordKind::kSession:
        return TakeSession(record);
      case RecordKind::kJournal:
        return TakeJournal(record);
      case RecordKind::kCheckpoint:
        return summary_.sessions.contains(key.owner) ? Result<void>{} : Unreadable("a checkpoint without a session");
      case RecordKind::kMapVersion:
        return TakeVersion(record);
      case RecordKind::kLayer:
        return TakeLayer(record);
      case RecordKind::kJob:
        return TakeJob(record);
      case RecordKind::kRelations:
        return TakeRelations(record);
      case RecordKind::kServer:
      case RecordKind::kRestoring:
      case RecordKind::kRemoved:
        break;
    }
    return Unreadable("a record of another kind");
  }
  Result<SiteFileSummary> Finish() && {
    if (summary_.records == 0) return Unreadable("no site");
    if (!versions_.contains(summary_.site.enabled_version)) return Unreadable("no enabled map version");
    return std::move(summary_);
  }

 private:
  Result<void> TakeSite(const Record& record) {
    auto site = SiteOf(record.bytes);
    if (!site) return tl::unexpected(site.error());
    if (record.key.owner != HashName(site->name)) return Unreadable("a site of another name");
    for (const auto& [robot, session] : site->members) summary_.session_numbers.insert(session);
    summary_.session_numbers.insert(site->fragments.begin(), site->fragments.end());
    summary_.session_numbers.insert(site->past.begin(), site->past.end());
    summary_.session_numbers.insert(site->merged.begin(), site->merged.end());
    summary_.site = std::move(*site);
    return {};
  }
  Result<void> TakeSession(const Record& record) {
    const auto session = SessionOf(record.bytes);
    if (!session) return tl::unexpected(session.error());
    if (session->id != record.key.owner || session->request.site != summary_.site.name || !IsId(session->id))
      return Unreadable("a session of another site");
    for (const auto& [id, robot] : summary_.sessions) {
      if (robot != session->request.robot && HashName(robot) == HashName(session->request.robot))
        return Unreadable("two robots with one id");
    }
    summary_.sessions[session->id] = session->request.robot;
    summary_.session_numbers.insert(session->id);
    return {};
  }
  // The other session may be one that exists no more.
  Result<void> TakeRelations(const Record& record) {
    if (!summary_.sessions.contains(record.key.owner) || !IsId(record.key.number))
      return Unreadable("relations without a session");
    summary_.session_numbers.insert(record.key.number);
    return {};
  }
  Result<void> TakeJournal(const Record& record) {
    if (!summary_.sessions.contains(record.key.owner)) return Unreadable("a journal without a session");
    const auto batch = BatchOf(record.bytes);
    if (!batch) return tl::unexpected(batch.error());
    if (batch->entries.empty() || batch->first + batch->entries.size() - 1 != record.key.number)
      return Unreadable("a journal");
    summary_.entries += batch->entries.size();
    return {};
  }
  Result<void> TakeVersion(const Record& record) {
    const auto version = VersionOf(record.bytes);
    if (!version) return tl::unexpected(version.error());
    const bool good = record.key.owner == HashName(summary_.site.name) && record.key.number == version->version &&
                      version->version < summary_.site.next_version;
    if (!good) return Unreadable("a map version");
    for (const auto& [session, part] : version->parts) {
      if (!IsId(session)) return Unreadable("a map version");
      summary_.session_numbers.insert(session);
    }
    for (const auto& [robot, path] : version->smoothed) {
      if (path.session == 0) continue;
      if (!IsId(path.session)) return Unreadable("a map version");
      summary_.session_numbers.insert(path.session);
    }
    if (version->job != 0) summary_.job_numbers.insert(version->job);
    versions_.insert(version->version);
    return {};
  }
  Result<void> TakeLayer(const Record& record) {
    const auto layer = LayerOf(record.bytes);
    if (!layer) return tl::unexpected(layer.error());
    const bool good = record.key.owner == HashName(summary_.site.name) && record.key.number == layer->session;
    if (!good || !IsId(layer->session)) return Unreadable("a part of a map");
    summary_.session_numbers.insert(layer->session);
    return {};
  }
  Result<void> TakeJob(const Record& record) {
    const auto job = JobOf(record.bytes);
    if (!job) return tl::unexpected(job.error());
    if (job->job.id != record.key.owner || job->job.site != summary_.site.name || !IsId(job->job.id))
      return Unreadable("a job of another site");
    summary_.jobs.insert(job->job.id);
    summary_.job_numbers.insert(job->job.id);
    return {};
  }
  static bool IsId(std::uint64_t id) { return id < kMaxSavedId; }

  SiteFileSummary summary_;
  std::set<std::uint32_t> versions_{1};  // The live map is there without a record.
};

}  // namespace

SiteFileReader::SiteFileReader(std::filesystem::path path, std::ifstream file, std::uint64_t size)
    : path_(std::move(path)), file_(std::move(file)), left_(size) {}

tl::unexpected<Status> SiteFileReader::Damaged(const std::string& why) const {
  return Fail(StatusCode::kDataLoss, path_.string() + " is damaged: " + why);
}

bool SiteFileReader::Take(char* to, std::uint64_t size) {
  if (size > left_) return false;
  file_.read(to, static_cast<std::streamsize>(size));
  left_ -= size;
  return file_.good();
}

Result<SiteFileReader> SiteFileReader::Open(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    return Fail(StatusCode::kNotFound, path.string() + (error ? ": " + error.message() : ": not a regular file"));
  const auto size = std::filesystem::file_size(path, error);
  if (error) return Fail(StatusCode::kUnavailable, path.string() + ": " + error.message());
  std::ifstream file(path, std::ios::binary);
  if (!file) return Fail(StatusCode::kPermissionDenied, path.string() + ": cannot be opened");
  SiteFileReader reader(path, std::move(file), size);
  std::array<char, kHeaderBytes> header{};
  if (!reader.Take(header.data(), header.size()) || std::string_view(header.data(), kMagic.size()) != kMagic)
    return Fail(StatusCode::kDataLoss, path.string() + " is not a saved site");
  const auto format = NumberAt<std::uint32_t>(header.data() + kMagic.size());
  if (format > kSiteFileFormat) {
    return Fail(StatusCode::kFailedPrecondition, path.string() + " has format " + std::to_string(format) +
                                                     ", written by a newer program; this one reads formats up to " +
                                                     std::to_string(kSiteFileFormat));
  }
  if (format == 0) return reader.Damaged("it has format 0");
  reader.checksum_.Add(std::string_view(header.data(), header.size()));
  return reader;
}

Result<void> SiteFileReader::CheckEnd() {
  std::array<char, kEndBytes> end{};
  if (!Take(end.data(), end.size())) return Damaged("it ends too early");
  checksum_.Add(std::string_view(end.data(), 8));
  if (NumberAt<std::uint64_t>(end.data()) != records_) return Damaged("records are missing");
  if (NumberAt<std::uint64_t>(end.data() + 8) != checksum_.value()) return Damaged("its checksum is wrong");
  if (left_ != 0) return Damaged("something follows its end");
  return {};
}

Result<std::optional<Record>> SiteFileReader::Next() {
  std::array<char, 4> length{};
  if (!Take(length.data(), length.size())) return Damaged("it ends too early");
  checksum_.Add(std::string_view(length.data(), length.size()));
  const auto size = NumberAt<std::uint32_t>(length.data());
  if (size == 0) {
    if (auto ended = CheckEnd(); !ended) return tl::unexpected(ended.error());
    return std::nullopt;
  }
  if (size > kMaxBlock || size > left_) return Damaged("it ends too early");
  std::string bytes(size, '\0');
  if (!Take(bytes.data(), size)) return Damaged("it ends too early");
  checksum_.Add(bytes);
  ++records_;
  record::SavedRecord saved;
  if (!saved.ParseFromArray(bytes.data(), static_cast<int>(size)) ||
      saved.kind() > static_cast<std::uint32_t>(RecordKind::kRelations)) {
    return Damaged("record " + std::to_string(records_) + " is none");
  }
  Record record{.key = {static_cast<RecordKind>(saved.kind()), saved.owner(), saved.number()}, .bytes = {}};
  auto content = codec_->Open(record.key, saved.envelope());
  if (!content) return Fail(content.error().code, path_.string() + ": " + content.error().message);
  record.bytes = std::move(*content);
  return record;
}

Result<SiteFileSummary> SurveySiteFile(const std::filesystem::path& path, const MayGoOn& may_go_on) {
  auto reader = SiteFileReader::Open(path);
  if (!reader) return tl::unexpected(reader.error());
  const auto named = [&path](const Status& status) { return Fail(status.code, path.string() + ": " + status.message); };
  Survey survey;
  for (;;) {
    if (may_go_on && !may_go_on()) return TakesTooLong("to read " + path.string());
    const auto record = reader->Next();
    if (!record) return tl::unexpected(record.error());
    if (!*record) break;
    if (auto taken = survey.Take(**record); !taken) return named(taken.error());
  }
  auto summary = std::move(survey).Finish();
  if (!summary) return named(summary.error());
  return summary;
}

tl::unexpected<Status> TakesTooLong(const std::string& what) {
  return Fail(StatusCode::kResourceExhausted,
              what +
                  " takes longer than the samples of the robots can wait (store.queue_mib); do it while the server is "
                  "stopped (cairn site export, cairn site import), or with a larger queue");
}

Result<SiteFileSummary> WriteSiteFile(Store& store, const std::string& site, const std::filesystem::path& path,
                                      const MayGoOn& may_go_on) {
  const auto contents = ReadSite(store, site);
  if (!contents) return tl::unexpected(contents.error());
  auto file = AtomicFile::Create(path);
  if (!file) return tl::unexpected(file.error());
  Writer writer(std::move(*file));
  Survey survey;
  if (auto begun = writer.Append(std::string(kMagic) + BytesOfNumber(kSiteFileFormat)); !begun)
    return tl::unexpected(begun.error());
  for (const RecordRange& range : RangesOf(*contents)) {
    if (range.kind == RecordKind::kRestoring) continue;  // It says something about this server only.
    const auto write = [&](std::uint64_t number, std::string_view bytes) -> Result<void> {
      if (may_go_on && !may_go_on()) return TakesTooLong("to save site '" + site + "'");
      const Record record{{range.kind, range.owner, number}, std::string(bytes)};
      if (auto taken = survey.Take(record); !taken) return taken;
      return writer.Append(record);
    };
    if (auto read = store.Read(range, write); !read) return tl::unexpected(read.error());
  }
  auto summary = std::move(survey).Finish();
  if (!summary) return summary;
  if (auto finished = writer.Finish(); !finished) return tl::unexpected(finished.error());
  return summary;
}

}  // namespace cairn::server
