// How a site counts what its map takes, and gives something up (memory_keeper.h).
#include <spdlog/spdlog.h>

#include "server/maps/site.h"

namespace cairn::server {

class Site::GivesUp final : public MemoryHolder {
 public:
  explicit GivesUp(Site& site) : site_(site) {}

  [[nodiscard]] bool HasDisagreement() const override { return site_.disagreement_wanted_.has_value(); }
  void DropDisagreement() override { site_.Refresh({}, site_.DropDisagreement(), false); }
  [[nodiscard]] std::optional<std::uint32_t> LeastNeededVersion(bool last) const override {
    return site_.versions_.LeastNeeded(last);
  }
  void RemoveVersion(std::uint32_t version) override {
    site_.versions_.Remove(version);
    site_.StoreTogether([this] {
      site_.RemoveOldVersions();
      site_.StoreSite();
    });
  }
  [[nodiscard]] std::size_t Layers() const override { return site_.ShownLayers().size(); }
  void MergeOldestLayers() override {
    const std::size_t layers = Layers();
    site_.StoreTogether([this, layers] {
      site_.MergeOldestLayers(layers - 1);
      site_.RemoveOtherLayers();
      site_.StoreSite();
    });
  }
  [[nodiscard]] std::vector<SessionId> EndedSessions() const override { return site_.joint_.past(); }
  [[nodiscard]] bool IsSpare(SessionId session) const override {
    if (site_.layers_.contains(session) || site_.OwnerOf(session) == nullptr) return false;
    return !site_.joint_.hidden().contains(session) && site_.joint_.IsCovered(session);
  }
  void ShowWhatIsLeft() override { site_.Render(); }

 private:
  Site& site_;
};

void Site::CountMemory(const MapSnapshot& snapshot) noexcept {
  memory_.NoteChange();
  memory_.Count(Clock::now(), [&](MemoryCount& memory) {
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
  });
}

void Site::StayWithinMemory(Clock::time_point now) {
  if (retired_ || switch_) return;
  GivesUp map(*this);
  if (!memory_.Keep(now, map)) return;
  if (!memory_.note().empty()) spdlog::warn("site {}: {}", name_, memory_.note());
  Refresh({}, {}, false);
}

}  // namespace cairn::server
