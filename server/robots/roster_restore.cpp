// How the roster restores the sessions of earlier servers (roster.h).
#include <spdlog/spdlog.h>

#include <asio/post.hpp>
#include <chrono>
#include <latch>
#include <utility>

#include "server/robots/roster.h"

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

}  // namespace

Result<void> Roster::Restore() {
  if (journal_ == nullptr) return {};
  const auto ids = journal_->store().Owners(RecordKind::kSession);
  if (!ids) return tl::unexpected(ids.error());
  const auto begin = std::chrono::steady_clock::now();
  std::vector<Result<std::shared_ptr<Session>>> sessions(ids->size(), Fail(StatusCode::kInternal, "not restored"));
  std::latch done(static_cast<std::ptrdiff_t>(ids->size()));
  for (std::size_t i = 0; i < ids->size(); ++i) {
    asio::post(pool_, [&, i] {
      try {
        sessions[i] = RestoreOne((*ids)[i]);
      } catch (const std::exception& error) {
        sessions[i] = Fail(StatusCode::kInternal, error.what());
      }
      done.count_down();
    });
  }
  done.wait();
  const MutexLock lock(mutex_);
  for (std::size_t i = 0; i < ids->size(); ++i) {
    next_id_ = std::max(next_id_, (*ids)[i] + 1);
    if (!sessions[i]) {
      if (sessions[i].error().code == StatusCode::kFailedPrecondition) return tl::unexpected(sessions[i].error());
      spdlog::error("session {} is not restored: {}", (*ids)[i], sessions[i].error().message);
      continue;
    }
    const std::shared_ptr<Session>& session = *sessions[i];
    const SessionState state = session->record().state();
    // A later session of the same robot takes the place of an earlier one, whose part of the map stays.
    sessions_.insert_or_assign(state.robot_id, session);
    if (const auto site = atlas_.Find(state.site)) site->Join(state.robot_id, session->id(), session);
  }
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  spdlog::info("{} sessions restored in {:.2f} s", sessions_.size(), took.count());
  return {};
}

Result<std::shared_ptr<Session>> Roster::RestoreOne(SessionId id) {
  const auto stored = ReadSession(journal_->store(), id);
  if (!stored) return tl::unexpected(stored.error());
  Result<std::shared_ptr<Site>> site = atlas_.Find(stored->request.site);
  if (*site == nullptr) site = atlas_.Enter(stored->request.site);
  if (!site) return tl::unexpected(site.error());
  const auto make = [&] {
    auto made = Make(id, stored->request, stored->map_epoch, *site);
    static_cast<void>(made->record().AddSensors(stored->request.sensors));
    return made;
  };
  std::shared_ptr<Session> session = make();
  const auto checkpoint = ReadCheckpoint(journal_->store(), id);
  std::uint64_t position = 0;
  if (checkpoint && *checkpoint) {
    if (const auto loaded = session->Load((*checkpoint)->bytes)) {
      position = (*checkpoint)->position;
    } else {
      // For example, the estimator has other options now. The whole journal can be replayed instead, if it is still
      // there.
      spdlog::warn("the checkpoint of session {} is not used: {}", id, loaded.error().message);
      session->KeepStored();
      session = make();
    }
  }
  const auto switched = [&site](std::uint32_t epoch, std::uint64_t generation) {
    return (*site)->Switched(epoch, generation);
  };
  const auto last =
      ReadJournal(journal_->store(), id, position, [&](std::uint64_t, JournalEntry&& entry) -> Result<void> {
        session->Replay(std::move(entry), switched);
        return {};
      });
  if (!last) {
    session->KeepStored();
    return tl::unexpected(last.error());
  }
  session->Replayed();
  journal_->Reopen(id, *last, DurableFor(session));
  return session;
}

}  // namespace cairn::server
