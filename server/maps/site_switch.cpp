// How a site switches to another map version, and gives a session the part of it that it has missed (site.h).
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/maps/site.h"

namespace cairn::server {

// One session's answer to a correction. If a session ends without an answer, it drops the ticket, and the
// destructor answers instead. So a version switch never waits for ever.
class Site::Ticket {
 public:
  Ticket(std::shared_ptr<Site> site, std::uint32_t version, SessionId session)
      : site_(std::move(site)), version_(version), session_(session) {}
  Ticket(const Ticket&) = delete;
  Ticket& operator=(const Ticket&) = delete;
  ~Ticket() {
    if (!used_) Answer(std::nullopt);
  }
  void Answer(std::optional<Adopted> adopted) {
    used_ = true;
    site_->Run([version = version_, session = session_, adopted = std::move(adopted)](Site& site) mutable {
      site.Settle(version, session, std::move(adopted));
    });
  }

 private:
  const std::shared_ptr<Site> site_;
  const std::uint32_t version_;
  const SessionId session_;
  bool used_ = false;
};

void Site::Begin(std::uint32_t version, Done done, EnabledBy by) {
  const MapVersion* const wanted = versions_.Find(version);
  if (wanted == nullptr) {
    return done(Fail(StatusCode::kNotFound, "site '" + name_ + "' has no map version " + std::to_string(version)));
  }
  if ((by == EnabledBy::kJoin || by == EnabledBy::kAlignment) && JoinsOneOf(kept_apart(), *wanted))
    return done(Fail(StatusCode::kFailedPrecondition, "a person has taken a robot of the version out of the map"));
  if (version == versions_.enabled()) {
    chosen_ = chosen_ || by == EnabledBy::kPerson;
    StoreSite();
    Refresh({}, {}, false);  // The notes of the versions say so.
    return done(version);
  }
  switch_.emplace();
  switch_->version = version;
  switch_->by = by;
  switch_->done = std::move(done);
  for (const auto& [session, part] : wanted->parts) {
    switch_->awaited.insert(session);
    const auto ticket = std::make_shared<Ticket>(shared_from_this(), version, session);
    Correction correction{.epoch = epoch_ + 1,
                          .generation = generation_,
                          .grid = part,
                          .done = [ticket](Adopted&& adopted) { ticket->Answer(std::move(adopted)); },
                          .completed = switch_->completed};
    // If the session has ended, the correction and its ticket are dropped here.
    if (const auto owner = OwnerOf(session)) owner->Adopt(std::move(correction));
  }
  CommitIfComplete();
}

std::shared_ptr<GridOwner> Site::OwnerOf(SessionId session) const {
  const auto member = members_.find(session);
  return member == members_.end() ? nullptr : member->second.owner.lock();
}

void Site::Settle(std::uint32_t version, SessionId session, std::optional<Adopted>&& adopted) {
  if (!switch_ || switch_->version != version || switch_->awaited.erase(session) == 0) return;
  if (adopted) {
    slam::OccupancyGrid::Chunks& staged = switch_->staged[session];
    for (const auto& [key, chunk] : adopted->change.chunks) {
      if (chunk != nullptr) staged.emplace(key, chunk);
    }
    switch_->drawn.emplace(session, adopted->change.drawn);
    if (adopted->fragment) switch_->apart.insert(session);
    switch_->displaced.emplace(session, std::move(adopted->displaced));
  } else {
    StageGone(session);
  }
  CommitIfComplete();
}

void Site::CommitIfComplete() {
  if (!switch_->awaited.empty()) return;
  VersionSwitch complete = std::move(*switch_);
  switch_.reset();
  StoreTogether([&] {
    KeepApart(complete);
    for (const auto& [session, chunks] : complete.staged) {
      joint_.Replace(session, chunks);
      joint_.SetHidden(session, complete.apart.contains(session));
      if (OwnerOf(session) == nullptr) {
        joint_.SetPast(session);
        layers_.insert(session);
        if (complete.drawn[session].path == nullptr) ForgetPath(session);  // Where it lies now is not known.
      }
    }
    FollowPaths(complete.drawn);
    for (const auto& [session, chunks] : complete.staged)
      if (layers_.contains(session)) StoreLayer(session);
    const std::vector<std::uint32_t> changed = versions_.Enable(complete.version, complete.displaced);
    // A robot that is joined changes nothing of what a person has chosen.
    chosen_ = complete.by == EnabledBy::kPerson || (chosen_ && complete.by != EnabledBy::kJob);
    switches_[++epoch_] = generation_;
    while (switches_.size() > kMostSwitches) switches_.erase(switches_.begin());
    for (const std::uint32_t version : changed) StoreVersion(version);
    memory_.CountSoon();
    RenderAll();
  });
  *complete.completed = true;
  for (const auto& [session, member] : members_) {
    if (complete.staged.contains(session)) continue;
    if (const auto owner = member.owner.lock()) owner->SetMapEpoch(epoch_);
  }
  Send();
  complete.done(complete.version);
}

// One that was a fragment before, too, is none that the person has taken out.
void Site::KeepApart(const VersionSwitch& complete) {
  const MutexLock lock(mutex_);
  for (const auto& [session, chunks] : complete.staged) {
    if (!complete.apart.contains(session)) {
      kept_apart_.erase(session);
    } else if (complete.by == EnabledBy::kPerson && !joint_.hidden().contains(session)) {
      kept_apart_.insert(session);
    }
  }
}

void Site::FailSwitch(StatusCode code, const std::string& why) {
  if (!switch_) return;
  const Done waiting = std::move(switch_->done);
  switch_.reset();
  waiting(Fail(code, why));
}

// A session that was restored from an earlier epoch, because its journal had no room for the correction. It gets its
// part of the enabled version now; without it, its poses and what it draws would be those of another map.
bool Site::GiveMissedPart(const Member& member) {
  const MapVersion& enabled = *versions_.Find(versions_.enabled());
  const auto part = enabled.parts.find(member.session);
  const auto made_by = switches_.find(epoch_);
  const auto owner = member.owner.lock();
  if (switch_ || owner == nullptr || member.epoch > epoch_ || part == enabled.parts.end() || made_by == switches_.end())
    return false;
  owner->Adopt({.epoch = epoch_,
                .generation = made_by->second,
                .grid = part->second,
                .done = [site = shared_from_this()](Adopted&& adopted) {
                  site->Run([adopted = std::move(adopted)](Site& self) {
                    self.joint_.Apply(adopted.change);
                    self.joint_.SetHidden(adopted.session, adopted.fragment);
                    self.FollowPaths({{adopted.session, adopted.change.drawn}});
                    self.StoreSite();
                  });
                }});
  return true;
}

}  // namespace cairn::server
