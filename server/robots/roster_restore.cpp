// How the roster restores the sessions of earlier servers (roster.h).
#include <spdlog/spdlog.h>

#include <algorithm>
#include <asio/post.hpp>
#include <chrono>
#include <filesystem>
#include <functional>
#include <latch>
#include <map>
#include <set>
#include <utility>

#include "common/wall_clock.h"
#include "server/robots/roster.h"
#include "server/store/crash_note.h"
#include "server/store/restore_marks.h"
#include "server/store/site_contents.h"

namespace cairn::server {
namespace {

Result<StoredSession> ReadSession(Store& store, SessionId id) {
  Result<StoredSession> session = Fail(StatusCode::kDataLoss, "the store holds no session");
  const auto take = [&session](std::uint64_t, std::string_view bytes) -> Result<void> {
    session = SessionOf(bytes);
    return {};
  };
  if (auto read = store.Read({.kind = RecordKind::kSession, .owner = id}, take); !read)
    return tl::unexpected(read.error());
  return session;
}

// The longest journal, in entries, that is processed again only because of other options: some minutes.
constexpr std::uint64_t kMostReprocessed = 100'000;

// In the state directory: while sessions are restored, and while their robots drive.
constexpr const char* kRestoringNote = "crashed-session";
constexpr const char* kDrivingNote = "crashed-driving";

// Indices of the sessions, that with the longest journal to process again first: at the end all threads have work.
std::vector<std::size_t> LongestFirst(Store& store, const std::vector<SessionId>& ids) {
  std::multimap<std::uint64_t, std::size_t, std::greater<>> by_length;
  for (std::size_t i = 0; i < ids.size(); ++i)
    by_length.emplace(EntriesAfterCheckpoint(store, ids[i]).value_or(0), i);  // Reading it will tell the error.
  std::vector<std::size_t> indices(ids.size());
  std::ranges::transform(by_length, indices.begin(), &decltype(by_length)::value_type::second);
  return indices;
}

tl::unexpected<Status> StartGivenUp() {
  return Fail(StatusCode::kCancelled, "the start was given up");
}

}  // namespace

std::vector<Roster::RestoredSession> Roster::RestoreEach(const std::vector<SessionId>& ids, const Restoring& how) {
  std::vector<RestoredSession> sessions(ids.size(), Fail(StatusCode::kInternal, "not restored"));
  std::latch done(static_cast<std::ptrdiff_t>(ids.size()));
  for (const std::size_t i : LongestFirst(journal_->store(), ids)) {
    asio::post(pool_, [&, i] {
      sessions[i] = RestoreOne(ids[i], how);
      how.control.Advance();
      done.count_down();
    });
  }
  done.wait();
  return sessions;
}

Result<void> Roster::Restore(StartControl& control) {
  if (journal_ == nullptr) return {};
  const auto ids = journal_->store().Owners(RecordKind::kSession);
  if (!ids) return tl::unexpected(ids.error());
  const auto last = LastSession(journal_->store());
  if (!last) return tl::unexpected(last.error());
  const std::filesystem::path place = journal_->store().directory();
  const auto note = [&place](const char* name) { return place.empty() ? place : place / name; };
  auto driving = CrashNote::Of(note(kDrivingNote));
  if (driving && std::ranges::find(*ids, *driving) == ids->end()) driving.reset();  // It was not stored.
  auto marks = RestoreMarks::Read(
      journal_->store(),
      {.restoring = CrashNote::Of(note(kRestoringNote)), .driving = driving, .now_s = WallClock() / kNanosPerSecond});
  if (!marks) return tl::unexpected(marks.error());
  if (auto settled = marks->Settle(); !settled) return settled;
  std::error_code ignored;
  std::filesystem::remove(note(kDrivingNote), ignored);  // It is counted now.
  auto restored = RestoreAll(*ids, *last, *marks, note(kRestoringNote), control);
  if (restored) crash_note_ = std::make_unique<CrashNote>(note(kDrivingNote));
  return restored;
}

Result<void> Roster::RestoreAll(const std::vector<SessionId>& ids, SessionId last, RestoreMarks& marks,
                                const std::filesystem::path& note, StartControl& control) {
  const CrashNote crash_note(note);
  const auto begin = std::chrono::steady_clock::now();
  if (!ids.empty()) spdlog::info("restoring {} sessions", ids.size());
  std::vector<SessionId> doubtful, others;
  {
    const MutexLock lock(mutex_);
    next_id_ = std::max(next_id_, last + 1);
    for (const auto& site : atlas_.All()) next_id_ = std::max(next_id_, site->LastSession() + 1);
    for (const SessionId id : ids) {
      (marks.failed(id) == 0 ? others : doubtful).push_back(id);
    }
  }
  const Restoring how{control, &marks};
  if (auto restored = RestoreTogether(others, how); !restored) return restored;
  // One of these may have ended the server before. One at a time, so that it alone is marked when it does so again.
  for (const SessionId id : doubtful) {
    if (auto restored = RestoreDoubtful(id, how); !restored) return restored;
  }
  const auto remains = SessionsWithoutRecord(journal_->store());
  if (!remains) return tl::unexpected(remains.error());
  for (const SessionId id : *remains)
    Register(id,
             NotRestored(id, {StatusCode::kDataLoss, "its own record is missing, and other parts of it are there"}));
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  spdlog::info("{} sessions restored in {:.2f} s", All().size(), took.count());
  return {};
}

Result<void> Roster::RestoreTogether(const std::vector<SessionId>& ids, const Restoring& how) {
  if (auto marked = how.marks->Begin(ids); !marked) return marked;
  std::vector<RestoredSession> sessions = RestoreEach(ids, how);
  if (auto unmarked = how.marks->Succeeded(ids); !unmarked) return unmarked;
  if (how.control.given_up()) {
    for (const RestoredSession& session : sessions)
      if (session) (*session)->KeepStored();
    return StartGivenUp();
  }
  for (std::size_t i = 0; i < ids.size(); ++i) Register(ids[i], std::move(sessions[i]));
  return {};
}

Result<void> Roster::RestoreDoubtful(SessionId id, Restoring how) {
  RestoreMarks& marks = *how.marks;
  const std::uint32_t failures = marks.failed(id);
  const Status reason = marks.Why(id);
  if (failures >= RestoreMarks::kWithoutCheckpoint) {
    Register(id, NotRestored(id, reason));
    return {};
  }
  how.with_journal = failures < RestoreMarks::kWithoutJournal;
  if (auto marked = how.with_journal ? marks.Begin({id}) : marks.BeginWithoutJournal(id); !marked) return marked;
  auto session = RestoreOne(id, how);
  if (how.control.given_up()) {
    if (session) (*session)->KeepStored();
    if (auto marked = marks.Set(id, failures); !marked) return marked;
    return StartGivenUp();
  }
  if (how.with_journal) {
    if (auto unmarked = marks.Succeeded({id}); !unmarked) return unmarked;
    Register(id, std::move(session));
    return {};
  }
  // Every later start does the same. Where the checkpoint cannot be used either, it is not read again.
  if (session) {
    if (auto marked = marks.Set(id, failures); !marked) return marked;
  }
  // The robot has moved on since the checkpoint, so it begins a new session. What is stored of this one stays, and its
  // part of the map is shown as it was in the checkpoint.
  const Status why = session ? reason : session.error();
  Register(id, NotRestored(id, why));
  return {};
}

// Makes the session known, or the reason why it is not.
void Roster::Register(SessionId id, RestoredSession restored) {
  if (!restored) return;  // NotRestored has set it aside.
  const MutexLock lock(mutex_);
  const auto known = sessions_.find((*restored)->record().state().robot_id);
  Place(*restored, known == sessions_.end() || known->second->id() < id);
}

// `first`: the session becomes the present one of its robot, and the one before becomes an earlier session; else it is
// an earlier session itself.
void Roster::Place(const std::shared_ptr<Session>& session, bool first) {
  const SessionState state = session->record().state();
  if (const auto site = atlas_.Find(state.site)) Enter(*site, session);
  std::shared_ptr<Session> earlier = session;
  if (first) std::swap(earlier, sessions_[state.robot_id]);
  if (earlier == nullptr) return;
  earlier->End({StatusCode::kAborted, "another session of '" + state.robot + "' follows"});
  gone_.push_back({std::move(earlier), true});
}

// Sets the session aside. The robot can be told why it must open a new one.
Roster::RestoredSession Roster::NotRestored(SessionId id, Status why) {
  std::string what = "session " + std::to_string(id), site;
  if (const auto stored = ReadSession(journal_->store(), id)) {
    site = stored->request.site;
    what += " of robot '" + stored->request.robot + "' in site '" + site + "'";
    const MutexLock lock(mutex_);
    not_restored_[stored->request.robot] = why;
    if (const auto drawn_in = atlas_.Find(site)) {
      drawn_in->LosePart();
      drawn_in->End(id);
    }
  } else {
    // Its own record cannot be read either. Sites without a map are asked as well: it may have drawn one of them and
    // not have been the last session of its robot there.
    const auto sites = atlas_.All();
    const auto was_drawn = [id](const auto& one) { return one->WasDrawnBy(id); };
    const bool known = std::ranges::any_of(sites, was_drawn);
    for (const auto& one : sites) {
      if (known ? was_drawn(one) : !one->begun()) one->LosePart();
    }
  }
  spdlog::error("{}", journal_->set_aside().Add(site, what, why));
  return tl::unexpected(std::move(why));
}

Roster::RestoredSession Roster::RestoreOne(SessionId id, const Restoring& how) {
  const CrashNote::Working working(id);
  try {
    auto restored = ReadBack(id, how);
    if (restored || how.control.given_up()) return restored;
    const auto shown = how.with_journal ? ReadCheckpointOnly(id, how) : nullptr;
    return NotRestored(id, restored.error());
  } catch (const std::exception& error) {
    return NotRestored(id, {StatusCode::kInternal, error.what()});
  }
}

// Shows the session's part of the map as it was in its last checkpoint. Null: that cannot be read.
std::shared_ptr<Session> Roster::ReadCheckpointOnly(SessionId id, Restoring how) {
  how.with_journal = false;
  auto session = ReadBack(id, how);
  return session ? *std::move(session) : nullptr;
}

SessionId Roster::ReserveIds(std::uint64_t count) {
  const MutexLock lock(mutex_);
  return std::exchange(next_id_, next_id_ + count);
}

Result<void> Roster::HasRoomFor(const std::set<std::string>& robots) const {
  const MutexLock lock(mutex_);
  if (sessions_.size() + robots.size() > static_cast<std::size_t>(options_.max_robots)) {
    return Fail(StatusCode::kResourceExhausted, std::to_string(sessions_.size()) + " robots have sessions; with " +
                                                    std::to_string(robots.size()) +
                                                    " more they are too many (robots.max_robots)");
  }
  for (const std::string& robot : robots) {
    if (sessions_.contains(HashName(robot)))
      return Fail(StatusCode::kAlreadyExists, "robot '" + robot + "' has a session, and a robot has one session");
  }
  return {};
}

// One after the other on the caller's thread: those of the pool belong to the robots that drive meanwhile, and a
// session may take a minute.
std::size_t Roster::OpenStored(const std::vector<SessionId>& ids, StartControl& control) {
  const std::set<SessionId> loaded(ids.begin(), ids.end());
  std::size_t taken = 0;
  for (const SessionId id : ids) {
    auto session = RestoreOne(id, {control});
    if (control.given_up()) {  // The next server restores them all.
      if (session) (*session)->KeepStored();
      break;
    }
    if (!session) continue;  // NotRestored has set it aside.
    const MutexLock lock(mutex_);
    const auto known = sessions_.find((*session)->record().state().robot_id);
    Place(*session, known == sessions_.end() || (loaded.contains(known->second->id()) && known->second->id() < id));
    ++taken;
  }
  return taken;
}

Result<std::shared_ptr<Site>> Roster::RemoveSite(const std::string& name) {
  std::vector<std::shared_ptr<Session>> removed, earlier;  // Freed without the lock.
  std::shared_ptr<Site> site;
  {
    const MutexLock lock(mutex_);
    site = atlas_.Find(name);
    if (site == nullptr) return Fail(StatusCode::kNotFound, "no site '" + name + "'");
    for (const auto& [robot_id, session] : sessions_) {
      const SessionState state = session->record().state();
      if (state.site != name) continue;
      if (state.phase == SessionPhase::kActive) {
        return Fail(StatusCode::kFailedPrecondition,
                    "robot '" + state.robot + "' is active in site '" + name + "'; end its session first");
      }
      removed.push_back(session);
    }
    const auto leaves_its_records = [this](Session& session) {
      session.KeepStored();
      if (journal_ != nullptr) journal_->Close(session.id());
    };
    for (const auto& session : removed) {
      leaves_its_records(*session);
      sessions_.erase(session->record().state().robot_id);
      gone_.push_back({session, false});
    }
    for (Leaving& leaving : gone_) {
      if (leaving.session->record().state().site == name && leaving.keep) leaves_its_records(*leaving.session);
      leaving.keep = leaving.keep && leaving.session->record().state().site != name;
    }
    std::erase_if(earlier_, [&](const auto& one) {
      if (one.second->record().state().site != name) return false;
      leaves_its_records(*one.second);
      earlier.push_back(one.second);
      return true;
    });
    atlas_.Remove(name);
  }
  for (const auto& session : removed) session->End({StatusCode::kNotFound, "the site '" + name + "' was deleted"});
  return site;
}

Roster::RestoredSession Roster::ReadBack(SessionId id, const Restoring& how) {
  auto read = ReadSession(journal_->store(), id);
  if (!read) return tl::unexpected(read.error());
  Result<std::shared_ptr<Site>> site = atlas_.Find(read->request.site);
  if (*site == nullptr) site = atlas_.Enter(read->request.site);
  if (!site) return tl::unexpected(site.error());
  const Stored stored{std::move(*read), *site, ReadCheckpoint(journal_->store(), id)};
  const auto& checkpoint = stored.checkpoint;
  // For example, a newer server has written it: to go on without it would end in writing over it.
  if (!checkpoint && checkpoint.error().code != StatusCode::kDataLoss) return tl::unexpected(checkpoint.error());
  if (checkpoint && !*checkpoint) return FromJournal(stored, how);

  auto loaded = checkpoint ? LoadCheckpoint(stored, mapper_) : tl::unexpected(checkpoint.error());
  if (loaded) return GoOn(stored, std::move(*loaded), how);
  const Status why = loaded.error();
  if (why.code == StatusCode::kUnimplemented) return tl::unexpected(why);
  const bool other_options = checkpoint && why.code == StatusCode::kFailedPrecondition;
  const auto options = other_options ? SessionEstimator::OptionsOf((*checkpoint)->bytes, mapper_)
                                     : Result<slam::MapperOptions>(tl::unexpected(why));
  if (!options || (how.with_journal && (*checkpoint)->position <= kMostReprocessed)) {
    spdlog::warn("the checkpoint of session {} is not used: {}", id, why.message);
    auto session = FromJournal(stored, how);
    if (session || !options || how.control.given_up()) return session;
  }
  spdlog::warn("session {} goes on with the options that it was begun with: {}", id, why.message);
  loaded = LoadCheckpoint(stored, *options);
  if (!loaded) return tl::unexpected(loaded.error());
  return GoOn(stored, std::move(*loaded), how);
}

Result<Roster::Begun> Roster::LoadCheckpoint(const Stored& stored, const slam::MapperOptions& mapper) const {
  const StoredCheckpoint& checkpoint = **stored.checkpoint;
  Begun begun{MakeToRestore(stored, mapper), checkpoint.position, {}};
  const auto loaded = begun.session->Load(checkpoint.bytes, checkpoint.PiecesInOrder());
  if (!loaded) return tl::unexpected(loaded.error());
  for (const auto& [number, parts] : checkpoint.parts) begun.pieces.emplace(number, StoredPiece{nullptr, parts});
  for (std::size_t i = 0; i < loaded->size(); ++i) begun.pieces[checkpoint.order[i]].value = (*loaded)[i];
  return begun;
}

// From the first entry on.
Roster::RestoredSession Roster::FromJournal(const Stored& stored, const Restoring& how) {
  if (!how.with_journal)
    return Fail(StatusCode::kDataLoss, "it has no checkpoint that can be used, and its journal is left out");
  return GoOn(stored, {MakeToRestore(stored, mapper_), 0, {}}, how);
}

std::shared_ptr<Session> Roster::MakeToRestore(const Stored& stored, const slam::MapperOptions& mapper) const {
  auto session = Make(stored.session, stored.site, mapper);
  session->KeepStored();  // Also if an exception ends the restore.
  static_cast<void>(session->record().AddSensors(stored.session.request.sensors));
  return session;
}

// Processes the journal that follows again.
Roster::RestoredSession Roster::GoOn(const Stored& stored, Begun begun, const Restoring& how) {
  auto& [session, position, pieces] = begun;
  if (!how.with_journal) {
    session->Replayed();
    return session;  // To be dropped, with its records kept.
  }
  const SessionId id = stored.session.id;
  const auto switched = [&stored](std::uint32_t epoch, std::uint64_t generation) {
    return stored.site->Switched(epoch, generation);
  };
  const auto replay = [&, &session = session](std::uint64_t at, JournalEntry&& entry) -> Result<void> {
    if (how.control.given_up()) return StartGivenUp();
    session->Replay(std::move(entry), switched);
    how.control.Advance();
    return how.marks != nullptr ? how.marks->Reached(id, at) : Result<void>{};
  };
  const auto last = ReadJournal(journal_->store(), id, position, replay);
  if (!last) return tl::unexpected(last.error());
  // Without the checkpoint and without any entry it would begin where the robot once stood.
  const bool had_checkpoint = !stored.checkpoint || *stored.checkpoint;
  if (position == 0 && had_checkpoint && *last == 0)
    return Fail(StatusCode::kDataLoss, "its checkpoint cannot be used, and the journal before it was removed");
  session->Replayed();
  session->SetCheckpointed(position, *last);
  journal_->Reopen(id, *last, DurableFor(session), position, std::move(pieces));
  session->KeepStored(false);
  return session;
}

}  // namespace cairn::server
