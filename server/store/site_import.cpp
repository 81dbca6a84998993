// How a saved site is taken into a store (site_edit.h).
#include <algorithm>
#include <utility>

#include "server/store/site_edit.h"

namespace cairn::server {
namespace {

using Numbers = std::map<std::uint64_t, std::uint64_t>;

std::set<std::uint64_t> NewOf(const Numbers& numbers) {
  std::set<std::uint64_t> all;
  for (const auto& [from, to] : numbers) all.insert(to);
  return all;
}

// New numbers without gaps, in the old order, so that numbers do not grow with each save and load.
Numbers Renumbered(const std::set<std::uint64_t>& old_numbers, std::uint64_t first) {
  Numbers numbers;
  for (const std::uint64_t old_number : old_numbers) numbers.emplace(old_number, first++);
  return numbers;
}

// How numbers and names of the file become those of the store.
class Renaming {
 public:
  Renaming(const SiteFileSummary& file, const ImportOptions& options, std::uint64_t first_session,
           std::uint64_t first_job)
      : site_(options.site.empty() ? file.site.name : options.site),
        robots_(options.robots),
        sessions_(Renumbered(file.session_numbers, first_session)),
        jobs_(Renumbered(file.job_numbers, first_job)) {
    for (const auto& [from, to] : robots_) ids_[HashName(from)] = HashName(to);
  }

  [[nodiscard]] const std::string& site() const { return site_; }
  [[nodiscard]] std::uint64_t Session(std::uint64_t id) const { return sessions_.at(id); }
  [[nodiscard]] std::uint64_t Job(std::uint64_t id) const { return jobs_.at(id); }
  [[nodiscard]] std::set<std::uint64_t> session_numbers() const { return NewOf(sessions_); }
  [[nodiscard]] std::set<std::uint64_t> job_numbers() const { return NewOf(jobs_); }
  [[nodiscard]] const std::string& Robot(const std::string& name) const {
    const auto found = robots_.find(name);
    return found == robots_.end() ? name : found->second;
  }

  // The file was surveyed before, so every record can be read, and every number in it is known. A value that cannot be
  // read is an error all the same. Throws std::out_of_range if the file has changed since.
  [[nodiscard]] Result<Record> Apply(Record&& record) const {
    switch (record.key.kind) {
      case RecordKind::kSite:
        return As(SiteOf(record.bytes), HashName(site_), 0, [this](StoredSite& site) { Rename(site); });
      case RecordKind::kMapVersion:
        return As(VersionOf(record.bytes), HashName(site_), record.key.number,
                  [this](StoredVersion& version) { Rename(version); });
      case RecordKind::kLayer:
        return As(LayerOf(record.bytes), HashName(site_), Session(record.key.number),
                  [this](StoredLayer& layer) { layer.session = Session(layer.session); });
      case RecordKind::kJob:
        return As(JobOf(record.bytes), Job(record.key.owner), 0, [this](StoredJob& stored) {
          stored.job.id = Job(stored.job.id);
          stored.job.site = site_;
          stored.job.robot = Robot(stored.job.robot);
        });
      case RecordKind::kSession:
        return As(SessionOf(record.bytes), Session(record.key.owner), 0, [this](StoredSession& session) {
          session.id = Session(session.id);
          session.request.site = site_;
          session.request.robot = Robot(session.request.robot);
          session.quiet_since_ms = 0;  // It is away from here only from now on.
        });
      case RecordKind::kJournal:
        return Journal(std::move(record));
      case RecordKind::kRelations:
        record.key.number = Session(record.key.number);
        break;
      case RecordKind::kCheckpoint:
      case RecordKind::kServer:
      case RecordKind::kRestoring:
      case RecordKind::kRemoved:
        break;
    }
    record.key.owner = Session(record.key.owner);
    return std::move(record);
  }

 private:
  template <typename Value, typename Change>
  Result<Record> As(Result<Value>&& value, std::uint64_t owner, std::uint64_t number, Change change) const {
    if (!value) return tl::unexpected(value.error());
    change(*value);
    return Record{{KindOf(*value), owner, number}, BytesOf(*value)};
  }
  static RecordKind KindOf(const StoredSite&) { return RecordKind::kSite; }
  static RecordKind KindOf(const StoredVersion&) { return RecordKind::kMapVersion; }
  static RecordKind KindOf(const StoredLayer&) { return RecordKind::kLayer; }
  static RecordKind KindOf(const StoredJob&) { return RecordKind::kJob; }
  static RecordKind KindOf(const StoredSession&) { return RecordKind::kSession; }

