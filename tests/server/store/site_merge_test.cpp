// How two sites of a store become one.
#include <gtest/gtest.h>

#include "server/store/site_edit.h"
#include "tests/server/store/stored_sites.h"

namespace cairn::server::testing {
namespace {

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
  const auto never = std::get<CorrectionTaken>(JournalOf(*store, 1)[4]);
  Switches many;
  for (std::uint32_t epoch = 1; epoch <= kMostSwitches; ++epoch) many[epoch + 100] = 6;
  EXPECT_FALSE(IsCompleted(many, never.epoch, never.generation));
}

// A site keeps its newest switches only, and those before count as completed. In a merged site they did not.
TEST(MergeSites, CorrectionsThatTheirSiteHasForgottenStayCompleted) {
  for (const bool of_into : {false, true}) {
    const auto store = MemoryStore();
    Put(*store, {.name = "lab", .epoch = of_into ? 2000U : 3U, .generation = 5});
    Put(*store, {.name = "hall", .first_session = 11, .job = 4, .epoch = of_into ? 3U : 2000U, .generation = 5});
    const std::string long_lived = of_into ? "lab" : "hall";
    const std::uint64_t session = of_into ? 1 : 11;
    StoredSite site = ReadSite(*store, long_lived)->site;
    site.switches.clear();
    for (std::uint32_t epoch = 977; epoch <= 2000; ++epoch) site.switches[epoch] = 5;
    ASSERT_EQ(site.switches.size(), kMostSwitches);
    // Of the same epoch in two generations only one was completed; which one is not known any more.
    const std::vector<JournalEntry> forgotten = {CorrectionTaken{12, 2, SampleGrid(8)},
                                                 CorrectionTaken{500, 3, SampleGrid(8)},
                                                 CorrectionTaken{500, 4, SampleGrid(8)}};
    ASSERT_TRUE(store->Commit({.removed = {},
                               .put = {{{RecordKind::kSite, HashName(long_lived), 0}, BytesOf(site)},
                                       {{RecordKind::kJournal, session, 7}, BytesOf(5, forgotten)}}}));
    ASSERT_TRUE(MergeSites(*store, "lab", "hall"));
    const Switches merged = ReadSite(*store, "lab")->site.switches;
    const std::vector<JournalEntry> journal = JournalOf(*store, session);
    for (std::size_t i = 0; i < forgotten.size(); ++i) {
      const auto& correction = std::get<CorrectionTaken>(journal[4 + i]);
      EXPECT_EQ(correction.epoch, std::get<CorrectionTaken>(forgotten[i]).epoch + (of_into ? 0 : 3));
      EXPECT_TRUE(IsCompleted(merged, correction.epoch, correction.generation)) << i;
    }
  }
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
  EXPECT_NEAR(lab->jobs.at(4).job.places.at(0).T_map_robot.x, -1.0, 1e-12);
  EXPECT_EQ(lab->jobs.at(1).job.places.at(0).T_map_robot.x, 1.0);
}

TEST(MergeSites, EditsOfBothStayWhereTheyAreInTheBuilding) {
  const auto store = MemoryStore();
  Put(*store, {.name = "lab"});
  Put(*store, {.name = "hall", .first_session = 11, .job = 4});
  for (const char* const name : {"lab", "hall"}) {
    StoredSite site = ReadSite(*store, name)->site;
    site.edits = {{.id = 2, .kind = MapEditKind::kKeepOut, .points_map = {{0, 0}, {2, 0}, {2, 1}}, .note = name}};
    site.edits_version = 3;
    site.anchors[2] = {.points_then = {{0, 1}, {2, 1}, {2, 2}},
                       .keyframes = {{site.members.begin()->second, 8, {1, 1, 0}, {1, 0, 0}}}};
    ASSERT_TRUE(store->Commit({.removed = {}, .put = {{{RecordKind::kSite, HashName(name), 0}, BytesOf(site)}}}));
  }
  ASSERT_TRUE(MergeSites(*store, "lab", "hall", {1.0, 0.5, kQuarterTurn}));
  const auto lab = ReadSite(*store, "lab");
  ASSERT_TRUE(lab);
  EXPECT_EQ(lab->site.edits_version, 6U);
  ASSERT_EQ(lab->site.edits.size(), 2U);
  EXPECT_EQ(lab->site.edits[0].points_map[1], Eigen::Vector2d(2, 0));
  EXPECT_EQ(lab->site.edits[1].id, 5U);
  EXPECT_EQ(lab->site.edits[1].note, "hall");
  EXPECT_NEAR(lab->site.edits[1].points_map[1].x(), 1.0, 1e-12);
  EXPECT_NEAR(lab->site.edits[1].points_map[1].y(), 2.5, 1e-12);
  // And they go on with the same keyframes.
  EXPECT_EQ(lab->site.anchors.at(2).keyframes.at(0).T_map_then, (Pose2{1, 1, 0}));
  const EditAnchors& anchors = lab->site.anchors.at(5);
  EXPECT_GT(anchors.keyframes.at(0).session, 10U);
  EXPECT_NEAR(anchors.points_then.at(1).x(), 0.0, 1e-12);
  EXPECT_NEAR(anchors.points_then.at(1).y(), 2.5, 1e-12);
  EXPECT_NEAR(anchors.keyframes.at(0).T_map_then.x, 0.0, 1e-12);
  EXPECT_NEAR(anchors.keyframes.at(0).T_map_now.y, 1.5, 1e-12);
  EXPECT_NEAR(anchors.keyframes.at(0).T_map_now.theta, kQuarterTurn, 1e-12);
}

TEST(MergeSites, TheFrameOfTheBuildingIsThatOfTheSiteThatStays) {
  for (const bool lab_has_one : {true, false}) {
    const auto store = MemoryStore();
    Put(*store, {.name = "lab"});
    Put(*store, {.name = "hall", .first_session = 11, .job = 4});
    for (const char* const name : {"lab", "hall"}) {
      if (!lab_has_one && name == std::string("lab")) continue;
      StoredSite site = ReadSite(*store, name)->site;
      site.edits = {{.id = 1, .kind = MapEditKind::kOrigin, .points_map = {{3, 4}, {4, 4}}, .note = name}};
      site.edits_version = 1;
      ASSERT_TRUE(store->Commit({.removed = {}, .put = {{{RecordKind::kSite, HashName(name), 0}, BytesOf(site)}}}));
    }
    ASSERT_TRUE(MergeSites(*store, "lab", "hall", {1.0, 0.5, kQuarterTurn}));
    const auto lab = ReadSite(*store, "lab");
    ASSERT_TRUE(lab);
    ASSERT_EQ(lab->site.edits.size(), 1U);
    EXPECT_EQ(lab->site.edits[0].note, lab_has_one ? "lab" : "hall");
  }
}

TEST(MergeSites, EditsThatASplitLeftInBothPartsAreThereOnceAgain) {
  const auto store = MemoryStore();
  Put(*store, {.name = "lab"});
  Put(*store, {.name = "hall", .first_session = 11, .job = 4});
  const auto set = [&](const char* name, std::vector<MapEdit> edits, std::uint64_t version) {
    StoredSite site = ReadSite(*store, name)->site;
    site.edits = std::move(edits);
    site.edits_version = version;
    ASSERT_TRUE(store->Commit({.removed = {}, .put = {{{RecordKind::kSite, HashName(name), 0}, BytesOf(site)}}}));
  };
  const MapEdit both{.id = 2, .kind = MapEditKind::kKeepOut, .points_map = {{0, 0}, {2, 0}, {2, 1}}, .note = "stairs"};
  MapEdit own = both;
  own.id = 3;
  own.note = "of the hall";
  set("lab", {both}, 3);
  set("hall", {both, own}, kMaxEditsVersion - 3);
  EXPECT_EQ(MergeSites(*store, "lab", "hall").error().code, StatusCode::kOutOfRange);
  ASSERT_TRUE(ReadSite(*store, "hall")) << "nothing has changed";
  set("hall", {both, own}, 3);
  ASSERT_TRUE(MergeSites(*store, "lab", "hall"));
  const auto lab = ReadSite(*store, "lab");
  ASSERT_EQ(lab->site.edits.size(), 2U);
  EXPECT_EQ(lab->site.edits[0], both);
  EXPECT_EQ(lab->site.edits[1].note, "of the hall");
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
  EXPECT_EQ(lab->site.kept_apart, (std::set<std::uint64_t>{12, 13}));
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

// Such a session could not be moved, and nobody said what to do.
TEST(MergeSites, ASessionWithAPlaceThatNoScanHasConfirmedIsMovedWithoutIt) {
  const JournalEntry found = PlaceSuggested{9, {1.0, 2.0, 0.5}, {false, {SampleTile()}, 0.05, 1}};
  for (const bool scan_follows : {false, true}) {
    const auto store = MemoryStore();
    Put(*store, {.name = "lab"});
    Put(*store, {.name = "hall", .first_session = 11, .job = 4});
    std::vector<JournalEntry> entries{found};
    if (scan_follows) entries.emplace_back(SampleScan(3));
    const std::uint64_t last = 4 + entries.size();
    ASSERT_TRUE(store->Commit({.removed = {}, .put = {{{RecordKind::kJournal, 11, last}, BytesOf(5, entries)}}}));
    const auto moved = MergeSites(*store, "lab", "hall", {1.0, 0.5, kQuarterTurn});
    if (scan_follows) {
      ASSERT_FALSE(moved);
      EXPECT_EQ(moved.error().code, StatusCode::kFailedPrecondition);
      EXPECT_NE(moved.error().message.find("session 11"), std::string::npos) << moved.error().message;
      EXPECT_NE(moved.error().message.find("other way round"), std::string::npos) << moved.error().message;
      EXPECT_TRUE(MergeSites(*store, "hall", "lab", {1.0, 0.5, kQuarterTurn})) << "as the error says";
    } else {
      ASSERT_TRUE(moved) << moved.error().message;
      EXPECT_TRUE(std::get<PlaceSuggested>(JournalOf(*store, 11)[4]).map.tiles.empty());
    }
  }
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

}  // namespace
}  // namespace cairn::server::testing
