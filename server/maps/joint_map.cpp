#include "server/maps/joint_map.h"

#include <algorithm>
#include <utility>

#include "server/maps/layer_disagreement.h"
#include "server/maps/layer_sum.h"

namespace cairn::server {
namespace {

bool AllUnknown(const TileCells& cells) {
  return std::all_of(cells.begin(), cells.end(), [](std::uint8_t cell) { return cell == kUnknownCell; });
}

}  // namespace

JointMap::JointMap(double past_probability) : most_past_(slam::LogOddsOf(past_probability)) {}

void JointMap::Apply(const GridChange& change) {
  for (const auto& [key, chunk] : change.chunks) SetLayer(key, change.session, chunk);
  NoteLooks(change.session, change.looks);
}

void JointMap::NoteLooks(SessionId session, const slam::OccupancyGrid::Looks& looks) {
  if (hidden_.contains(session)) return;
  for (const auto& [key, cells] : looks) {
    const auto layers = chunks_.find(key);
    if (layers == chunks_.end() || layers->second.size() < 2 || !layers->second.contains(session)) continue;
    last_looks_[key].Note(session, cells);
    dirty_.insert(key);
  }
}

void JointMap::Replace(SessionId session, const slam::OccupancyGrid::Chunks& chunks) {
  ForgetLooksThatMoved(session, chunks);
  for (const auto& [key, chunk] : ChunksOf(session)) {
    if (!chunks.contains(key)) SetLayer(key, session, nullptr);
  }
  for (const auto& [key, chunk] : chunks) SetLayer(key, session, chunk);
}

// `chunks`: the grid of the session as it is from now on.
void JointMap::ForgetLooksThatMoved(SessionId session, const slam::OccupancyGrid::Chunks& chunks) {
  for (auto& [key, last] : last_looks_) {
    if (last.NumberOf(session) == 0) continue;
    const Layers& layers = chunks_.at(key);
    const auto before = layers.find(session);
    const auto now = chunks.find(key);
    if (before == layers.end() || now == chunks.end()) {
      last.Forget(session);
    } else {
      last.ForgetWhereDifferent(session, *before->second, *now->second);
    }
  }
}

slam::OccupancyGrid::Chunks JointMap::ChunksOf(SessionId session) const {
  slam::OccupancyGrid::Chunks mine;
  for (const auto& [key, layers] : chunks_) {
    const auto layer = layers.find(session);
    if (layer != layers.end()) mine.emplace(key, layer->second);
  }
  return mine;
}

bool JointMap::IsCovered(SessionId session) const {
  return std::ranges::all_of(chunks_, [&](const auto& place) {
    const Layers& layers = place.second;
    return !layers.contains(session) || std::ranges::any_of(layers, [&](const auto& layer) {
      return layer.first != session && !hidden_.contains(layer.first);
    });
  });
}

slam::OccupancyGrid::Chunks JointMap::DrawnBefore(SessionId session) const {
  constexpr int kAround = 2;  // Chunks.
  std::set<slam::ChunkKey> area;
  for (const auto& [key, layers] : chunks_) {
    if (!layers.contains(session)) continue;
    for (int dy = -kAround; dy <= kAround; ++dy)
      for (int dx = -kAround; dx <= kAround; ++dx) area.insert({key.x + dx, key.y + dy});
  }
  slam::OccupancyGrid::Chunks sum;
  for (const slam::ChunkKey& key : area) {
    const auto layers = chunks_.find(key);
    if (layers == chunks_.end()) continue;
    if (auto chunk = SumOf(
            layers->second, [&](SessionId other) { return other < session; }, nullptr))
      sum.emplace(key, std::move(chunk));
  }
  return sum;
}

void JointMap::SetEdits(EditOverlay overlay) {
  for (const auto& [key, cells] : edits_) {
    const auto now = overlay.find(key);
    if (now == overlay.end() || now->second != cells) dirty_.insert(key);
  }
  for (const auto& [key, cells] : overlay) {
    if (!edits_.contains(key)) dirty_.insert(key);
  }
  edits_ = std::move(overlay);
}

bool JointMap::IsShown(const Layers& layers) const {
  return std::ranges::any_of(layers, [this](const auto& layer) { return !hidden_.contains(layer.first); });
}

bool JointMap::drawn() const {
  return std::ranges::any_of(chunks_, [this](const auto& place) { return IsShown(place.second); });
}

std::vector<SessionId> JointMap::DrawnBy(slam::ChunkKey key) const {
  std::vector<SessionId> sessions;
  const auto layers = chunks_.find(key);
  if (layers == chunks_.end()) return sessions;
  for (const auto& [session, chunk] : layers->second)
    if (!hidden_.contains(session)) sessions.push_back(session);
  return sessions;
}

std::optional<std::pair<slam::ChunkKey, slam::ChunkKey>> JointMap::DrawnBox() const {
  std::optional<std::pair<slam::ChunkKey, slam::ChunkKey>> box;
  for (const auto& [key, layers] : chunks_) {
    if (!IsShown(layers)) continue;
    if (!box) box.emplace(key, key);
    auto& [low, high] = *box;
    low = {std::min(low.x, key.x), std::min(low.y, key.y)};
    high = {std::max(high.x, key.x), std::max(high.y, key.y)};
  }
  return box;
}

void JointMap::SetHidden(SessionId session, bool hidden) {
  const bool changed = hidden ? hidden_.insert(session).second : hidden_.erase(session) > 0;
  if (changed) MarkChanged(session);
}

void JointMap::SetPast(SessionId session) {
  if (!past_.emplace(session, past_.size()).second) return;
  for (const auto& [key, layers] : chunks_) {
    if (layers.contains(session)) dirty_.insert(key);  // By how much it differs from others stays the same.
  }
}

std::vector<SessionId> JointMap::past() const {
  std::vector<SessionId> in_order(past_.size());
  for (const auto& [session, before] : past_) in_order[before] = session;
  return in_order;
}

void JointMap::SetPastOrder(const std::vector<SessionId>& in_order) {
  past_.clear();
  for (const SessionId session : in_order) past_.emplace(session, past_.size());
}

slam::OccupancyGrid::Chunks JointMap::SumOfPast(const slam::OccupancyGrid::Chunks& older,
                                                const slam::OccupancyGrid::Chunks& later) const {
  slam::OccupancyGrid::Chunks sum = older;
  for (const auto& [key, chunk] : later) {
    std::shared_ptr<const slam::GridChunk>& place = sum[key];
    if (place == nullptr) {
      place = chunk;
      continue;
    }
    auto both = std::make_shared<slam::GridChunk>(*place);
    AddLater(*both, *chunk, most_past_);
    place = std::move(both);
  }
  return sum;
}

// The sum goes from the one that ended first to the last, so that the first ones can be summed before the others.
void JointMap::MergePast(SessionId older, SessionId later) {
  const auto of_older = ChunksOf(older), of_later = ChunksOf(later);
  std::set<slam::ChunkKey> changed = dirty_;
  auto merged = SumOfPast(of_older, of_later);
  for (auto& [key, last] : last_looks_) {
    const auto one = of_older.find(key), two = of_later.find(key);
    const std::uint8_t number = last.NumberOf(older);
    if (number == 0) continue;
    if (one != of_older.end() && two != of_later.end()) {
      // Where the one that ended first has looked last, the other one's evidence is the older one.
      auto both = std::make_shared<slam::GridChunk>(*two->second);
      AddLater(*both, *one->second, most_past_);
      for (std::size_t cell = 0; cell < kTileArea; ++cell)
        if (last.numbers()[cell] != number) both->log_odds[cell] = merged.at(key)->log_odds[cell];
      merged[key] = std::move(both);
    }
    last.Replace(older, later);
    changed.insert(key);  // Where more sessions have looked, less is known of their order.
  }
  for (const auto& [key, chunk] : merged) SetLayer(key, later, chunk);
  for (const auto& [key, chunk] : of_older) SetLayer(key, older, nullptr);
  std::vector<SessionId> in_order = past();
  const auto first = std::ranges::find(in_order, older), second = std::ranges::find(in_order, later);
  if (std::all_of(std::next(first), second, [this](SessionId between) { return hidden_.contains(between); }))
    dirty_ = changed;
  in_order.erase(second);
  *std::ranges::find(in_order, older) = later;
  SetPastOrder(in_order);
}

void JointMap::Remove(SessionId session) {
  Replace(session, {});
  hidden_.erase(session);
  std::vector<SessionId> in_order = past();
  std::erase(in_order, session);
  SetPastOrder(in_order);
}

void JointMap::MarkChanged(SessionId session) {
  for (const auto& [key, layers] : chunks_) {
    if (layers.contains(session)) Touch(key);
  }
}

void JointMap::SetLayer(slam::ChunkKey key, SessionId session, std::shared_ptr<const slam::GridChunk> chunk) {
  Touch(key);
  if (chunk != nullptr) {
    chunks_[key][session] = std::move(chunk);
    return;
  }
  const auto found = chunks_.find(key);
  if (found == chunks_.end()) return;
  found->second.erase(session);
  if (found->second.size() < 2) last_looks_.erase(key);
  if (found->second.empty()) chunks_.erase(found);
}

void JointMap::Touch(slam::ChunkKey key) {
  dirty_.insert(key);
  differing_dirty_.insert(key);
}

std::vector<TileKey> JointMap::Render() {
  std::map<TileKey, Cells> finest;
  for (const slam::ChunkKey& key : std::exchange(dirty_, {})) finest.emplace(TileKey{0, key.x, key.y}, Sum(key));
  return sum_.Update(finest);
}

std::vector<TileKey> JointMap::RenderDisagreement() {
  std::map<TileKey, Cells> finest;
  for (const slam::ChunkKey& key : std::exchange(differing_dirty_, {}))
    finest.emplace(TileKey{0, key.x, key.y}, Disagreement(key));
  return disagreement_.Update(finest);
}

void JointMap::ForgetDisagreement() {
  disagreement_ = {};
  for (const auto& [key, layers] : chunks_) differing_dirty_.insert(key);
}

void JointMap::Count(MemoryCount& memory) const {
  for (const auto& [key, layers] : chunks_) {
    for (const auto& [session, chunk] : layers) memory.Add(chunk, sizeof(slam::GridChunk));
  }
  memory.Add(last_looks_.size() * sizeof(LastLooks));
  for (const TilePyramid* pyramid : {&sum_, &disagreement_}) {
    for (const auto& [key, cells] : pyramid->cells()) memory.Add(cells, sizeof(TileCells));
  }
}

template <typename Counts>
std::shared_ptr<const slam::GridChunk> JointMap::SumOf(const Layers& layers, const Counts& counts,
                                                       const LastLooks* last) const {
  using Layer = Layers::value_type;
  std::map<std::size_t, const Layer*> past;  // In the order in which their sessions ended.
  std::vector<const Layer*> present;
  for (const Layer& layer : layers) {
    if (hidden_.contains(layer.first) || !counts(layer.first)) continue;
    const auto ended = past_.find(layer.first);
    if (ended == past_.end()) {
      present.push_back(&layer);
    } else {
      past.emplace(ended->second, &layer);
    }
  }
  if (past.empty() && present.empty()) return nullptr;
  if (past.size() + present.size() == 1) return (past.empty() ? present.front() : past.begin()->second)->second;
  // First what others have looked at since, then each cell of the session that has looked at it last.
  const auto number_of = [last](const Layer& layer) {
    return last == nullptr ? std::uint8_t{0} : last->NumberOf(layer.first);
  };
  static constexpr std::array<std::uint8_t, kTileArea> kNobody{};
  const std::uint8_t* const lasts = last == nullptr ? kNobody.data() : last->numbers().data();
  const auto older = [lasts, &number_of](const Layer& layer) {
    const std::uint8_t number = number_of(layer);
    return [lasts, number, any = number == 0](std::size_t cell) { return any | (lasts[cell] != number); };
  };
  auto sum = std::make_shared<slam::GridChunk>(UnseenChunk());
  for (const auto& [before, layer] : past) AddLater(*sum, *layer->second, most_past_, older(*layer));
  slam::GridChunk now = UnseenChunk();
  for (const Layer* const layer : present) AddBeside(now, *layer->second, older(*layer));
  AddLater(*sum, now, most_past_);
  const auto add_last = [&](const Layer& layer) {
    const std::uint8_t number = number_of(layer);
    if (number == 0) return;
    AddLater(*sum, *layer.second, most_past_, [&](std::size_t cell) { return lasts[cell] == number; });
  };
  for (const auto& [before, layer] : past) add_last(*layer);
  for (const Layer* const layer : present) add_last(*layer);
  return sum;
}

JointMap::Cells JointMap::Sum(slam::ChunkKey key) const {
  const auto found = chunks_.find(key);
  const auto edits = edits_.find(key);
  const auto looks = last_looks_.find(key);
  const LastLooks* const last = looks == last_looks_.end() ? nullptr : &looks->second;
  const auto sum = found == chunks_.end() ? nullptr
                                          : SumOf(
                                                found->second, [](SessionId) { return true; }, last);
  if (sum == nullptr && edits == edits_.end()) return nullptr;
  auto cells = std::make_shared<TileCells>();
  if (sum == nullptr) {
    cells->fill(kUnknownCell);
  } else {
    *cells = slam::OccupanciesOf(*sum);
  }
  if (edits != edits_.end()) DrawOver(*edits->second, *cells);
  return AllUnknown(*cells) ? nullptr : cells;
}

JointMap::Cells JointMap::Disagreement(slam::ChunkKey key) const {
  const auto found = chunks_.find(key);
  if (found == chunks_.end()) return nullptr;
  std::vector<const slam::GridChunk*> grids;
  for (const auto& [session, chunk] : found->second)
    if (!hidden_.contains(session)) grids.push_back(chunk.get());
  return grids.size() < 2 ? nullptr : DisagreementOf(grids);
}

}  // namespace cairn::server
