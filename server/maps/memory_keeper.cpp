#include "server/maps/memory_keeper.h"

#include <fmt/format.h>

#include <exception>
#include <utility>

#include "common/service/map_info.h"
#include "server/maps/memory_shares.h"

namespace cairn::server {
namespace {

// Counting looks at every chunk of every version.
constexpr std::chrono::seconds kCountAgainAfter{10};
// A session that is not needed may be one that a robot goes on with. Then it stays, and the next one is offered.
constexpr std::chrono::seconds kOffered{10};
constexpr std::chrono::seconds kOfferedAgainAfter{60};
// The job that has made a version enables it next.
constexpr std::chrono::seconds kNewVersionStays{60};

}  // namespace

void MemoryKeeper::Restore(const GivenUp& given_up) {
  given_up_ = given_up;
  note_ = NoteNow();
}

bool MemoryKeeper::IsToBeCounted(Clock::time_point now) const {
  return changed_ && (!counted_ || now - *counted_ >= kCountAgainAfter);
}

void MemoryKeeper::CountSoon() {
  if (!is_limited_) return;
  changed_ = true;
  counted_.reset();
}

void MemoryKeeper::NoteNewVersion(Clock::time_point now) {
  version_added_ = now;
  CountSoon();
}

void MemoryKeeper::Count(Clock::time_point now, const std::function<void(MemoryCount&)>& count) noexcept {
  if (!IsToBeCounted(now)) return;
  counted_ = now;
  try {
    MemoryCount memory;
    count(memory);
    bytes_ = memory.bytes();
    changed_ = false;
  } catch (const std::exception&) {
  }
}

std::uint64_t MemoryKeeper::Limit() const {
  const std::uint64_t share = share_;
  return limit_ == 0 || (share != 0 && share < limit_) ? share : limit_;
}

bool MemoryKeeper::Keep(Clock::time_point now, MemoryHolder& map) {
  if (!is_limited_) return false;
  const std::uint64_t limit = Limit();
  if (limit == 0 || bytes_ <= limit) spare_session_ = 0;  // None has to go any more.
  GaveUp gave_up = GaveUp::kSomething;
  while (limit != 0 && bytes_ > limit && gave_up == GaveUp::kSomething) {
    gave_up = GiveUpLeastNeeded(now, map);
    if (gave_up != GaveUp::kSomething) continue;
    CountSoon();
    map.ShowWhatIsLeft();
  }
  // While something may still go, nothing else is said than before.
  NoteLimits(limit != 0 && bytes_ > limit && (gave_up == GaveUp::kNothing || gives_no_more_));
  const std::string before = std::exchange(note_, NoteNow());
  return note_ != before;
}

// `is_above`: the map takes more than it may now, and can give up no more.
void MemoryKeeper::NoteLimits(bool is_above) {
  const std::uint64_t share = share_;
  const auto stays = [this, is_above](bool was, std::uint64_t limit, bool clearly_below) {
    return (is_above && limit != 0 && bytes_ > limit) || (was && !clearly_below);
  };
  above_own_ = stays(above_own_, limit_, IsClearlyBelow(bytes_, limit_));
  above_share_ = stays(above_share_, share, total_clearly_below_);
  gives_no_more_ = above_own_ || above_share_;
}

MemoryKeeper::GaveUp MemoryKeeper::GiveUpLeastNeeded(Clock::time_point now, MemoryHolder& map) {
  if (map.HasDisagreement()) {
    disagreement_given_up_ = true;
    map.DropDisagreement();
    return GaveUp::kSomething;
  }
  if (GiveUpVersion(false, map) || GiveUpLayer(map)) return GaveUp::kSomething;
  if (OfferSpareSession(now, map)) return GaveUp::kLaterPerhaps;
  if (version_added_ && now < *version_added_ + kNewVersionStays) return GaveUp::kLaterPerhaps;
  return GiveUpVersion(true, map) ? GaveUp::kSomething : GaveUp::kNothing;
}

bool MemoryKeeper::GiveUpVersion(bool last, MemoryHolder& map) {
  const auto version = map.LeastNeededVersion(last);
  if (!version) return false;
  ++given_up_.versions;
  map.RemoveVersion(*version);
  return true;
}

bool MemoryKeeper::GiveUpLayer(MemoryHolder& map) {
  if (map.Layers() < 2) return false;
  ++given_up_.layers;
  map.MergeOldestLayers();
  return true;
}

// Returns whether one may leave soon. Which sessions a robot goes on with is not known here, so one after the other is
// offered for some time.
bool MemoryKeeper::OfferSpareSession(Clock::time_point now, const MemoryHolder& map) {
  if (next_offer_ && now < *next_offer_) return spare_session_ != 0;
  spare_session_ = 0;
  for (const SessionId session : map.EndedSessions()) {
    if (offered_.contains(session) || !map.IsSpare(session)) continue;
    offered_.insert(session);
    spare_session_ = session;
    next_offer_ = now + kOffered;
    return true;
  }
  if (!offered_.empty()) next_offer_ = now + kOfferedAgainAfter;
  offered_.clear();
  return false;
}

void MemoryKeeper::NoteLeft(SessionId session) {
  CountSoon();
  if (spare_session_ != session) return;
  spare_session_ = 0;
  next_offer_.reset();
  ++given_up_.sessions;
}

std::string MemoryKeeper::NoteNow() const {
  if (!is_limited_) return "";
  std::string gone;
  const auto add = [&gone](const std::string& what) { gone += (gone.empty() ? "" : "; ") + what; };
  if (disagreement_given_up_) add("the layer of disagreement is made anew whenever somebody asks for it");
  if (given_up_.versions > 0) add(fmt::format("map versions removed: {}", given_up_.versions));
  if (given_up_.layers > 0) add(fmt::format("layers of earlier sessions merged: {}", given_up_.layers));
  if (given_up_.sessions > 0) add(fmt::format("earlier sessions forgotten but for their map: {}", given_up_.sessions));
  if (!gives_no_more_ && gone.empty()) return "";
  const std::string limits = "maps.max_memory_mib, maps.max_total_memory_mib";
  if (!gives_no_more_) return fmt::format("to stay below the limit of memory ({}): {}", limits, gone);
  return fmt::format("{} ({}), and all that is left is needed where robots drive{}", kAboveMemoryLimit, limits,
                     gone.empty() ? "" : "; given up so far: " + gone);
}

}  // namespace cairn::server
