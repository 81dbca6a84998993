// Sites as files, with the whole server and without DDS: what is saved comes back in another server, or in the same
// one.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "server/store/site_edit.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

using ::testing::HasSubstr;

constexpr ClientId kRider = 7;

Request AboutSite(RequestKind kind, const std::string& site = "lab", const std::string& robot = "r1") {
  Request request;
  request.kind = kind;
  request.site = site;
  request.robot = robot;
  return request;
}

Request AboutFile(RequestKind kind, const std::string& site, const std::string& name) {
  Request request = AboutSite(kind, site);
  request.saved = name;
  return request;
}

// What a site looks like from outside: nothing of it may be lost by saving and loading.
struct View {
  std::map<TileKey, TileCells> tiles;
  std::map<std::string, Trajectory> paths, smoothed;
  std::map<std::string, std::uint64_t> used;
  std::vector<std::string> notes;
  std::uint32_t enabled = 0;
};

View ViewOf(WholeServer& house, const std::string& site = "lab") {
  View view;
  for (std::uint32_t level = 0; level < kPyramidLevels; ++level) {
    Request tiles = AboutSite(RequestKind::kTiles, site);
    tiles.level = level;
    for (const Tile& tile : house.Ask(tiles).tiles) view.tiles[tile.key] = *DecodeCells(tile.bytes, tile.encoding);
  }
  for (const RobotStatus& robot : house.Ask(AboutSite(RequestKind::kStatus, site, "")).robots) {
    const std::string& name = robot.session.robot;
    if (robot.session.site != site) continue;
    Request path = AboutSite(RequestKind::kPath, site, name);
    view.paths[name] = house.Ask(path).path;
    path.smoothed = true;
    view.smoothed[name] = house.Ask(path).path;
    view.used[name] = robot.ledgers.empty() ? 0 : robot.ledgers[0].used;
  }
  for (const MapInfo& map : house.Ask(AboutSite(RequestKind::kMapInfo, site)).maps) {
    view.enabled = map.enabled_version;
    for (const MapVersionInfo& version : map.versions) view.notes.push_back(version.note);
  }
  return view;
}

void ExpectSame(const View& a, const View& b) {
  EXPECT_EQ(a.tiles, b.tiles);
  EXPECT_EQ(a.notes, b.notes);
  EXPECT_EQ(a.enabled, b.enabled);
  EXPECT_EQ(a.used, b.used);
  for (const auto* const paths : {&a.paths, &a.smoothed}) {
    const auto& others = paths == &a.paths ? b.paths : b.smoothed;
    ASSERT_EQ(paths->size(), others.size());
    for (const auto& [robot, path] : *paths) EXPECT_TRUE(SamePath(path, others.at(robot))) << robot;
  }
}

// A site is drawn a moment after its sessions were restored.
bool WaitTiles(WholeServer& house, const std::map<TileKey, TileCells>& tiles) {
  return house.WaitFor([&] { return ViewOf(house).tiles == tiles; });
}
bool WaitDrawn(WholeServer& house) {
  return house.WaitFor([&] { return !ViewOf(house).tiles.empty(); });
}

// All that a server has drawn of its one site, for which it must end: only then the last of it is published.
std::map<TileKey, TileCells> StopAndGetTiles(WholeServer& house) {
  house.Stop();
  std::map<TileKey, TileCells> drawn;
  for (const auto& [key, tile] : house.CurrentTiles()) drawn[key] = *DecodeCells(tile.bytes, tile.encoding);
  return drawn;
}

Job Smooth(WholeServer& house, const std::string& site = "lab") {
  const Reply submitted = house.Ask(AboutSite(RequestKind::kJobSubmit, site));
  EXPECT_EQ(submitted.jobs.size(), 1U) << submitted.status.message;
  return submitted.jobs.empty() ? Job{} : house.WaitJob(submitted.jobs[0].id);
}

bool Stored(WholeServer& house, const std::string& robot, std::uint64_t scans) {
  return house.WaitFor([&] {
    const Reply status = house.Ask(AboutSite(RequestKind::kStatus, "", robot));
    return !status.robots.empty() && !status.robots[0].ledgers.empty() &&
           status.robots[0].ledgers[0].durable_through == scans;
  });
}

