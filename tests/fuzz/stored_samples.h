// Records as a server stores them, for the targets that read them.
#pragma once

#include <string>
#include <vector>

#include "server/store/records.h"
#include "tests/server/store/sample_entries.h"

namespace cairn::fuzz {

inline server::StoredGrid OneChunk() {
  server::StoredGrid grid = server::testing::SampleGrid(1);
  grid.chunks.resize(1);
  return grid;
}

inline server::StoredVersion SampleVersion(bool with_grid) {
  server::StoredVersion version{.version = 3, .job = 8, .note = "smoothed", .parts = {}, .smoothed = {}};
  version.parts[5] = with_grid ? OneChunk() : server::StoredGrid{.keyframes = 4, .chunks = {}};
  version.smoothed["r5"] = {5, std::make_shared<const Trajectory>(Trajectory{{10, {1, 2, 3}}, {20, {4, 5, 0.6}}})};
  return version;
}

inline server::StoredJob SampleJob(std::uint64_t id, JobState state) {
  return {.job = {.id = id, .site = "lab", .state = state, .progress = 0.5, .submitted = 7, .message = "m"},
          .enable = false};
}

// A journal without the large correction.
inline std::vector<server::JournalEntry> SmallJournal() {
  using namespace server;
  return {OwnerChanged{77, 78, {"laser", "rear"}},
          testing::SampleOdometry(1),
          testing::SampleScan(1, 16),
          ScanRefused{testing::SampleStream(), 2, DropReason::kQueueFull},
          testing::SampleOdometry(3),
          CorrectionTaken{4, 5, {.keyframes = 1, .chunks = {}}},
          RelocaliseTaken{Pose2{1.0, 2.0, 3.0}},
          LocaliseTaken{false, {testing::SampleTile()}, 0.05, 3},
          LocaliseTaken{true, {}, 0.0, 0},
          PlaceSuggested{9, {1.0, 2.0, 0.5}, {false, {testing::SampleTile()}, 0.05, 3}},
          StartRefusal{"it is elsewhere"},
          SessionFinished{true, {StatusCode::kUnavailable, "gone"}}};
}

}  // namespace cairn::fuzz
