#include "server/queries/saved_sites.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <set>
#include <system_error>
#include <thread>
#include <utility>

#include "server/ops/log_context.h"
#include "server/queries/answers.h"
#include "server/queries/request_log.h"

namespace cairn::server {
namespace {

// Does something when the block is left, also by an exception.
class AtTheEnd {
 public:
  explicit AtTheEnd(std::function<void()> what) : what_(std::move(what)) {}
  AtTheEnd(const AtTheEnd&) = delete;
  AtTheEnd& operator=(const AtTheEnd&) = delete;
  ~AtTheEnd() { what_(); }

 private:
  const std::function<void()> what_;
};

constexpr const char* kExtension = ".site";
constexpr std::size_t kMostListed = 4096;
constexpr auto kLook = std::chrono::milliseconds(50);  // How often a wait checks whether the server stops.
constexpr auto kPatience = std::chrono::seconds(3);    // For a disk that fails, and that may work again.

Stamp ModifiedAt(const std::filesystem::path& path) {
  std::error_code error;
  const auto time = std::filesystem::last_write_time(path, error);
  if (error) return 0;
  const auto system = std::chrono::file_clock::to_sys(time);
  return std::chrono::duration_cast<std::chrono::nanoseconds>(system.time_since_epoch()).count();
}

// What stands at the beginning of the file; the rest is not read, so a file that is listed may still be damaged.
SavedSite SavedAt(const std::filesystem::path& path) {
  SavedSite saved;
  std::error_code error;
  saved.name = path.stem().string();
  saved.bytes = std::filesystem::file_size(path, error);
  if (error) saved.bytes = 0;
  saved.saved = ModifiedAt(path);
  auto reader = SiteFileReader::Open(path);
  if (!reader) return saved;
  const auto first = reader->Next();
  if (!first || !*first) return saved;
  if (const auto site = SiteOf((*first)->bytes)) saved.site = site->name;
  return saved;
}

// Also of files that no request lists: they take their space all the same.
std::uint64_t BytesIn(const std::filesystem::path& directory) {
  std::uint64_t bytes = 0;
  std::error_code error;
  for (auto entry = std::filesystem::directory_iterator(directory, error);
       !error && entry != std::filesystem::directory_iterator(); entry.increment(error)) {
    std::error_code unknown;
    const std::uintmax_t size = entry->file_size(unknown);
    if (!unknown) bytes += size;
  }
  return bytes;
}

// A server that was killed while it saved a site has left a file that no request lists (AtomicFile).
void RemoveUnfinished(const std::filesystem::path& directory) {
  std::error_code error;
  for (auto entry = std::filesystem::directory_iterator(directory, error);
       !error && entry != std::filesystem::directory_iterator(); entry.increment(error)) {
    std::error_code ignored;
    if (entry->path().filename().string().find(std::string(kExtension) + ".tmp.") != std::string::npos)
      std::filesystem::remove(entry->path(), ignored);
  }
}

}  // namespace

SavedSites::SavedSites(std::filesystem::path directory, std::uint64_t max_bytes, Journal* journal, const Rooms& rooms)
    : directory_(std::move(directory)), max_bytes_(max_bytes), journal_(journal), rooms_(rooms) {}

SavedSites::~SavedSites() {
  Stop();
}

void SavedSites::Start() {
  RemoveUnfinished(directory_);
  thread_ = std::jthread([this] {
    while (const auto request = requests_.Pop()) Serve(*request);
  });
}

void SavedSites::Take(Request&& request) {
  Reply busy = ReplyTo(request, {StatusCode::kResourceExhausted, "too many requests are waiting; try again later"});
  if (!requests_.TryPush(std::move(request))) rooms_.outbound.Send(std::move(busy));
}

void SavedSites::Stop() {
  stopping_ = true;
  loading_.GiveUp();
  requests_.Close();
  if (thread_.joinable()) thread_.join();
}

void SavedSites::Serve(const Request& request) {
  std::optional<LogContext> context;  // Also of what is logged about an exception.
  Reply reply = ReplyTo(request);
  try {
    context.emplace(FieldsOf(request));
    auto answer = Answer(request);
    if (!answer) reply.status = answer.error();
    LogAnswered(request, reply.status);
    if (answer) reply.saved = *std::move(answer);
  } catch (const std::exception& error) {
    spdlog::error("a request of kind {} failed with an exception: {}", RequestKindName(request.kind), error.what());
    reply = ReplyTo(request, {StatusCode::kInternal, "internal error of the server; see its log for the cause"});
  }
  try {
    ReplyParts parts(std::move(reply));
    while (auto part = parts.Next()) rooms_.outbound.SendPatiently(*std::move(part));
  } catch (const std::exception& error) {  // The client asks again.
    spdlog::error("the answer to a request of kind {} could not be sent because of an exception: {}",
                  RequestKindName(request.kind), error.what());
  }
}

Result<std::vector<SavedSite>> SavedSites::Answer(const Request& request) {
  if (journal_ == nullptr || directory_.empty())
    return Fail(StatusCode::kFailedPrecondition,
                "the server keeps no state (--state none): its sites cannot be saved, loaded or deleted");
  if (stopping_) return Fail(StatusCode::kUnavailable, "the server is stopping");
  const auto nothing = [] { return std::vector<SavedSite>{}; };
  if (request.kind == RequestKind::kSavedList) return List();
  if (request.kind == RequestKind::kSiteSave) return Save(request);
  if (request.kind == RequestKind::kSiteLoad) return Load(request);
  if (request.saved.empty()) return Delete(request.site).map(nothing);
  if (!request.site.empty())
    return Fail(StatusCode::kInvalidArgument, "either a site is deleted or a saved one, not both in one request");
  return DeleteFile(request.saved).map(nothing);
}

Result<std::filesystem::path> SavedSites::PathOf(const std::string& name) const {
  // A name has no separator and does not begin with a dot.
  if (auto valid = ValidateName("saved site", name); !valid) return tl::unexpected(valid.error());
  return directory_ / (name + kExtension);
}

Result<void> SavedSites::AwaitDisk() const {
  for (const auto asked = std::chrono::steady_clock::now();; std::this_thread::sleep_for(kLook)) {
    const JournalHealth health = journal_->health();
    if (!health.disk_fails && !health.disk_hangs) return {};
    if (stopping_) return Fail(StatusCode::kUnavailable, "the server is stopping");
    if (std::chrono::steady_clock::now() - asked >= kPatience) return Fail(StatusCode::kUnavailable, health.reason);
  }
}

template <typename Value>
Result<Value> SavedSites::Between(std::function<Result<Value>(Store&)> work) {
  if (auto works = AwaitDisk(); !works) return tl::unexpected(works.error());
  struct Call {
    std::atomic<bool> begun{false};  // Or given up: the work is done once or never.
    std::promise<Result<Value>> promise;
  };
  const auto call = std::make_shared<Call>();
  auto answer = call->promise.get_future();
  journal_->Between([call, work = std::move(work)](Store& store) {
    if (call->begun.exchange(true)) return;
    try {
      call->promise.set_value(work(store));
    } catch (...) {  // No exception may reach the journal; it goes on in the thread that waits.
      call->promise.set_exception(std::current_exception());
    }
  });
  while (answer.wait_for(kLook) != std::future_status::ready) {
    if (stopping_) return Fail(StatusCode::kUnavailable, "the server is stopping");
    // The work waits for what came before it, which a disk that fails may not take for hours.
    if (auto works = AwaitDisk(); !works && !call->begun.exchange(true)) return tl::unexpected(works.error());
  }
  return answer.get();
}

Result<std::vector<SavedSite>> SavedSites::List() const {
  std::vector<SavedSite> all;
  std::error_code error;
  for (auto entry = std::filesystem::directory_iterator(directory_, error);
       !error && entry != std::filesystem::directory_iterator() && all.size() < kMostListed; entry.increment(error)) {
    const auto path = PathOf(entry->path().stem().string());
    if (path && *path == entry->path()) all.push_back(SavedAt(*path));
  }
  std::sort(all.begin(), all.end(), [](const SavedSite& a, const SavedSite& b) { return a.name < b.name; });
  return all;
}

Result<void> SavedSites::DeleteFile(const std::string& name) {
  const auto path = PathOf(name);
  if (!path) return tl::unexpected(path.error());
  std::error_code error;
  if (std::filesystem::remove(*path, error)) return {};
  if (error) return Fail(StatusCode::kUnavailable, "saved site '" + name + "' cannot be deleted: " + error.message());
  return Fail(StatusCode::kNotFound, "there is no saved site '" + name + "'");
}

Result<std::vector<SavedSite>> SavedSites::Save(const Request& request) {
  const auto path = PathOf(request.saved.empty() ? request.site : request.saved);
  if (!path) return tl::unexpected(path.error());
  std::error_code error;
  std::filesystem::create_directories(directory_, error);  // Where it fails, so does the file.
  if (const std::uint64_t bytes = BytesIn(directory_); bytes >= max_bytes_) {
    return Fail(StatusCode::kResourceExhausted,
                "the saved sites take " + std::to_string(bytes >> 20) +
                    " MiB, which is all that store.max_saved_gib allows; delete some of them");
  }
  const auto written = Between<SiteFileSummary>([this, site = request.site, path = *path](Store& store) {
    return WriteSiteFile(store, site, path, [this] { return journal_->HasTimeToSpare(); });
  });
  if (!written) return tl::unexpected(written.error());
  return std::vector<SavedSite>{SavedAt(*path)};
}

Result<std::vector<SavedSite>> SavedSites::Load(const Request& request) {
  const auto path = PathOf(request.saved);
  if (!path) return tl::unexpected(path.error());
  const auto file = SurveySiteFile(*path);
  if (!file) return tl::unexpected(file.error());
  if (file->site.resolution_m != 0.0 && file->site.resolution_m != rooms_.atlas.resolution_m()) {
    return Fail(StatusCode::kFailedPrecondition, "the saved site has cells of " +
                                                     std::to_string(file->site.resolution_m) +
                                                     " m, this server those of slam.grid.resolution_m");
  }
  std::set<std::string> robots;
  for (const auto& [id, robot] : file->sessions) robots.insert(robot);
  if (auto room = rooms_.roster.HasRoomFor(robots); !room) return tl::unexpected(room.error());
  ImportOptions options;
  options.site = request.site.empty() ? file->site.name : request.site;
  if (auto valid = ValidateName("site", options.site); !valid) return tl::unexpected(valid.error());
  if (auto reserved = rooms_.atlas.Reserve(options.site); !reserved) return tl::unexpected(reserved.error());
  const AtTheEnd release([&] { rooms_.atlas.Release(options.site); });  // Also where something throws.
  options.first_session = rooms_.roster.ReserveIds(file->session_numbers.size());
  options.first_job = rooms_.jobs.ReserveIds(file->job_numbers.size());
  options.may_go_on = [this] { return journal_->HasTimeToSpare(); };
  const auto loaded =
      Between<SiteFileSummary>([path = *path, options](Store& store) { return ImportSite(store, path, options); });
  if (!loaded) return tl::unexpected(loaded.error());
  if (const auto opened = OpenLoaded(*loaded); !opened) return tl::unexpected(opened.error());
  SavedSite saved = SavedAt(*path);
  saved.site = loaded->site.name;
  return std::vector<SavedSite>{std::move(saved)};
}

Result<void> SavedSites::OpenLoaded(const SiteFileSummary& loaded) {
  const std::string& site = loaded.site.name;
  if (auto open = rooms_.atlas.OpenStored(site); !open) {
    if (const auto removed = DeleteStored(site); !removed)
      spdlog::error("site '{}' is stored and not loaded: {}", site, removed.error().message);
    return open;
  }
  const AtTheEnd loaded_all([&] {
    if (const auto opened = rooms_.atlas.Find(site)) opened->SetLoading(false);
  });
  const auto unfinished = rooms_.jobs.AddStored({loaded.jobs.begin(), loaded.jobs.end()});
  if (!unfinished) spdlog::error("the jobs of site '{}' are not loaded: {}", site, unfinished.error().message);
  std::vector<SessionId> ids;
  for (const auto& [id, robot] : loaded.sessions) ids.push_back(id);
  const std::size_t taken = rooms_.roster.OpenStored(ids, loading_);
  if (unfinished) {
    for (const StoredJob& job : *unfinished) rooms_.worker.Requeue(job.job.id, job.enable);
  }
  spdlog::info("site '{}' is loaded with {} of {} sessions", site, taken, ids.size());
  return {};
}

Result<bool> SavedSites::DeleteStored(const std::string& name) {
  return Between<bool>(
      [name](Store& store) -> Result<bool> { return DeleteSite(store, name).map([] { return true; }); });
}

// Nothing but records is there of such a site.
Result<void> SavedSites::DeleteSetAside(const std::string& name) {
  if (const auto removed = DeleteStored(name); !removed) return tl::unexpected(removed.error());
  journal_->set_aside().RemoveSite(name);
  rooms_.jobs.RemoveSite(name);
  rooms_.atlas.ForgetSetAside(name);
  return {};
}

Result<void> SavedSites::Delete(const std::string& name) {
  for (const Job& job : rooms_.jobs.OfSite(name)) {
    if (name.empty() || IsFinal(job.state)) continue;
    return Fail(StatusCode::kFailedPrecondition,
                "job " + std::to_string(job.id) + " of site '" + name + "' has not ended; cancel it first");
  }
  if (rooms_.atlas.IsSetAside(name)) return DeleteSetAside(name);
  // Nothing is deleted in part where the disk is known to fail.
  if (auto works = AwaitDisk(); !works) return works;
  const auto site = rooms_.roster.RemoveSite(name);
  if (!site) return tl::unexpected(site.error());
  rooms_.jobs.RemoveSite(name);
  const auto promise = std::make_shared<std::promise<std::shared_ptr<const MapSnapshot>>>();
  auto retired = promise->get_future();
  (*site)->Retire([promise](std::shared_ptr<const MapSnapshot> last) { promise->set_value(std::move(last)); });
  const std::shared_ptr<const MapSnapshot> last = retired.get();
  const auto removed = DeleteStored(name);
  // A site that has stored nothing yet is deleted without a trace.
  const bool remains = !removed && removed.error().code != StatusCode::kNotFound;
  if (remains) {
    // A new site of this name would be mixed with what is left of it. It can be deleted again.
    rooms_.atlas.SetAside(name, {removed.error().code, "its deletion failed: " + removed.error().message});
  } else {
    journal_->set_aside().RemoveSite(name);
    rooms_.atlas.Release(name);
  }
  for (int level = 0; level < kPyramidLevels; ++level) {
    last->tiles.ForEach(level, [&](const TileSet::TilePtr& tile) {
      TileSample gone{.site_id = last->info.site_id, .tile = {}, .deleted = true};
      gone.tile = {.key = tile->key,
                   .epoch = last->info.epoch + 1,
                   .version = last->info.version + 1,
                   .encoding = TileEncoding::kRaw,
                   .bytes = {}};
      rooms_.outbound.SendPatiently(std::move(gone));
    });
  }
  MapInfo empty;
  empty.site_id = last->info.site_id;
  empty.site = name;
  empty.resolution_m = last->info.resolution_m;
  empty.epoch = last->info.epoch + 1;
  empty.version = last->info.version + 1;
  empty.levels = last->info.levels;
  rooms_.outbound.SendPatiently(empty);
  rooms_.atlas.Retire(std::move(empty));
  if (remains) return tl::unexpected(removed.error());
  return {};
}

}  // namespace cairn::server
