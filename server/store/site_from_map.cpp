#include "server/store/site_from_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>

#include "server/store/records.h"

namespace cairn::server {
namespace {

constexpr std::uint64_t kLayer = 1;  // Who loads the site gives the layer another number.

// Log odds in units of 0.01, as in the estimator's grid, which does not become surer of a cell than this either.
std::int16_t LogOddsOfCell(std::uint8_t cell) {
  constexpr double kSurest = 0.98;
  if (cell == kUnknownCell) return INT16_MIN;
  const double occupied = std::clamp(cell / 100.0, 1.0 - kSurest, kSurest);
  return static_cast<std::int16_t>(std::lround(100.0 * std::log(occupied / (1.0 - occupied))));
}

StoredGrid GridOf(const std::map<TileKey, TileCells>& tiles) {
  using LogOdds = std::array<std::int16_t, static_cast<std::size_t>(kTileArea)>;
  std::array<std::int16_t, 256> log_odds_of{};
  for (std::size_t cell = 0; cell < log_odds_of.size(); ++cell)
    log_odds_of[cell] = LogOddsOfCell(static_cast<std::uint8_t>(cell));
  StoredGrid grid;
  for (const auto& [key, cells] : tiles) {
    auto chunk = std::make_shared<LogOdds>();
    for (std::size_t i = 0; i < cells.size(); ++i) (*chunk)[i] = log_odds_of[cells[i]];
    const std::int16_t* const first = chunk->data();
    grid.chunks.push_back({key.x, key.y, std::shared_ptr<const std::int16_t>(std::move(chunk), first)});
  }
  return grid;
}

}  // namespace

Result<void> AddSiteFromMap(Store& store, const std::string& site, const std::map<TileKey, TileCells>& cells,
                            double resolution_m) {
  if (auto valid = ValidateName("site", site); !valid) return valid;
  StoredSite stored;
  stored.name = site;
  stored.resolution_m = resolution_m;
  stored.past = {kLayer};
  const NameId id = HashName(site);
  return store.Commit({.removed = {},
                       .put = {{{RecordKind::kSite, id, 0}, BytesOf(stored)},
                               {{RecordKind::kLayer, id, kLayer}, BytesOf(StoredLayer{kLayer, GridOf(cells)})}}});
}

}  // namespace cairn::server
