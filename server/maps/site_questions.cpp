// What a site makes of its map only when it is asked for (site.h), and what it says of its own size.
#include <chrono>
#include <exception>
#include <utility>

#include "server/maps/answer_once.h"
#include "server/maps/site.h"
#include "server/maps/tile_encoding.h"

namespace cairn::server {
namespace {

using Clock = std::chrono::steady_clock;

// The layer of disagreement is kept up to date for so long after somebody has asked for it.
constexpr std::chrono::seconds kDisagreementLasts{60};
// Counting looks at every chunk of every version.
constexpr std::chrono::seconds kCountEvery{10};

}  // namespace

std::vector<TileKey> Site::RenderDisagreement() {
  if (!disagreement_wanted_) return {};
  if (Clock::now() < *disagreement_wanted_) return joint_.RenderDisagreement();
  disagreement_wanted_.reset();
  std::vector<TileKey> gone;
  for (const auto& [key, cells] : joint_.disagreement()) gone.push_back(key);
  joint_.ForgetDisagreement();
  return gone;
}

void Site::AskDisagreement(SnapshotDone done) {
  Run([done = Once<std::shared_ptr<const MapSnapshot>>(std::move(done))](Site& site) {
    site.disagreement_wanted_ = Clock::now() + kDisagreementLasts;
    site.Render();
    done(site.snapshot());
  });
}

void Site::AskPartOf(SessionId session, int level, SnapshotDone done) {
  Run([session, level, done = Once<std::shared_ptr<const MapSnapshot>>(std::move(done))](Site& site) {
    std::map<TileKey, JointMap::Cells> finest;
    for (const auto& [key, chunk] : site.joint_.ChunksOf(session)) {
      auto cells = std::make_shared<TileCells>();
      for (std::size_t i = 0; i < cells->size(); ++i) (*cells)[i] = slam::OccupancyOf(chunk->log_odds[i]);
      finest.emplace(TileKey{0, key.x, key.y}, std::move(cells));
    }
    if (finest.empty()) return done(Fail(StatusCode::kNotFound, "the robot has drawn nothing"));
    TilePyramid pyramid;
    static_cast<void>(pyramid.Update(finest));
    std::map<TileKey, TileSet::TilePtr> tiles;
    for (const auto& [key, cells] : pyramid.cells()) {
      if (key.level != level) continue;
      tiles[key] = EncodeTile(key, *cells, site.epoch_, site.tile_version_);
      ++site.encoded_;
    }
    auto part = std::make_shared<MapSnapshot>();
    part->tiles = TileSet().With(tiles);
    part->info = site.InfoOf(part->tiles);
    part->drawn = true;
    done(std::shared_ptr<const MapSnapshot>(std::move(part)));
  });
}

bool Site::MemoryIsToBeCounted() const {
  return memory_changed_ && (!memory_counted_ || Clock::now() - *memory_counted_ >= kCountEvery);
}

void Site::CountMemory(const MapSnapshot& snapshot) noexcept {
  memory_changed_ = true;
  if (!MemoryIsToBeCounted()) return;
  memory_counted_ = Clock::now();
  try {
    MemoryCount memory;
    joint_.Count(memory);
    versions_.Count(memory);
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

}  // namespace cairn::server
