// What the map of a site takes in memory, and what it gives up to take less (site.h). What is least needed goes first:
// 1. the layer of disagreement, which is made again when somebody asks for it;
// 2. map versions that are not enabled, the oldest first. The one before the enabled version stays, because a roll back
//    goes there, and the newest one, because a job has just made it;
// 3. the oldest layers of sessions that exist no more: two become one, and the map shows the same;
// 4. what an earlier session saw, where others have drawn all of its area. Its layer stays. Jobs cannot fit it again;
// 5. the newest version, a minute after it was made, and then the one before the enabled one.
// The enabled version, the map and what robots draw today are what they are localised in, and always stay. The coarse
// levels of the map stay as well: all of them together are a third of the finest one, and each change of the map and
// each client needs them.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <utility>

#include "server/maps/site.h"

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

bool Site::MemoryIsToBeCounted() const {
  return memory_changed_ && (!memory_counted_ || Clock::now() - *memory_counted_ >= kCountAgainAfter);
}

// After what may have changed much.
void Site::CountSoon() {
  if (!memory_is_limited_) return;
  memory_changed_ = true;
  memory_counted_.reset();
}

void Site::CountMemory(const MapSnapshot& snapshot) noexcept {
  memory_changed_ = true;
  if (!MemoryIsToBeCounted()) return;
  memory_counted_ = Clock::now();
  try {
    MemoryCount memory;
    joint_.Count(memory);
    versions_.Count(memory);
    for (const auto& [session, drawn] : paths_) {
      if (drawn.path != nullptr) memory.Add(drawn.path, drawn.path->size() * sizeof(Pose2));
      if (drawn.numbers != nullptr) memory.Add(drawn.numbers, drawn.numbers->size() * sizeof(std::uint64_t));
    }
    for (const TileSet* tiles : {&snapshot.tiles, &snapshot.disagreement}) {
      for (int level = 0; level < kPyramidLevels; ++level)
        tiles->ForEach(level,
                       [&](const TileSet::TilePtr& tile) { memory.Add(tile, sizeof(Tile) + tile->bytes.size()); });
    }
    memory_bytes_ = memory.bytes();
    memory_changed_ = false;
  } catch (const std::exception&) {  // Without memory for the count, the last one stays.
  }
}

std::uint64_t Site::MemoryLimit() const {
  const std::uint64_t share = memory_share_;
  return memory_limit_ == 0 || (share != 0 && share < memory_limit_) ? share : memory_limit_;
}

void Site::StayWithinMemory(Clock::time_point now) {
  if (!memory_is_limited_ || retired_ || switch_) return;
  const std::uint64_t limit = MemoryLimit();
  if (limit == 0 || memory_bytes_ <= limit) spare_session_ = 0;  // None has to go any more.
  GaveUp gave_up = GaveUp::kSomething;
  while (limit != 0 && memory_bytes_ > limit && gave_up == GaveUp::kSomething) {
    gave_up = GiveUpLeastNeeded(now);
    if (gave_up != GaveUp::kSomething) continue;
    CountSoon();
    Render();
  }
  // While something may still go, nothing else is said than before.
  NoteLimits(limit != 0 && memory_bytes_ > limit && (gave_up == GaveUp::kNothing || gives_no_more_));
  std::string note = MemoryNote(gives_no_more_);
  if (note == memory_note_) return;
  if (!note.empty()) spdlog::warn("site {}: {}", name_, note);
  memory_note_ = std::move(note);
  Refresh({}, {}, false);
}

// `is_above`: the map takes more than it may now, and can give up no more.
void Site::NoteLimits(bool is_above) {
  const std::uint64_t share = memory_share_;
  const auto stays = [this, is_above](bool was, std::uint64_t limit, bool clearly_below) {
    return (is_above && limit != 0 && memory_bytes_ > limit) || (was && !clearly_below);
  };
  above_own_ = stays(above_own_, memory_limit_, IsClearlyBelow(memory_bytes_, memory_limit_));
  above_share_ = stays(above_share_, share, total_clearly_below_);
  gives_no_more_ = above_own_ || above_share_;
}

Site::GaveUp Site::GiveUpLeastNeeded(Clock::time_point now) {
  if (disagreement_wanted_) {
    disagreement_given_up_ = true;
    Refresh({}, DropDisagreement(), false);
    return GaveUp::kSomething;
  }
  if (GiveUpVersion(false) || GiveUpLayer()) return GaveUp::kSomething;
  if (OfferSpareSession(now)) return GaveUp::kLaterPerhaps;
  if (version_added_ && now < *version_added_ + kNewVersionStays) return GaveUp::kLaterPerhaps;
  return GiveUpVersion(true) ? GaveUp::kSomething : GaveUp::kNothing;
}

bool Site::GiveUpVersion(bool last) {
  const auto version = versions_.LeastNeeded(last);
  if (!version) return false;
  versions_.Remove(*version);
  ++given_up_.versions;
  StoreTogether([&] {
    RemoveOldVersions();
    StoreSite();
  });
  return true;
}

bool Site::GiveUpLayer() {
  const std::size_t layers = ShownLayers().size();
  if (layers < 2) return false;
  ++given_up_.layers;
  StoreTogether([&] {
    MergeOldestLayers(layers - 1);
    RemoveOtherLayers();
    StoreSite();
  });
  return true;
}

// Returns whether one may leave soon. Which sessions a robot goes on with is not known here, so one after the other is
// offered for some time.
bool Site::OfferSpareSession(Clock::time_point now) {
  if (next_offer_ && now < *next_offer_) return spare_session_ != 0;
  spare_session_ = 0;
  for (const SessionId session : joint_.past()) {
    if (layers_.contains(session) || offered_.contains(session) || OwnerOf(session) == nullptr) continue;
    if (joint_.hidden().contains(session) || !joint_.IsCovered(session)) continue;
    offered_.insert(session);
    spare_session_ = session;
    next_offer_ = now + kOffered;
    return true;
  }
  if (!offered_.empty()) next_offer_ = now + kOfferedAgainAfter;
  offered_.clear();
  return false;
}

void Site::NoteLeft(SessionId session) {
  CountSoon();
  if (spare_session_ != session) return;
  spare_session_ = 0;
  next_offer_.reset();
  ++given_up_.sessions;
}

std::string Site::MemoryNote(bool above) const {
  if (!memory_is_limited_) return "";
  std::string gone;
  const auto add = [&gone](const std::string& what) { gone += (gone.empty() ? "" : "; ") + what; };
  if (disagreement_given_up_) add("the layer of disagreement is made anew whenever somebody asks for it");
  if (given_up_.versions > 0) add(fmt::format("map versions removed: {}", given_up_.versions));
  if (given_up_.layers > 0) add(fmt::format("layers of earlier sessions merged: {}", given_up_.layers));
  if (given_up_.sessions > 0) add(fmt::format("earlier sessions forgotten but for their map: {}", given_up_.sessions));
  if (!above && gone.empty()) return "";
  const std::string limits = "maps.max_memory_mib, maps.max_total_memory_mib";
  if (!above) return fmt::format("to stay below the limit of memory ({}): {}", limits, gone);
  return fmt::format("{} ({}), and all that is left is needed where robots drive{}", kAboveMemoryLimit, limits,
                     gone.empty() ? "" : "; given up so far: " + gone);
}

}  // namespace cairn::server