  void Rename(StoredSite& site) const {
    site.name = site_;
    std::map<NameId, std::uint64_t> members;
    for (const auto& [robot, session] : site.members) members[Id(robot)] = Session(session);
    site.members = std::move(members);
    for (auto* const sessions : {&site.fragments, &site.merged, &site.kept_apart}) {
      std::set<std::uint64_t> renamed;
      for (const std::uint64_t session : *sessions) renamed.insert(Session(session));
      *sessions = std::move(renamed);
    }
    for (std::uint64_t& session : site.past) session = Session(session);
    DropAnchors(site, [this](std::uint64_t session) { return !sessions_.contains(session); });
    for (auto& [edit, anchors] : site.anchors)
      for (EditAnchor& one : anchors.keyframes) one.session = Session(one.session);
  }
  void Rename(StoredVersion& version) const {
    if (version.job != 0) version.job = Job(version.job);
    std::map<std::uint64_t, StoredGrid> parts;
    for (auto& [session, grid] : version.parts) parts.emplace(Session(session), std::move(grid));
    version.parts = std::move(parts);
    SmoothedPaths smoothed;
    for (auto& [robot, path] : version.smoothed)
      smoothed.emplace(Robot(robot), SmoothedPath{path.session == 0 ? 0 : Session(path.session), path.path});
    version.smoothed = std::move(smoothed);
  }
  Result<Record> Journal(Record&& record) const {
    record.key.owner = Session(record.key.owner);
    if (ids_.empty()) return std::move(record);
    auto batch = BatchOf(record.bytes);
    if (!batch) return tl::unexpected(batch.error());
    for (JournalEntry& entry : batch->entries) {
      if (auto* const scan = std::get_if<ScanTaken>(&entry)) scan->stream.robot_id = Id(scan->stream.robot_id);
      if (auto* const refused = std::get_if<ScanRefused>(&entry))
        refused->stream.robot_id = Id(refused->stream.robot_id);
      if (auto* const odometry = std::get_if<OdometryTaken>(&entry))
        odometry->stream.robot_id = Id(odometry->stream.robot_id);
    }
    record.bytes = BytesOf(batch->first, batch->entries);
    return std::move(record);
  }
  [[nodiscard]] NameId Id(NameId robot) const {
    const auto found = ids_.find(robot);
    return found == ids_.end() ? robot : found->second;
  }