// Robot r0 has drawn a part of the map and begun again; r1 was smoothed and has driven on; both have left.
void MakeSite(WholeServer& house) {
  house.Open("r0", 9);
  house.Drive("r0", 9, 0, 20);
  house.End("r0", 9);
  ASSERT_TRUE(house.WaitPhase("r0", 9, SessionPhase::kEnded));
  house.Open("r0", 9);
  ASSERT_TRUE(house.WaitPhase("r0", 9, SessionPhase::kActive));
  house.Open("r1", kRider);
  house.Drive("r1", kRider, 0, 60);
  ASSERT_EQ(Smooth(house).state, JobState::kSucceeded);
  house.Drive("r1", kRider, 60, 80);
  ASSERT_TRUE(Stored(house, "r1", 80));
}

void Leave(WholeServer& house) {
  house.Push(ClientLiveliness{9, HashName("r0"), false});
  house.Push(ClientLiveliness{kRider, HashName("r1"), false});
  ASSERT_TRUE(house.WaitPhase("r0", 9, SessionPhase::kSuspended));
  ASSERT_TRUE(house.WaitPhase("r1", kRider, SessionPhase::kSuspended));
}

void WriteText(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

TEST(SavedSites, InAnotherServerEverythingIsAsItWas) {
  const TempDirectory directory;
  View before, later;
  std::map<TileKey, TileCells> drawn;
  {
    StoredServer first(directory / "0");
    ASSERT_NO_FATAL_FAILURE(MakeSite(*first.operator->()));
    const Reply saved = first->Ask(AboutFile(RequestKind::kSiteSave, "lab", "monday"));
    ASSERT_TRUE(saved.status.ok()) << saved.status.message;
    ASSERT_EQ(saved.saved.size(), 1U);
    EXPECT_EQ(saved.saved[0].site, "lab");
    EXPECT_EQ(saved.saved[0].bytes, std::filesystem::file_size(directory / "0" / "saved" / "monday.site"));
    drawn = StopAndGetTiles(*first.operator->());
  }
  {
    StoredServer again(directory / "0");
    ASSERT_TRUE(WaitTiles(*again.operator->(), drawn));
    before = ViewOf(*again.operator->());
    ASSERT_EQ(Smooth(*again.operator->()).state, JobState::kSucceeded);
    later = ViewOf(*again.operator->());
  }
  ASSERT_EQ(before.used["r1"], 80U);
  ASSERT_GE(before.tiles.size(), 4U);
  ASSERT_EQ(before.smoothed["r1"].size(), 60U);
  {
    const auto store = *OpenStore(directory / "1");
    const auto imported = ImportSite(*store, directory / "0" / "saved" / "monday.site");
    ASSERT_TRUE(imported) << imported.error().message;
  }
  StoredServer second(directory / "1");
  ASSERT_TRUE(WaitTiles(*second.operator->(), drawn));
  ExpectSame(before, ViewOf(*second.operator->()));
  // Also what a job makes of it.
  ASSERT_EQ(Smooth(*second.operator->()).state, JobState::kSucceeded);
  ExpectSame(later, ViewOf(*second.operator->()));
}

TEST(SavedSites, ARunningServerDeletesASiteAndTakesItUpAgain) {
  const TempDirectory directory;
  View before;
  {
    StoredServer server(directory / "0");
    WholeServer& house = *server.operator->();
    ASSERT_NO_FATAL_FAILURE(MakeSite(house));
    house.Open("r5", 55, "hall");
    house.Drive("r5", 55, 0, 20);
    const Reply active = house.Ask(AboutSite(RequestKind::kSiteDelete));
    EXPECT_EQ(active.status.code, StatusCode::kFailedPrecondition);
    EXPECT_THAT(active.status.message, HasSubstr("is active"));
    ASSERT_NO_FATAL_FAILURE(Leave(house));
    ASSERT_TRUE(house.Ask(AboutSite(RequestKind::kSiteSave)).status.ok());
    ASSERT_TRUE(ImportSite(*OpenStore(directory / "1").value(), directory / "0" / "saved" / "lab.site"));
    ASSERT_TRUE(WaitTiles(house, StopAndGetTiles(*StoredServer(directory / "1").operator->())));
    before = ViewOf(house);
    const std::uint32_t epoch = house.Ask(AboutSite(RequestKind::kMapInfo)).maps.at(0).epoch;
    ASSERT_EQ(house.Ask(AboutFile(RequestKind::kSiteLoad, "", "lab")).status.code, StatusCode::kAlreadyExists);

    const Reply deleted = house.Ask(AboutSite(RequestKind::kSiteDelete));
    ASSERT_TRUE(deleted.status.ok()) << deleted.status.message;
    EXPECT_EQ(house.Ask(AboutSite(RequestKind::kMapInfo)).status.code, StatusCode::kNotFound);
    EXPECT_EQ(house.Ask(AboutSite(RequestKind::kPath)).status.code, StatusCode::kNotFound);
    EXPECT_TRUE(house.Ask(AboutSite(RequestKind::kJobList)).jobs.empty());
    EXPECT_EQ(ReadSite(server.store(), "lab").error().code, StatusCode::kNotFound);
    EXPECT_EQ(ReadSessions(server.store())->size(), 1U) << "only the other site's is left";
    // Whoever has a copy of the map is told that nothing of it is left; the hall is.
    ASSERT_TRUE(house.WaitFor([&] {
      std::map<TileKey, bool> there;
      for (const TileSample& tile : house.All<TileSample>())
        if (tile.site_id == HashName("lab")) there[tile.tile.key] = !tile.deleted;
      return !there.empty() && std::none_of(there.begin(), there.end(), [](const auto& one) { return one.second; });
    }));
    EXPECT_EQ(ViewOf(house, "hall").used["r5"], 20U);
    // Its robots' keys on the wire are free, also those of sessions that were only suspended.
    ASSERT_TRUE(house.WaitFor([&] {
      return std::ranges::any_of(house.All<Retired>(), [](const Retired& retired) {
        const auto* const state = std::get_if<SessionState>(&retired.of);
        return state != nullptr && state->site == "lab";
      });
    }));

    const Reply loaded = house.Ask(AboutFile(RequestKind::kSiteLoad, "", "lab"));
    ASSERT_TRUE(loaded.status.ok()) << loaded.status.message;
    ASSERT_TRUE(WaitTiles(house, before.tiles));
    ExpectSame(before, ViewOf(house));
    EXPECT_GT(house.Ask(AboutSite(RequestKind::kMapInfo)).maps.at(0).epoch, epoch)
        << "an epoch that clients know is over";
    // The robot goes on in it.
    house.Push(SessionRequest{.robot = "r1",
                              .site = "lab",
                              .sensors = {"laser"},
                              .client = kRider,
                              .has_start = true,
                              .T_map_robot_start = {},
                              .end = false,
                              .session = house.TokenOf("r1", kRider),
                              .started = true});
    ASSERT_TRUE(house.WaitPhase("r1", kRider, SessionPhase::kActive));
    house.Drive("r1", kRider, 80, 90);
    EXPECT_EQ(ViewOf(house).used["r1"], 90U);
    before = ViewOf(house);
    ASSERT_TRUE(Stored(house, "r1", 90));
  }
  StoredServer next(directory / "0");
  ASSERT_TRUE(next->WaitFor([&] { return ViewOf(*next.operator->()).tiles.size() == before.tiles.size(); }));
  EXPECT_TRUE(SamePath(ViewOf(*next.operator->()).paths["r1"], before.paths["r1"]));
}

TEST(SavedSites, WhatCannotBeSavedOrLoadedIsRefusedAndNothingChanges) {
  const TempDirectory directory;
  StoredServer server(directory / "0");
  WholeServer& house = *server.operator->();
  house.Open("r1", kRider);
  house.Drive("r1", kRider, 0, 20);
  ASSERT_TRUE(Stored(house, "r1", 20));
  ASSERT_TRUE(house.WaitFor([&] { return ReadSite(server.store(), "lab").has_value(); }));
  const auto refused = [&](RequestKind kind, const std::string& site, const std::string& name) {
    return house.Ask(AboutFile(kind, site, name)).status;
  };
  EXPECT_EQ(refused(RequestKind::kSiteSave, "nowhere", "").code, StatusCode::kNotFound);
  for (const char* name : {"../lab", "/tmp/lab", "a/b", ".lab", "..", "saved\\..", "a b"}) {
    EXPECT_EQ(refused(RequestKind::kSiteSave, "lab", name).code, StatusCode::kInvalidArgument) << name;
    EXPECT_EQ(refused(RequestKind::kSiteLoad, "", name).code, StatusCode::kInvalidArgument) << name;
  }
  EXPECT_EQ(refused(RequestKind::kSiteLoad, "", "").code, StatusCode::kInvalidArgument);
  EXPECT_EQ(refused(RequestKind::kSiteLoad, "", "nothing").code, StatusCode::kNotFound);
  EXPECT_EQ(refused(RequestKind::kSiteDelete, "nowhere", "").code, StatusCode::kNotFound);
  ASSERT_TRUE(refused(RequestKind::kSiteSave, "lab", "good").ok());
  // The robot drives here, so its session cannot be there as well.
  const Status twice = refused(RequestKind::kSiteLoad, "copy", "good");
  EXPECT_EQ(twice.code, StatusCode::kAlreadyExists);
  EXPECT_THAT(twice.message, HasSubstr("'r1'"));
  WriteText(directory / "0" / "saved" / "bad.site", "cairnste, or what is left of it");
  EXPECT_NE(refused(RequestKind::kSiteLoad, "copy", "bad").code, StatusCode::kOk);
  const auto listed = house.Ask(AboutSite(RequestKind::kSavedList)).saved;
  ASSERT_EQ(listed.size(), 2U);
  EXPECT_EQ(listed[0].name, "bad");
  EXPECT_EQ(listed[0].site, "");
  EXPECT_EQ(listed[1].site, "lab");
  EXPECT_EQ(*SiteNames(server.store()), std::vector<std::string>{"lab"});
  EXPECT_EQ(ViewOf(house).used["r1"], 20U);
  // Without a place for files there are none.
  WholeServer forgetful;
  EXPECT_EQ(forgetful.Ask(AboutSite(RequestKind::kSiteSave)).status.code, StatusCode::kFailedPrecondition);
  EXPECT_EQ(forgetful.Ask(AboutSite(RequestKind::kSiteDelete)).status.code, StatusCode::kFailedPrecondition);
}

TEST(SavedSites, FilesAreDeletedByNameAndTakeABoundedSpace) {
  const TempDirectory directory;
  ServerOptions options = TestOptions();
  options.store.max_saved_gib = 1e-9;  // One byte: the first file is already as much as is allowed.
  std::filesystem::create_directories(directory / "0" / "saved");
  WriteText(directory / "0" / "saved" / "sunday.site.tmp.17.0", "a server was killed while it wrote this");
  StoredServer server(directory / "0", options);
  WholeServer& house = *server.operator->();
  house.Open("r1", kRider);
  house.Drive("r1", kRider, 0, 20);
  ASSERT_TRUE(Stored(house, "r1", 20));
  ASSERT_TRUE(house.WaitFor([&] { return ReadSite(server.store(), "lab").has_value(); }));
  const auto status = [&](RequestKind kind, const std::string& site, const std::string& name) {
    return house.Ask(AboutFile(kind, site, name)).status;
  };
  ASSERT_TRUE(status(RequestKind::kSiteSave, "lab", "monday").ok());
  const Status full = status(RequestKind::kSiteSave, "lab", "tuesday");
  EXPECT_EQ(full.code, StatusCode::kResourceExhausted);
  EXPECT_THAT(full.message, HasSubstr("store.max_saved_gib"));
  EXPECT_EQ(status(RequestKind::kSiteDelete, "lab", "monday").code, StatusCode::kInvalidArgument);
  EXPECT_EQ(status(RequestKind::kSiteDelete, "", "../cairn").code, StatusCode::kInvalidArgument);
  EXPECT_EQ(status(RequestKind::kSiteDelete, "", "tuesday").code, StatusCode::kNotFound);
  EXPECT_EQ(house.Ask(AboutSite(RequestKind::kSavedList)).saved.size(), 1U);
  ASSERT_TRUE(status(RequestKind::kSiteDelete, "", "monday").ok());
  EXPECT_TRUE(house.Ask(AboutSite(RequestKind::kSavedList)).saved.empty());
  EXPECT_FALSE(std::filesystem::exists(directory / "0" / "saved" / "monday.site"));
  EXPECT_EQ(ViewOf(house).used["r1"], 20U);
  EXPECT_TRUE(status(RequestKind::kSiteSave, "lab", "tuesday").ok());
}

// Two robots that have each mapped the same room from where they stood: with the right transform it is one room.
TEST(SavedSites, TwoSitesAreMergedIntoOneMap) {
  const TempDirectory directory;
  constexpr int kScans = 60;
  const Pose2 T_lab_annex = TruePose(30);  // The second robot has called the place of step 30 its origin.
  {
    StoredServer server(directory / "0");
    server->Open("r1", kRider, "lab");
    server->Drive("r1", kRider, 0, kScans);
    server->Open("r2", 9, "annex", T_lab_annex.Inverse());
    server->Drive("r2", 9, 0, kScans);
    ASSERT_TRUE(Stored(*server.operator->(), "r2", kScans));
    ASSERT_EQ(Smooth(*server.operator->(), "annex").state, JobState::kSucceeded);
  }
  {
    const auto store = *OpenStore(directory / "0");
    const auto merged = MergeSites(*store, "lab", "annex", T_lab_annex);
    ASSERT_TRUE(merged) << merged.error().message;
  }
  StoredServer server(directory / "0");
  WholeServer& house = *server.operator->();
  EXPECT_EQ(house.Ask(AboutSite(RequestKind::kMapInfo, "annex")).status.code, StatusCode::kNotFound);
  ASSERT_TRUE(WaitDrawn(house));
  View view = ViewOf(house);
  for (const char* robot : {"r1", "r2"}) {
    EXPECT_EQ(view.used[robot], static_cast<std::uint64_t>(kScans)) << robot;
    ASSERT_EQ(view.paths[robot].size(), static_cast<std::size_t>(kScans)) << robot;
    for (int step = 0; step < kScans; ++step) {
      const Pose2& pose = view.paths[robot][static_cast<std::size_t>(step)].T_map_robot;
      EXPECT_LT((pose.translation() - TruePose(step).translation()).norm(), 0.1) << robot << " " << step;
    }
  }
  // The wall at x = 6 m is where it was, and nothing is 0.4 m behind it.
  const auto occupancy = [&view](double x_m, double y_m) {
    const int x = static_cast<int>(std::floor(x_m / 0.05)), y = static_cast<int>(std::floor(y_m / 0.05));
    const auto tile = view.tiles.find({0, FloorDiv(x, kTileCells), FloorDiv(y, kTileCells)});
    if (tile == view.tiles.end()) return int{kUnknownCell};
    const int column = x - kTileCells * tile->first.x, row = y - kTileCells * tile->first.y;
    return int{tile->second[static_cast<std::size_t>(row * kTileCells + column)]};
  };
  int wall = 0, behind = 0;
  for (double y = -1.0; y < 1.0; y += 0.05) {
    int most = 0;
    for (const double x : {5.95, 6.0, 6.05}) {
      const int here = occupancy(x, y);
      if (here != kUnknownCell) most = std::max(most, here);
    }
    wall += most > 65 ? 1 : 0;
    const int there = occupancy(6.4, y);
    behind += there != kUnknownCell && there > 65 ? 1 : 0;
  }
  EXPECT_GE(wall, 30);
  EXPECT_EQ(behind, 0);
  const Job job = Smooth(house);
  EXPECT_EQ(job.state, JobState::kSucceeded);
  EXPECT_THAT(job.message, HasSubstr("2 robots"));
  // And back to the map before the job, with the grids of both.
  Request back = AboutSite(RequestKind::kMapEnable);
  back.map_version = 1;
  EXPECT_TRUE(house.Ask(back).status.ok());
}

// A site of every version of the format loads for ever (tests/golden/README.md says how each was made).
TEST(SavedSites, TheGoldenFileOfEveryVersionLoads) {
  const char* const source = std::getenv("CAIRN_SOURCE_DIR");
  ASSERT_NE(source, nullptr);
  for (const char* const name : {"site-v1.site", "site-v1-records-2.site", "site-v2.site"}) {
    SCOPED_TRACE(name);
    const TempDirectory directory;
    std::filesystem::create_directories(directory / "0" / "saved");
    const auto golden = std::filesystem::path(source) / "tests" / "golden" / name;
    ASSERT_TRUE(std::filesystem::copy_file(golden, directory / "0" / "saved" / "golden.site")) << golden;
    StoredServer server(directory / "0");
    WholeServer& house = *server.operator->();
    const Reply loaded = house.Ask(AboutFile(RequestKind::kSiteLoad, "lab", "golden"));
    ASSERT_TRUE(loaded.status.ok()) << loaded.status.message;
    ASSERT_TRUE(WaitDrawn(house));
    View view = ViewOf(house);
    EXPECT_EQ(view.used, (std::map<std::string, std::uint64_t>{{"robot1", 40U}, {"robot2", 40U}}));
    EXPECT_EQ(view.paths["robot1"].size(), 40U);
    EXPECT_EQ(view.smoothed["robot2"].size(), 40U);
    EXPECT_EQ(view.enabled, 2U);
    EXPECT_THAT(view.notes, ::testing::ElementsAre("live", HasSubstr("smoothed: 2 robots")));
    EXPECT_GE(view.tiles.size(), 8U);
    EXPECT_EQ(house.Ask(AboutSite(RequestKind::kJobList)).jobs.at(0).state, JobState::kSucceeded);
    EXPECT_EQ(Smooth(house).state, JobState::kSucceeded);
  }
}

}  // namespace
}  // namespace cairn::server::testing
