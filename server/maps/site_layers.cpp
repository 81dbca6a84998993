// What sessions that no longer exist have drawn in a site's map (site.h).
#include <utility>

#include "server/maps/site.h"
#include "server/maps/stored_grid.h"

namespace cairn::server {

namespace {

// Where there are more, the oldest are merged, so that a site's memory follows its area and not the number of sessions.
constexpr std::size_t kMaxLayers = 8;

}  // namespace

void Site::StoreLayer(SessionId session) {
  Put({RecordKind::kLayer, site_id_, session},
      [layer = StoredLayer{session, ToStored(PartOfGone(session))}] { return BytesOf(layer); });
}

RobotGrid Site::PartOfGone(SessionId session) const {
  RobotGrid part{.chunks = joint_.ChunksOf(session)};
  const auto drawn = paths_.find(session);
  if (drawn == paths_.end()) return part;
  part.path = drawn->second.path;
  part.numbers = drawn->second.numbers;
  if (!part.path->empty()) part.keyframes = part.numbers == nullptr ? part.path->size() : part.numbers->back() + 1;
  return part;
}

// What nobody sees goes with the session: nothing can be joined with it any more. While the map is being switched it is
// not known what will be shown.
void Site::KeepAsLayer(SessionId session) {
  const bool shown = !joint_.hidden().contains(session) && !joint_.ChunksOf(session).empty();
  if (shown || switch_) {
    joint_.SetPast(session);
    layers_.insert(session);
    AnchorElsewhere(session);
    StoreLayer(session);
    if (!switch_) MergeOldestLayers(kMaxLayers);
  } else {
    joint_.Remove(session);
    ForgetPath(session);
    AnchorElsewhere(session);
    layers_.erase(session);
  }
  RemoveOtherLayers();
  memory_.NoteLeft(session);
  StoreSite();
}

// All records of layers that are none any more, also those that an earlier change has left because there was no room
// for it.
void Site::RemoveOtherLayers() {
  std::set<SessionId> stay = layers_;
  stay.insert(unreadable_layers_.begin(), unreadable_layers_.end());
  SessionId next = 0;
  for (const SessionId kept : stay) {
    if (kept > next) RemoveRecords({.kind = RecordKind::kLayer, .owner = site_id_, .first = next, .last = kept - 1});
    next = kept + 1;
  }
  RemoveRecords({.kind = RecordKind::kLayer, .owner = site_id_, .first = next});
}

std::vector<SessionId> Site::ShownLayers() const {
  std::vector<SessionId> shown;
  for (const SessionId session : joint_.past())
    if (layers_.contains(session) && !joint_.hidden().contains(session)) shown.push_back(session);
  return shown;
}

void Site::MergeOldestLayers(std::size_t most) {
  const std::vector<SessionId> shown = ShownLayers();
  for (std::size_t merged = 0; shown.size() - merged > most; ++merged) {
    const SessionId older = shown[merged], later = shown[merged + 1];
    const RobotGrid of_older{.chunks = joint_.ChunksOf(older)}, of_later{.chunks = joint_.ChunksOf(later)};
    // A version without a part of a session leaves its layer as it is.
    const auto sum = [&](const RobotGrid* first, const RobotGrid* second) {
      const RobotGrid& one = first != nullptr ? *first : of_older;
      const RobotGrid& two = second != nullptr ? *second : of_later;
      return joint_.SumOfPast(one.fragment ? slam::OccupancyGrid::Chunks{} : one.chunks,
                              two.fragment ? slam::OccupancyGrid::Chunks{} : two.chunks);
    };
    for (const std::uint32_t version : versions_.MergeParts(older, later, sum)) StoreVersion(version);
    joint_.MergePast(older, later);
    layers_.erase(older);
    merged_.erase(older);
    merged_.insert(later);
    for (const SessionId one : {older, later}) {
      ForgetPath(one);
      AnchorElsewhere(one);
    }
    StoreLayer(later);
  }
}

Result<void> Site::RestoreLayers(StartControl& control) {
  const auto take = [this, &control](std::uint64_t number, std::string_view bytes) -> Result<void> {
    control.Advance();
    const auto layer = LayerOf(bytes);
    if (!layer) return tl::unexpected(layer.error());
    if (layer->session != number) return Fail(StatusCode::kDataLoss, "the record is that of another session");
    const RobotGrid part = FromStored(layer->grid);
    layers_.insert(layer->session);
    joint_.Replace(layer->session, part.chunks);
    joint_.SetPast(layer->session);
    if (part.path != nullptr) paths_[layer->session] = {part.path, part.numbers};
    return {};
  };
  const auto unreadable = [this](std::uint64_t number, const Status& why) {
    unreadable_layers_.insert(number);
    PutAside("the part of the map that session " + std::to_string(number) + " has drawn", why);
  };
  return ReadEach(journal_->store(), {.kind = RecordKind::kLayer, .owner = site_id_}, take, unreadable);
}

void Site::StageGone(SessionId session) {
  const RobotGrid& part = versions_.Find(switch_->version)->parts.at(session);
  switch_->staged.emplace(session, part.chunks);
  switch_->drawn.emplace(session, DrawnPath{part.drawn != nullptr ? part.drawn : part.path, part.numbers});
  if (part.fragment) switch_->apart.insert(session);
  RobotGrid& displaced = switch_->displaced[session];
  displaced = PartOfGone(session);
  if (displaced.path == nullptr) displaced.keyframes = part.keyframes;
  displaced.fragment = joint_.hidden().contains(session);
}

}  // namespace cairn::server