  const std::string site_;
  const std::map<std::string, std::string> robots_;
  std::map<NameId, NameId> ids_;
  const Numbers sessions_;
  const Numbers jobs_;
};

Result<void> CheckNames(const SiteFileSummary& file, const ImportOptions& options) {
  if (!options.site.empty()) {
    if (auto valid = ValidateName("site", options.site); !valid) return valid;
  }
  for (const auto& [from, to] : options.robots) {
    const auto is = [&from = from](const auto& session) { return session.second == from; };
    if (std::none_of(file.sessions.begin(), file.sessions.end(), is))
      return Fail(StatusCode::kInvalidArgument, "the file has no robot '" + from + "'");
    if (auto valid = ValidateName("robot", to); !valid) return valid;
  }
  return {};
}

// The side of a site's cells; 0 where that is not known.
double CellsOf(Store& store, const std::string& site) {
  double cells_m = 0.0;
  const auto take = [&cells_m](std::uint64_t, std::string_view bytes) -> Result<void> {
    if (const auto stored = SiteOf(bytes)) cells_m = stored->resolution_m;
    return {};
  };
  static_cast<void>(store.Read({.kind = RecordKind::kSite, .owner = HashName(site)}, take));
  return cells_m;
}

// Whether everything of the file can be beside what the store holds.
Result<void> CheckRoom(Store& store, const std::map<std::uint64_t, StoredSession>& stored, const SiteFileSummary& file,
                       const Renaming& renaming) {
  const auto sites = SiteNames(store);
  if (!sites) return tl::unexpected(sites.error());
  for (const std::string& site : *sites) {
    if (HashName(site) == HashName(renaming.site()))
      return Fail(StatusCode::kAlreadyExists,
                  "there is a site '" + site + "' already; delete it, or give this one another name");
    // A server has cells of one size only, and does not start where a site has others.
    const double cells_m = CellsOf(store, site);
    if (cells_m != 0.0 && file.site.resolution_m != 0.0 && cells_m != file.site.resolution_m)
      return Fail(StatusCode::kFailedPrecondition, "the file has cells of " + std::to_string(file.site.resolution_m) +
                                                       " m, and site '" + site + "' those of " +
                                                       std::to_string(cells_m) + " m; a server has one size");
  }
  std::map<NameId, std::string> taken;  // Robot -> its site.
  for (const auto& [id, session] : stored) taken[HashName(session.request.robot)] = session.request.site;
  std::map<NameId, std::string> own;  // New id -> the robot in the file.
  for (const auto& [id, robot] : file.sessions) {
    const std::string& name = renaming.Robot(robot);
    const auto other = taken.find(HashName(name));
    if (other != taken.end())
      return Fail(StatusCode::kAlreadyExists, "robot '" + name + "' has a session in site '" + other->second +
                                                  "', and a robot is in one site; give this one another name");
    const auto same = own.emplace(HashName(name), robot).first;
    if (same->second != robot)
      return Fail(StatusCode::kAlreadyExists, "the robots '" + same->second + "' and '" + robot +
                                                  "' of the file would have one name; give each its own");
  }
  return {};
}

struct LastNumbers {
  std::uint64_t session = 0;
  std::uint64_t job = 0;
};

// Also of what is only half removed: the same numbers would join the old records with the new ones.
Result<LastNumbers> LastNumbersOf(Store& store) {
  LastNumbers last;
  const auto session = LastSession(store);
  if (!session) return tl::unexpected(session.error());
  last.session = *session;
  const auto sites = store.Owners(RecordKind::kLayer);
  if (!sites) return tl::unexpected(sites.error());
  for (const std::uint64_t site : *sites) {
    const auto layers = ReadLayers(store, site);
    if (!layers) return tl::unexpected(layers.error());
    for (const StoredLayer& layer : *layers) last.session = std::max(last.session, layer.session);
  }
  const auto jobs = store.Owners(RecordKind::kJob);
  if (!jobs) return tl::unexpected(jobs.error());
  if (!jobs->empty()) last.job = jobs->back();
  return last;
}

SiteFileSummary Renamed(SiteFileSummary&& file, const Renaming& renaming) {
  file.site.name = renaming.site();
  std::map<std::uint64_t, std::string> sessions;
  for (const auto& [id, robot] : file.sessions) sessions[renaming.Session(id)] = renaming.Robot(robot);
  file.sessions = std::move(sessions);
  std::set<std::uint64_t> jobs;
  for (const std::uint64_t id : file.jobs) jobs.insert(renaming.Job(id));
  file.jobs = std::move(jobs);
  file.session_numbers = renaming.session_numbers();
  file.job_numbers = renaming.job_numbers();
  return std::move(file);
}

}  // namespace

Result<SiteFileSummary> ImportSite(Store& store, const std::filesystem::path& path, const ImportOptions& options) {
  auto file = SurveySiteFile(path, options.may_go_on);
  if (!file) return file;
  if (auto named = CheckNames(*file, options); !named) return tl::unexpected(named.error());
  const auto sessions = ReadSessions(store);
  if (!sessions) return tl::unexpected(sessions.error());
  const auto last = LastNumbersOf(store);
  if (!last) return tl::unexpected(last.error());
  const Renaming renaming(*file, options, std::max(last->session + 1, options.first_session),
                          std::max(last->job + 1, options.first_job));
  if (auto room = CheckRoom(store, *sessions, *file, renaming); !room) return tl::unexpected(room.error());
  auto reader = SiteFileReader::Open(path);
  if (!reader) return tl::unexpected(reader.error());
  const auto next = [&]() -> Result<std::optional<Record>> {
    if (options.may_go_on && !options.may_go_on()) return TakesTooLong("to load site '" + renaming.site() + "'");
    auto record = reader->Next();
    if (!record || !*record) return record;
    auto renamed = renaming.Apply(std::move(**record));
    if (!renamed) return tl::unexpected(renamed.error());
    return std::move(*renamed);
  };
  if (auto committed = store.CommitEach(next); !committed) return tl::unexpected(committed.error());
  return Renamed(std::move(*file), renaming);
}

}  // namespace cairn::server
