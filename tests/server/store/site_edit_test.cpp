#include "server/store/site_edit.h"

#include <gtest/gtest.h>

#include "server/store/grid_transform.h"
#include "server/store/journal.h"
#include "tests/server/store/faulty_vfs.h"
#include "tests/server/store/stored_sites.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

std::filesystem::path Saved(const TempDirectory& directory, const SampleSite& sample, std::uint64_t fragment = 0) {
  const auto store = MemoryStore();
  Put(*store, sample);
  if (fragment != 0) MakeFragments(*store, sample.name, {fragment});
  const auto path = directory / (sample.name + ".site");
  EXPECT_TRUE(WriteSiteFile(*store, sample.name, path));
  return path;
}

// A keep-out that hangs on a keyframe of each of these sessions.
void PutEdit(Store& store, const std::string& name, const std::vector<std::uint64_t>& sessions) {
  StoredSite site = ReadSite(store, name)->site;
  site.edits = {{.id = 1, .kind = MapEditKind::kKeepOut, .points_map = {{0, 0}, {2, 0}, {2, 1}}, .note = {}}};
  site.edits_version = 1;
  site.anchors[1].points_then = site.edits[0].points_map;
  for (const std::uint64_t session : sessions)
    site.anchors[1].keyframes.push_back({session, 10 * session, {}, {0.1 * static_cast<double>(session), 0, 0}});
  ASSERT_TRUE(store.Commit({.removed = {}, .put = {{{RecordKind::kSite, HashName(name), 0}, BytesOf(site)}}}));
}
// The sessions, and the keyframes of these.
std::map<std::uint64_t, std::uint64_t> AnchorsIn(Store& store, const std::string& name) {
  std::map<std::uint64_t, std::uint64_t> keyframes;
  const StoredSite site = ReadSite(store, name)->site;
  EXPECT_EQ(site.edits.size(), 1U);
  const auto anchors = site.anchors.find(1);
  if (anchors == site.anchors.end()) return keyframes;
  for (const EditAnchor& one : anchors->second.keyframes) keyframes[one.session] = one.keyframe;
  return keyframes;
}

TEST(ImportSite, EditsHangOnTheSameKeyframesUnderTheirNewNumbers) {
  const TempDirectory directory;
  const auto store = MemoryStore();
  Put(*store, {.name = "hall"});
  PutEdit(*store, "hall", {2, 3, 9});
  ASSERT_TRUE(WriteSiteFile(*store, "hall", directory / "hall.site"));
  const auto other = MemoryStore();
  Put(*other, {.name = "lab", .first_session = 11, .job = 4});
  ASSERT_TRUE(ImportSite(*other, directory / "hall.site"));
  EXPECT_EQ(AnchorsIn(*other, "hall"), (std::map<std::uint64_t, std::uint64_t>{{15, 20}, {16, 30}}))
      << "there is no session 9";
}

TEST(SplitSite, EditsOfBothPartsHangOnTheKeyframesOfTheirOwnSessions) {
  const auto store = MemoryStore();
  Put(*store, {});
  PutEdit(*store, "lab", {1, 2});
  ASSERT_TRUE(SplitSite(*store, "lab", {2, 3}, "annex"));
  EXPECT_EQ(AnchorsIn(*store, "lab"), (std::map<std::uint64_t, std::uint64_t>{{1, 10}}));
  EXPECT_EQ(AnchorsIn(*store, "annex"), (std::map<std::uint64_t, std::uint64_t>{{2, 20}}));
  const EditAnchors left = ReadSite(*store, "lab")->site.anchors.at(1);
  EXPECT_EQ(left.keyframes.front().T_map_then, left.keyframes.front().T_map_now) << "the edit lies where it lay";
  ASSERT_TRUE(DeleteSession(*store, "lab", 1));
  EXPECT_TRUE(AnchorsIn(*store, "lab").empty());
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
  EXPECT_EQ(hall->site.kept_apart, std::set<std::uint64_t>{15});
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
  ASSERT_EQ(contents->jobs.size(), 1U);
  EXPECT_EQ(contents->jobs.begin()->second.job.robot, "c1");
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

// A work that takes too long for the robots of a running server.
TEST(ImportSite, AWorkThatMayNotGoOnChangesNothing) {
  const TempDirectory directory;
  const auto path = Saved(directory, {});
  const auto store = MemoryStore();
  ImportOptions options;
  int asked = 0;
  int goes_on = 0;
  options.may_go_on = [&] { return ++asked <= goes_on; };
  const auto records = static_cast<int>(SurveySiteFile(path)->records);
  for (const int most : {0, 3, records + 4}) {  // While the file is looked through, and while it is taken in.
    asked = 0;
    goes_on = most;
    EXPECT_EQ(ImportSite(*store, path, options).error().code, StatusCode::kResourceExhausted) << most;
    EXPECT_TRUE(Everything(*store).empty());
  }

  ASSERT_TRUE(ImportSite(*store, path));
  const auto other = directory / "other.site";
  asked = 0;
  goes_on = 3;
  const auto written = WriteSiteFile(*store, "lab", other, options.may_go_on);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, StatusCode::kResourceExhausted);
  EXPECT_FALSE(std::filesystem::exists(other));
}

TEST(SplitSite, TheSessionsGoWithTheirPartOfEverything) {
  const auto store = MemoryStore();
  Put(*store, {});
  const auto before = Everything(*store);
  MakeFragments(*store, "lab", {1, 3});
  ASSERT_TRUE(SplitSite(*store, "lab", {2, 3}, "annex"));
  EXPECT_EQ(ReadSite(*store, "lab")->site.fragments, std::set<std::uint64_t>{1});
  EXPECT_EQ(ReadSite(*store, "annex")->site.fragments, std::set<std::uint64_t>{3});
  EXPECT_EQ(ReadSite(*store, "lab")->site.kept_apart, std::set<std::uint64_t>{1});
  EXPECT_EQ(ReadSite(*store, "annex")->site.kept_apart, std::set<std::uint64_t>{3});
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
