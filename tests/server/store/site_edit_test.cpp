#include "server/store/site_edit.h"

#include <gtest/gtest.h>

#include "server/store/grid_transform.h"
#include "server/store/journal.h"
#include "tests/server/store/faulty_vfs.h"
#include "tests/server/store/stored_sites.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

constexpr double kQuarterTurn = kPi / 2;

// These sessions of the site have begun without a start and are not joined with the map.
void MakeFragments(Store& store, const std::string& name, const std::set<std::uint64_t>& sessions) {
  auto contents = ReadSite(store, name);
  ASSERT_TRUE(contents);
  contents->site.fragments = sessions;
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

std::filesystem::path Saved(const TempDirectory& directory, const SampleSite& sample, std::uint64_t fragment = 0) {
  const auto store = MemoryStore();
  Put(*store, sample);
  if (fragment != 0) MakeFragments(*store, sample.name, {fragment});
  const auto path = directory / (sample.name + ".site");
  EXPECT_TRUE(WriteSiteFile(*store, sample.name, path));
  return path;
}

std::vector<JournalEntry> JournalOf(Store& store, std::uint64_t session) {
  std::vector<JournalEntry> entries;
  const auto last = ReadJournal(store, session, 0, [&](std::uint64_t, JournalEntry&& entry) {
    entries.push_back(std::move(entry));
    return Result<void>{};
  });
  EXPECT_TRUE(last) << last.error().message;
  return entries;
}

TEST(ImportSite, GivesNewNumbersBesideOtherSites) {
  const TempDirectory directory;
  const auto path = Saved(directory, {.name = "hall"}, 2);
  const auto store = MemoryStore();
  Put(*store, {.name = "lab", .first_session = 11, .job = 4});  // The highest number is 13, of a session that is gone.
  const auto before = Everything(*store);
  const auto imported = ImportSite(*store, path);
  ASSERT_TRUE(imported) << imported.error().message;
  EXPECT_EQ(imported->sessions, (std::map<std::uint64_t, std::string>{{14, "r1"}, {15, "r2"}}));
  EXPECT_EQ(imported->jobs, std::set<std::uint64_t>{5});
  const auto hall = ReadSite(*store, "hall");
  ASSERT_TRUE(hall);
  EXPECT_EQ(hall->sessions.at(14).id, 14U);
  EXPECT_EQ(hall->site.members.at(HashName("r2")), 15U);
  EXPECT_EQ(hall->site.fragments, std::set<std::uint64_t>{15});
  EXPECT_EQ(hall->site.past, std::vector<std::uint64_t>{15});
  EXPECT_EQ(hall->layers, std::vector<std::uint64_t>{16});
  EXPECT_EQ(hall->jobs.at(5).job.id, 5U);
  const auto versions = ReadVersions(*store, HashName("hall"));
  EXPECT_EQ(versions->at(2).job, 5U);
  EXPECT_TRUE(versions->at(2).parts.contains(14));
  EXPECT_FALSE(versions->at(2).parts.contains(1));
  EXPECT_EQ(JournalOf(*store, 15).size(), 4U);
  EXPECT_TRUE(*ReadCheckpoint(*store, 15));
  // What was there is as it was, and goes without a trace.
  ASSERT_TRUE(DeleteSite(*store, "hall"));
  ASSERT_TRUE(RemoveRests(*store));
  EXPECT_EQ(Everything(*store), before);
}

// The smoothed path of a session that is gone must not become that of the session that the robot has now, and goes only
// with its own session.
TEST(ImportSite, ASmoothedPathKeepsTheSessionThatDroveIt) {
  const TempDirectory directory;
  const auto store = MemoryStore();
  Put(*store, {});
  const NameId lab = HashName("lab");
  StoredVersion version = ReadVersions(*store, lab)->at(2);
  version.smoothed.at("r1").session = 77;
  ASSERT_TRUE(store->Commit({.removed = {}, .put = {{{RecordKind::kMapVersion, lab, 2}, BytesOf(version)}}}));
  const auto path = directory / "lab.site";
  ASSERT_TRUE(WriteSiteFile(*store, "lab", path));
  const auto other = MemoryStore();
  const auto imported = ImportSite(*other, path);
  ASSERT_TRUE(imported) << imported.error().message;
  const std::uint64_t session = ReadVersions(*other, lab)->at(2).smoothed.at("r1").session;
  EXPECT_NE(session, 0U);
  EXPECT_FALSE(imported->sessions.contains(session));
  EXPECT_TRUE(imported->session_numbers.contains(session));
  const std::uint64_t of_r1 = imported->sessions.begin()->first;
  ASSERT_TRUE(DeleteSession(*other, "lab", of_r1));
  EXPECT_TRUE(ReadVersions(*other, lab)->at(2).smoothed.contains("r1"));
}

// The journals of deleted sessions go little by little. With their numbers, an imported session would be mixed with
// them.
TEST(ImportSite, TakesNoNumberOfASessionThatIsOnlyHalfRemoved) {
  const TempDirectory directory;
  const auto path = Saved(directory, {});
  const auto store = MemoryStore();
  ASSERT_TRUE(store->Commit(RecordsOf({})));
  const auto before = ReadSite(*store, "lab");
  ASSERT_TRUE(before);
  const std::uint64_t last = before->sessions.rbegin()->first;
  ASSERT_TRUE(DeleteSite(*store, "lab"));  // What is large is still there.
  ASSERT_FALSE(store->Owners(RecordKind::kRemoved)->empty());
  const auto imported = ImportSite(*store, path);
  ASSERT_TRUE(imported) << imported.error().message;
  EXPECT_GT(imported->sessions.begin()->first, last);
  ASSERT_TRUE(RemoveRests(*store));
  for (const auto& [id, robot] : imported->sessions) EXPECT_EQ(JournalOf(*store, id).size(), 4U);
}

// Otherwise the numbers of a site that is saved, deleted and loaded every day would soon have no room.
TEST(ImportSite, NumbersGrowByWhatTheFileHoldsAndNotByTheirSize) {
  const TempDirectory directory;
  const auto path = Saved(directory, {});
  constexpr std::uint64_t kRounds = 70;
  ImportOptions options;
  for (std::uint64_t round = 0; round < kRounds; ++round) {
    const auto store = MemoryStore();
    const auto imported = ImportSite(*store, path, options);
    ASSERT_TRUE(imported) << imported.error().message;
    options.first_session += 3;  // Two sessions, and one of which only the map is left.
    options.first_job += 1;
    EXPECT_EQ(imported->session_numbers, (std::set<std::uint64_t>{options.first_session - 3, options.first_session - 2,
                                                                  options.first_session - 1}));
    EXPECT_EQ(imported->job_numbers, std::set<std::uint64_t>{options.first_job - 1});
    ASSERT_TRUE(WriteSiteFile(*store, "lab", path));
  }
}

TEST(ImportSite, RefusesWhatIsThereAlreadyAndTakesItUnderOtherNames) {
  const TempDirectory directory;
  const auto path = Saved(directory, {});
  const auto store = MemoryStore();
  ASSERT_TRUE(ImportSite(*store, path));
  const auto before = Everything(*store);
  EXPECT_EQ(ImportSite(*store, path).error().code, StatusCode::kAlreadyExists);
  const auto same_robots = ImportSite(*store, path, {.site = "copy", .robots = {{"r1", "copy1"}}});
  ASSERT_FALSE(same_robots);
  EXPECT_EQ(same_robots.error().code, StatusCode::kAlreadyExists);
  EXPECT_NE(same_robots.error().message.find("'r2'"), std::string::npos) << same_robots.error().message;
  EXPECT_EQ(ImportSite(*store, path, {.site = "../lab", .robots = {}}).error().code, StatusCode::kInvalidArgument);
  EXPECT_EQ(ImportSite(*store, path, {.site = "copy", .robots = {{"r9", "x"}}}).error().code,
            StatusCode::kInvalidArgument);
  EXPECT_EQ(ImportSite(*store, path, {.site = "copy", .robots = {{"r1", "x"}, {"r2", "x"}}}).error().code,
            StatusCode::kAlreadyExists);
  EXPECT_EQ(Everything(*store), before);
  const auto copy = ImportSite(*store, path, {.site = "copy", .robots = {{"r1", "c1"}, {"r2", "c2"}}});
  ASSERT_TRUE(copy) << copy.error().message;
  const auto contents = ReadSite(*store, "copy");
  ASSERT_TRUE(contents);
  EXPECT_EQ(contents->sessions.at(4).request.robot, "c1");
  EXPECT_EQ(contents->site.members.at(HashName("c2")), 5U);
  EXPECT_EQ(ReadVersions(*store, HashName("copy"))->at(2).smoothed.at("c2").session, 5U);
  // The samples in a journal name a robot by its number.
  EXPECT_EQ(std::get<ScanTaken>(JournalOf(*store, 4)[0]).stream.robot_id, HashName("c1"));
}

TEST(ImportSite, AnErrorOfTheDiskLeavesNothingBehind) {
  const TempDirectory directory;
  const auto path = Saved(directory, {});
  FaultyVfs vfs;
  auto store = OpenStore(directory / "state", FaultyVfs::name());
  ASSERT_TRUE(store);
  vfs.Set(DiskFault::kFull);
  EXPECT_EQ(ImportSite(**store, path).error().code, StatusCode::kResourceExhausted);
  vfs.Set(DiskFault::kNone);
  EXPECT_TRUE(Everything(**store).empty());
  EXPECT_TRUE(ImportSite(**store, path));
}

TEST(MergeSites, BothSitesAreOneAndEveryScanIsThere) {
  const auto store = MemoryStore();
  Put(*store, {.name = "lab"});
  Put(*store, {.name = "hall", .first_session = 11, .job = 4, .epoch = 2, .generation = 6});
  const auto before = Everything(*store);
  ASSERT_TRUE(MergeSites(*store, "lab", "hall"));
  EXPECT_EQ(*SiteNames(*store), std::vector<std::string>{"lab"});
  const auto lab = ReadSite(*store, "lab");
  ASSERT_TRUE(lab);
  EXPECT_EQ(lab->sessions.size(), 4U);
  EXPECT_EQ(lab->layers, (std::vector<std::uint64_t>{3, 13}));
  EXPECT_EQ(lab->jobs.size(), 2U);
  EXPECT_EQ(lab->jobs.at(4).job.map_version, 3U);
  // Epoch 2 of the hall follows epoch 1 of the lab, and its corrections say so.
  EXPECT_EQ(lab->site.epoch, 3U);
  EXPECT_EQ(lab->site.switches, (std::map<std::uint32_t, std::uint64_t>{{1, 5}, {3, 6}}));
  EXPECT_EQ(std::get<CorrectionTaken>(JournalOf(*store, 1)[2]).epoch, 1U);
  EXPECT_EQ(std::get<CorrectionTaken>(JournalOf(*store, 11)[2]).epoch, 3U);
  EXPECT_EQ(lab->sessions.at(11).map_epoch, 1U);
  EXPECT_EQ(lab->sessions.at(11).request.T_map_robot_start, (Pose2{1, 2, 0.5}));
  // Checkpoints stay, because nothing has moved; the scans are the same bytes.
  for (const std::uint64_t session : {1, 2, 11, 12}) {
    EXPECT_TRUE(*ReadCheckpoint(*store, session)) << session;
    EXPECT_EQ(Everything(*store)[(RecordKey{RecordKind::kJournal, session, 2})],
              before.at({RecordKind::kJournal, session, 2}));
  }
  const auto versions = *ReadVersions(*store, HashName("lab"));
  ASSERT_EQ(versions.size(), 4U);
  EXPECT_EQ(versions.at(1).parts.size(), 4U);
  EXPECT_EQ(versions.at(3).parts.size(), 2U);
  EXPECT_EQ(lab->site.enabled_version, 4U);
  EXPECT_EQ(lab->site.next_version, 5U);
  EXPECT_EQ(versions.at(4).smoothed.size(), 4U);
}

// A switch of one site that was not completed must not become true by a switch of the other one.
TEST(MergeSites, ACorrectionThatNeverHappenedDoesNotHappenLater) {
  const auto store = MemoryStore();
  Put(*store, {.name = "lab", .epoch = 1, .generation = 5});
  Put(*store, {.name = "hall", .first_session = 11, .job = 4, .epoch = 1, .generation = 6});
  const JournalEntry begun = CorrectionTaken{2, 6, SampleGrid(8)};
  ASSERT_TRUE(store->Commit({.removed = {}, .put = {{{RecordKind::kJournal, 1, 5}, BytesOf(5, {begun})}}}));
  ASSERT_TRUE(MergeSites(*store, "lab", "hall"));
  ASSERT_EQ(ReadSite(*store, "lab")->site.switches.at(2), 6U);
  EXPECT_EQ(std::get<CorrectionTaken>(JournalOf(*store, 1)[4]).epoch, 0U);
}

TEST(MergeSites, ATransformMovesWhatHasBeenDrawnAndWhereSessionsBegin) {
  const auto store = MemoryStore();
  Put(*store, {.name = "lab"});
  Put(*store, {.name = "hall", .first_session = 11, .job = 4});
  const Pose2 T_lab_hall{1.0, 0.5, kQuarterTurn};
  ASSERT_TRUE(MergeSites(*store, "lab", "hall", T_lab_hall));
  const auto lab = ReadSite(*store, "lab");
  ASSERT_TRUE(lab);
  EXPECT_EQ(lab->sessions.at(1).request.T_map_robot_start, (Pose2{1, 2, 0.5}));
  const Pose2 start = lab->sessions.at(11).request.T_map_robot_start;
  EXPECT_NEAR(start.x, 1.0 - 2.0, 1e-12);
  EXPECT_NEAR(start.y, 0.5 + 1.0, 1e-12);
  EXPECT_NEAR(start.theta, 0.5 + kQuarterTurn, 1e-12);
  EXPECT_TRUE(*ReadCheckpoint(*store, 1));
  EXPECT_FALSE(*ReadCheckpoint(*store, 11)) << "it was made in the other frame";
  // The cell (645, -128) of the hall's session 13 is at (20 + 127, 10 + 645) now: one turned cell, no more.
  const auto layers = *ReadLayers(*store, HashName("lab"));
  ASSERT_EQ(layers.size(), 2U);
  EXPECT_EQ(CellAt(layers[1].grid, 147, 655), 5);
  EXPECT_EQ(CellAt(layers[1].grid, 146, 655), INT16_MIN);
  EXPECT_EQ(CellAt(layers[0].grid, 645, -128), 5) << "the lab stays where it is";
  EXPECT_EQ(CellAt(std::get<CorrectionTaken>(JournalOf(*store, 11)[2]).grid, 147, 271), 2);
  const auto versions = *ReadVersions(*store, HashName("lab"));
  EXPECT_EQ(CellAt(versions.at(3).parts.at(11), 147, 527), 4);
  const StampedPose& pose = versions.at(4).smoothed.at("r11").path->front();
  EXPECT_NEAR(pose.T_map_robot.x, -1.0, 1e-12);
  EXPECT_NEAR(versions.at(4).smoothed.at("r1").path->front().T_map_robot.x, 1.0, 0.0);
}

// Where a fragment lies in the map is not known, so a transform of the map says nothing of it.
TEST(MergeSites, AFragmentKeepsItsFrameAndIsOneInTheOtherSiteToo) {
  const auto store = MemoryStore();
  Put(*store, {.name = "lab"});
  Put(*store, {.name = "hall", .first_session = 11, .job = 4});
  MakeFragments(*store, "hall", {12, 13});
  const Pose2 start = ReadSite(*store, "hall")->sessions.at(12).request.T_map_robot_start;
  ASSERT_TRUE(MergeSites(*store, "lab", "hall", {1.0, 0.5, kQuarterTurn}));
  const auto lab = ReadSite(*store, "lab");
  ASSERT_TRUE(lab);
  EXPECT_EQ(lab->site.fragments, (std::set<std::uint64_t>{12, 13}));
  EXPECT_EQ(lab->site.past, (std::vector<std::uint64_t>{12, 13}));
  EXPECT_TRUE(lab->sessions.at(12).fragment);
  EXPECT_FALSE(lab->sessions.at(12).request.has_start);
  EXPECT_EQ(lab->sessions.at(12).request.T_map_robot_start, start);
  EXPECT_EQ(CellAt(ReadLayers(*store, HashName("lab"))->at(1).grid, 645, -128), 5);
  // A version has joined it once: what it has drawn since lies in the map.
  EXPECT_EQ(CellAt(std::get<CorrectionTaken>(JournalOf(*store, 12)[2]).grid, 147, 271), 2);
}

TEST(MergeSites, WhatCannotBeMergedStaysAsItIs) {
  const auto store = MemoryStore();
  Put(*store, {.name = "lab"});
  Put(*store, {.name = "hall", .first_session = 11, .job = 4});
  ASSERT_TRUE(
      store->Commit({.removed = {{.kind = RecordKind::kJournal, .owner = 12, .first = 0, .last = 2}}, .put = {}}));
  const auto before = Everything(*store);
  const auto cut = MergeSites(*store, "lab", "hall", {1.0, 0.0, 0.0});
  ASSERT_FALSE(cut);
  EXPECT_EQ(cut.error().code, StatusCode::kFailedPrecondition);
  EXPECT_NE(cut.error().message.find("begins at entry 3"), std::string::npos) << cut.error().message;
  EXPECT_EQ(MergeSites(*store, "lab", "lab").error().code, StatusCode::kInvalidArgument);
  EXPECT_EQ(MergeSites(*store, "lab", "nowhere").error().code, StatusCode::kNotFound);
  EXPECT_EQ(MergeSites(*store, "lab", "hall", {1e9, 0, 0}).error().code, StatusCode::kInvalidArgument);
  EXPECT_EQ(Everything(*store), before);
  EXPECT_TRUE(MergeSites(*store, "lab", "hall")) << "without a transform nothing is estimated again";
}

// Its checkpoint would be removed, and nothing would be left of it.
TEST(MergeSites, ASessionOfWhichOnlyTheCheckpointIsLeftIsNotMoved) {
  const auto store = MemoryStore();
  Put(*store, {.name = "lab"});
  Put(*store, {.name = "hall", .first_session = 11, .job = 4});
  ASSERT_TRUE(store->Commit({.removed = {{.kind = RecordKind::kJournal, .owner = 11}}, .put = {}}));
  const auto moved = MergeSites(*store, "lab", "hall", {1.0, 0.0, 0.0});
  ASSERT_FALSE(moved);
  EXPECT_NE(moved.error().message.find("has no entries"), std::string::npos) << moved.error().message;
  EXPECT_TRUE(*ReadCheckpoint(*store, 11));
}

TEST(SplitSite, TheSessionsGoWithTheirPartOfEverything) {
  const auto store = MemoryStore();
  Put(*store, {});
  const auto before = Everything(*store);
  MakeFragments(*store, "lab", {1, 3});
  ASSERT_TRUE(SplitSite(*store, "lab", {2, 3}, "annex"));
  EXPECT_EQ(ReadSite(*store, "lab")->site.fragments, std::set<std::uint64_t>{1});
  EXPECT_EQ(ReadSite(*store, "annex")->site.fragments, std::set<std::uint64_t>{3});
  EXPECT_EQ(ReadSite(*store, "lab")->site.past, std::vector<std::uint64_t>{1});
  EXPECT_EQ(ReadSite(*store, "annex")->site.past, std::vector<std::uint64_t>{3});
  const auto lab = ReadSite(*store, "lab"), annex = ReadSite(*store, "annex");
  ASSERT_TRUE(lab && annex);
  EXPECT_EQ(lab->sessions.size(), 1U);
  EXPECT_EQ(annex->sessions.at(2).request.site, "annex");
  EXPECT_TRUE(lab->layers.empty());
  EXPECT_EQ(annex->layers, std::vector<std::uint64_t>{3});
  EXPECT_EQ(annex->site.members, (std::map<NameId, std::uint64_t>{{HashName("r2"), 2}}));
  EXPECT_EQ(annex->site.switches, lab->site.switches);
  const auto stayed = *ReadVersions(*store, HashName("lab")), gone = *ReadVersions(*store, HashName("annex"));
  EXPECT_TRUE(stayed.at(2).parts.contains(1) && !stayed.at(2).parts.contains(2));
  EXPECT_TRUE(gone.at(2).parts.contains(2) && !gone.at(2).parts.contains(1));
  EXPECT_TRUE(stayed.at(2).smoothed.contains("r1") && !stayed.at(2).smoothed.contains("r2"));
  EXPECT_TRUE(gone.at(2).smoothed.contains("r2"));
  for (const std::uint64_t number : {2, 4}) {
    const RecordKey key{RecordKind::kJournal, 2, number};
    EXPECT_EQ(Everything(*store)[key], before.at(key));
  }
  EXPECT_EQ(SplitSite(*store, "lab", {1}, "annex").error().code, StatusCode::kAlreadyExists);
  EXPECT_EQ(SplitSite(*store, "lab", {2}, "other").error().code, StatusCode::kNotFound);
  // Put together again, each session is where it was.
  ASSERT_TRUE(MergeSites(*store, "lab", "annex"));
  EXPECT_EQ(ReadSite(*store, "lab")->sessions.size(), 2U);
}

TEST(DeleteSession, ItsScansAndItsPartOfTheMapAreGone) {
  const auto store = MemoryStore();
  Put(*store, {});
  ASSERT_TRUE(store->Commit({.removed = {}, .put = {{{RecordKind::kRestoring, 1, 0}, "a mark"}}}));
  ASSERT_TRUE(DeleteSession(*store, "lab", 1));
  ASSERT_TRUE(RemoveRests(*store));
  for (const auto& [key, bytes] : Everything(*store)) {
    const bool of_session = key.kind == RecordKind::kSession || key.kind == RecordKind::kJournal ||
                            key.kind == RecordKind::kCheckpoint || key.kind == RecordKind::kRestoring;
    EXPECT_FALSE(of_session && key.owner == 1) << static_cast<int>(key.kind);
  }
  const auto versions = *ReadVersions(*store, HashName("lab"));
  EXPECT_FALSE(versions.at(1).parts.contains(1));
  EXPECT_TRUE(versions.at(1).parts.contains(2));
  EXPECT_FALSE(versions.at(2).smoothed.contains("r1"));
  ASSERT_TRUE(DeleteSession(*store, "lab", 3));
  EXPECT_TRUE(ReadSite(*store, "lab")->layers.empty());
  EXPECT_EQ(DeleteSession(*store, "lab", 3).error().code, StatusCode::kNotFound);
}

TEST(FindSession, TakesARobotOrANumber) {
  const auto store = MemoryStore();
  Put(*store, {});
  const auto contents = *ReadSite(*store, "lab");
  EXPECT_EQ(*FindSession(contents, "r2"), 2U);
  EXPECT_EQ(*FindSession(contents, "3"), 3U);
  EXPECT_FALSE(FindSession(contents, "4"));
  EXPECT_FALSE(FindSession(contents, "2x"));
}

TEST(GridTransform, TurnsAndBackAreTheSameGrid) {
  StoredGrid grid = SampleGrid(3);
  grid.path = std::make_shared<const std::vector<Pose2>>(12, Pose2{1.0, 2.0, 0.5});
  grid.numbers = std::make_shared<const std::vector<std::uint64_t>>(12, 5);
  const StoredGrid there = Transformed(grid, {0.35, -2.0, kQuarterTurn}, 0.05);
  const StoredGrid back = Transformed(there, Pose2{0.35, -2.0, kQuarterTurn}.Inverse(), 0.05);
  EXPECT_EQ(back.keyframes, grid.keyframes);
  EXPECT_EQ(back.numbers, grid.numbers);
  ASSERT_EQ(back.chunks.size(), grid.chunks.size());
  for (std::size_t i = 0; i < grid.chunks.size(); ++i) {
    EXPECT_EQ(back.chunks[i].x, grid.chunks[i].x);
    EXPECT_EQ(back.chunks[i].y, grid.chunks[i].y);
    EXPECT_TRUE(
        std::equal(grid.chunks[i].cells.get(), grid.chunks[i].cells.get() + kTileArea, back.chunks[i].cells.get()));
  }
  const Pose2 T_to_from{0.35, -2.0, kQuarterTurn};
  ASSERT_TRUE(there.path && back.path);
  EXPECT_EQ(there.path->at(5), T_to_from * grid.path->at(5));
  EXPECT_LT((back.path->at(5).translation() - grid.path->at(5).translation()).norm(), 1e-9);
  EXPECT_TRUE(Transformed({}, {1, 2, 3}, 0.05).chunks.empty());
  EXPECT_EQ(Transformed({}, {1, 2, 3}, 0.05).path, nullptr);
}

}  // namespace
}  // namespace cairn::server::testing
