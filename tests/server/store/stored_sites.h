// Stores that hold whole sites, and their comparison record by record.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "server/store/checkpoint_writer.h"
#include "server/store/journal.h"
#include "server/store/site_edit.h"
#include "server/store/sqlite_store.h"
#include "tests/server/store/sample_entries.h"

namespace cairn::server::testing {

inline constexpr double kQuarterTurn = kPi / 2;

inline std::unique_ptr<Store> MemoryStore() {
  return *OpenStore(std::string(kInMemory));
}

// Every record of the store but that of the server.
inline std::map<RecordKey, std::string> Everything(Store& store) {
  std::map<RecordKey, std::string> all;
  for (int kind = static_cast<int>(RecordKind::kSession); kind <= static_cast<int>(RecordKind::kJob); ++kind) {
    const auto of = static_cast<RecordKind>(kind);
    const auto owners = store.Owners(of);
    EXPECT_TRUE(owners);
    for (const std::uint64_t owner : *owners) {
      const auto read = store.Read({.kind = of, .owner = owner}, [&](std::uint64_t number, std::string_view bytes) {
        all[{of, owner, number}] = bytes;
        return Result<void>{};
      });
      EXPECT_TRUE(read) << read.error().message;
    }
  }
  return all;
}

struct SampleSite {
  std::string name = "lab";
  std::uint64_t first_session = 1;  // Two sessions, of robots r<number>; one more of which only the map is left.
  std::uint64_t job = 1;
  std::uint32_t epoch = 1;
  std::uint64_t generation = 5;  // Of the server that made the epochs.
};

// A site with one of everything: its sessions have a journal in two batches and a checkpoint, and map version 2, made
// by a job, is enabled.
inline RecordChanges RecordsOf(const SampleSite& sample) {
  RecordChanges changes;
  const auto put = [&](const RecordKey& key, std::string bytes) { changes.put.push_back({key, std::move(bytes)}); };
  StoredSite site;
  site.name = sample.name;
  site.epoch = sample.epoch;
  site.tile_version = 9;
  site.next_version = 3;
  site.enabled_version = 2;
  site.switches[sample.epoch] = sample.generation;
  site.resolution_m = 0.05;
  StoredVersion live{.version = 1, .job = 0, .note = "live", .parts = {}, .smoothed = {}};
  StoredVersion smooth{.version = 2, .job = sample.job, .note = "smoothed", .parts = {}, .smoothed = {}};
  const NameId id = HashName(sample.name);
  for (std::uint64_t session = sample.first_session; session < sample.first_session + 2; ++session) {
    StoredSession stored = SampleSession(session);
    stored.request.site = sample.name;
    stored.map_epoch = 0;
    site.members[HashName(stored.request.robot)] = session;
    put({RecordKind::kSession, session, 0}, BytesOf(stored));
    put({RecordKind::kJournal, session, 2}, BytesOf(1, {SampleScan(1), SampleOdometry(1)}));
    put({RecordKind::kJournal, session, 4},
        BytesOf(3, {CorrectionTaken{sample.epoch, sample.generation, SampleGrid(2)}, SampleScan(2)}));
    CheckpointWriter checkpoint(session, 4, {"the state of session " + std::to_string(session)});
    checkpoint.AddTo(changes);
    live.parts[session] = SampleGrid(3);
    smooth.parts[session] = SampleGrid(4);
    smooth.smoothed[stored.request.robot] = {
        session, std::make_shared<const Trajectory>(Trajectory{{100, {1.0, 2.0, 0.5}}, {200, {2.0, 2.0, 0.5}}})};
  }
  changes.removed.clear();
  const std::uint64_t gone = sample.first_session + 2;
  put({RecordKind::kLayer, id, gone}, BytesOf(StoredLayer{gone, SampleGrid(5)}));
  put({RecordKind::kMapVersion, id, 1}, BytesOf(live));
  put({RecordKind::kMapVersion, id, 2}, BytesOf(smooth));
  StoredJob job;
  job.job.id = sample.job;
  job.job.site = sample.name;
  job.job.state = JobState::kSucceeded;
  job.job.map_version = 2;
  job.job.robot = "r" + std::to_string(sample.first_session);
  job.job.places = {{100, {1.0, 2.0, 0.5}, 1.0}};
  put({RecordKind::kJob, sample.job, 0}, BytesOf(job));
  put({RecordKind::kSite, id, 0}, BytesOf(site));
  return changes;
}

inline void Put(Store& store, const SampleSite& sample) {
  const auto committed = store.Commit(RecordsOf(sample));
  ASSERT_TRUE(committed) << committed.error().message;
}

// The value of a cell; SampleGrid's first chunk has its seed at (5, 0).
inline std::int16_t CellAt(const StoredGrid& grid, int x, int y) {
  for (const StoredChunk& chunk : grid.chunks) {
    if (chunk.x == FloorDiv(x, kTileCells) && chunk.y == FloorDiv(y, kTileCells))
      return chunk.cells.get()[(y - chunk.y * kTileCells) * kTileCells + x - chunk.x * kTileCells];
  }
  return INT16_MIN;
}

// These sessions of the site have begun without a start and are not joined with the map.
inline void MakeFragments(Store& store, const std::string& name, const std::set<std::uint64_t>& sessions) {
  auto contents = ReadSite(store, name);
  ASSERT_TRUE(contents);
  contents->site.fragments = contents->site.kept_apart = sessions;
  contents->site.past = {sessions.begin(), sessions.end()};
  RecordChanges changes;
  changes.put.push_back({{RecordKind::kSite, HashName(name), 0}, BytesOf(contents->site)});
  for (auto& [id, session] : contents->sessions) {
    session.fragment = sessions.contains(id);
    session.request.has_start = session.request.has_start && !session.fragment;
    changes.put.push_back({{RecordKind::kSession, id, 0}, BytesOf(session)});
  }
  ASSERT_TRUE(store.Commit(std::move(changes)));
}

inline std::vector<JournalEntry> JournalOf(Store& store, std::uint64_t session) {
  std::vector<JournalEntry> entries;
  const auto last = ReadJournal(store, session, 0, [&](std::uint64_t, JournalEntry&& entry) {
    entries.push_back(std::move(entry));
    return Result<void>{};
  });
  EXPECT_TRUE(last) << last.error().message;
  return entries;
}

}  // namespace cairn::server::testing
