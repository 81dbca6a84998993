// What a site makes of its map only when it is asked for (site.h).
#include <chrono>
#include <utility>

#include "server/maps/answer_once.h"
#include "server/maps/site.h"
#include "server/maps/tile_encoding.h"

namespace cairn::server {
namespace {

// The layer of disagreement is kept up to date for so long after somebody has asked for it.
constexpr std::chrono::seconds kDisagreementLasts{60};

}  // namespace

std::vector<TileKey> Site::RenderDisagreement() {
  return disagreement_wanted_ ? joint_.RenderDisagreement() : std::vector<TileKey>{};
}

void Site::ExpireDisagreement(Clock::time_point now) {
  if (disagreement_wanted_ && now >= *disagreement_wanted_) Refresh({}, DropDisagreement(), false);
}

// Returns the tiles that are gone.
std::vector<TileKey> Site::DropDisagreement() {
  disagreement_wanted_.reset();
  std::vector<TileKey> gone;
  for (const auto& [key, cells] : joint_.disagreement()) gone.push_back(key);
  joint_.ForgetDisagreement();
  return gone;
}

void Site::AskDisagreement(SnapshotDone done, Clock::time_point now) {
  Run([now, done = Once<std::shared_ptr<const MapSnapshot>>(std::move(done))](Site& site) {
    site.disagreement_wanted_ = now + kDisagreementLasts;
    site.Render();
    done(site.snapshot());
  });
}

void Site::AskPartOf(SessionId session, int level, SnapshotDone done) {
  Run([session, level, done = Once<std::shared_ptr<const MapSnapshot>>(std::move(done))](Site& site) {
    std::map<TileKey, JointMap::Cells> finest;
    for (const auto& [key, chunk] : site.joint_.ChunksOf(session)) {
      finest.emplace(TileKey{0, key.x, key.y}, std::make_shared<const TileCells>(slam::OccupanciesOf(*chunk)));
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

}  // namespace cairn::server
