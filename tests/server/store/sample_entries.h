// Journal entries and records with every field set, and their comparison by bytes.
#pragma once

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "common/map/tile.h"
#include "server/store/records.h"

namespace cairn::server::testing {

inline StreamId SampleStream() {
  return {HashName("r1"), HashName("laser"), 77};
}

inline ScanTaken SampleScan(std::uint64_t sequence, int beams = 181) {
  auto scan = std::make_shared<Scan>();
  scan->sequence = sequence;
  scan->stamp = static_cast<Stamp>(sequence) * 100'000'000;
  scan->angle_first_rad = -1.5;
  scan->angle_step_rad = 3.0 / beams;
  scan->range_min_m = 0.1;
  scan->range_max_m = 30.0;
  scan->beam_period_s = 1e-5;
  scan->tilt_rad = 0.01;
  scan->T_robot_laser = {0.1, -0.2, 0.3};
  for (int i = 0; i < beams; ++i) {
    // Not a number and infinity are ranges, too.
    scan->ranges_m.push_back(i == 3   ? std::numeric_limits<float>::quiet_NaN()
                             : i == 4 ? std::numeric_limits<float>::infinity()
                                      : 1.0F + 0.01F * static_cast<float>((i * 7 + static_cast<int>(sequence)) % 900));
  }
  return {SampleStream(), std::move(scan)};
}

inline OdometryTaken SampleOdometry(std::uint64_t sequence) {
  return {SampleStream(),
          {.sequence = sequence, .stamp = static_cast<Stamp>(sequence) * 50'000'000, .T_odom_robot = {1.0, -0.0, 0.5}},
          OdometryUse::kTaken};
}

inline StoredGrid SampleGrid(int seed) {
  StoredGrid grid;
  grid.keyframes = 12;
  for (int i = 0; i < 2; ++i) {
    auto cells = std::make_shared<std::vector<std::int16_t>>(kTileArea, std::int16_t{-32768});
    (*cells)[5] = static_cast<std::int16_t>(seed + i);
    const std::int16_t* const first = cells->data();
    grid.chunks.push_back({seed, i - 1, std::shared_ptr<const std::int16_t>(std::move(cells), first)});
  }
  return grid;
}

inline std::shared_ptr<const Tile> SampleTile() {
  Tile tile;
  tile.key = {0, -1, 2};
  tile.bytes = EncodeCells(TileCells{}, tile.encoding);
  return std::make_shared<const Tile>(std::move(tile));
}

inline std::vector<JournalEntry> OneOfEach() {
  return {OwnerChanged{77, 78, {"laser", "rear"}},
          SampleScan(1),
          ScanRefused{SampleStream(), 2, DropReason::kQueueFull},
          SampleOdometry(3),
          CorrectionTaken{4, 5, SampleGrid(6)},
          EpochChanged{7},
          RelocaliseTaken{Pose2{1.5, -2.0, 0.5}},
          RelocaliseTaken{},
          LocaliseTaken{false, {SampleTile()}, 0.05, 3},
          LocaliseTaken{true, {}, 0.0, 0},
          PlaceSuggested{9, {1.0, 2.0, 0.5}, {false, {SampleTile()}, 0.05, 3}},
          StartRefusal{"it is elsewhere"},
          SessionFinished{true, {StatusCode::kUnavailable, "gone"}}};
}

inline StoredSession SampleSession(std::uint64_t id) {
  return {.id = id,
          .request = {.robot = "r" + std::to_string(id),
                      .site = "lab",
                      .sensors = {"laser"},
                      .client = 77,
                      .has_start = true,
                      .T_map_robot_start = {1, 2, 0.5},
                      .end = false,
                      .session = 78,
                      .started = false},
          .map_epoch = 3};
}

inline StoredSite SampleSiteRecord() {
  return {.name = "lab",
          .epoch = 2,
          .tile_version = 90,
          .next_version = 4,
          .enabled_version = 3,
          .switches = {{1, 100}, {2, 101}},
          .members = {{HashName("r5"), 5}},
          .fragments = {5, 7},
          .past = {7, 5},
          .edits = {{.id = 2,
                     .kind = MapEditKind::kOccupied,
                     .points_map = {{1.0, 2.0}, {3.0, 4.5}},
                     .width_m = 0.1,
                     .note = "glass",
                     .made = 77},
                    {.id = 4, .kind = MapEditKind::kKeepOut, .points_map = {{0, 0}, {1, 0}, {1, 1}}, .note = {}}},
          .edits_version = 5,
          .anchors = {{4,
                       {.points_then = {{0.5, 0}, {1.5, 0}, {1.5, 1}},
                        .keyframes = {{5, 170, {1, 2, 0.5}, {0.5, 2, 0.5}}, {7, 0, {}, {-0.5, 0, 0}}}}}},
          .given_up = {.versions = 3, .layers = 2, .sessions = 1},
          .kept_apart = {7}};
}

}  // namespace cairn::server::testing
