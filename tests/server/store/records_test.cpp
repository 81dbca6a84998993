#include "server/store/records.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/server/store/sample_entries.h"

namespace cairn::server {
namespace {

using testing::OneOfEach;
using testing::SampleGrid;
using testing::SampleSession;

TEST(Records, AJournalComesBackWithTheSameBytes) {
  const std::vector<JournalEntry> entries = OneOfEach();
  const std::string bytes = BytesOf(41, entries);
  const auto batch = BatchOf(bytes);
  ASSERT_TRUE(batch) << batch.error().message;
  EXPECT_EQ(batch->first, 41U);
  ASSERT_EQ(batch->entries.size(), entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) EXPECT_EQ(batch->entries[i].index(), entries[i].index());
  EXPECT_EQ(BytesOf(41, batch->entries), bytes);
}

TEST(Records, EveryFieldOfAScanAndOfOdometryIsKept) {
  const auto batch = BatchOf(BytesOf(1, {testing::SampleScan(8), testing::SampleOdometry(9)}));
  ASSERT_TRUE(batch);
  const ScanTaken wanted = testing::SampleScan(8);
  const auto& got = std::get<ScanTaken>(batch->entries[0]);
  EXPECT_EQ(got.stream.robot_id, wanted.stream.robot_id);
  EXPECT_EQ(got.stream.sensor_id, wanted.stream.sensor_id);
  EXPECT_EQ(got.scan->sequence, 8U);
  EXPECT_EQ(got.scan->stamp, wanted.scan->stamp);
  EXPECT_EQ(got.scan->angle_first_rad, wanted.scan->angle_first_rad);
  EXPECT_EQ(got.scan->angle_step_rad, wanted.scan->angle_step_rad);
  EXPECT_EQ(got.scan->range_min_m, wanted.scan->range_min_m);
  EXPECT_EQ(got.scan->range_max_m, wanted.scan->range_max_m);
  EXPECT_EQ(got.scan->beam_period_s, wanted.scan->beam_period_s);
  EXPECT_EQ(got.scan->tilt_rad, wanted.scan->tilt_rad);
  EXPECT_EQ(got.scan->T_robot_laser.theta, 0.3);
  ASSERT_EQ(got.scan->ranges_m.size(), wanted.scan->ranges_m.size());
  EXPECT_EQ(std::memcmp(got.scan->ranges_m.data(), wanted.scan->ranges_m.data(), 4 * got.scan->ranges_m.size()), 0);
  const auto& odometry = std::get<OdometryTaken>(batch->entries[1]).odometry;
  EXPECT_EQ(odometry.sequence, 9U);
  EXPECT_EQ(odometry.T_odom_robot.x, 1.0);
  EXPECT_TRUE(std::signbit(odometry.T_odom_robot.y));
}

TEST(Records, SessionsSitesVersionsLayersAndJobsComeBack) {
  const auto session = SessionOf(BytesOf(SampleSession(5)));
  ASSERT_TRUE(session);
  EXPECT_EQ(session->request.robot, "r5");
  EXPECT_EQ(session->request.T_map_robot_start.y, 2.0);
  EXPECT_EQ(session->map_epoch, 3U);
  EXPECT_FALSE(session->fragment);
  StoredSession apart = SampleSession(5);
  apart.fragment = true;
  EXPECT_TRUE(SessionOf(BytesOf(apart))->fragment);

  const StoredSite site = testing::SampleSiteRecord();
  const auto site_back = SiteOf(BytesOf(site));
  ASSERT_TRUE(site_back);
  EXPECT_EQ(site_back->switches, site.switches);
  EXPECT_EQ(site_back->members, site.members);
  EXPECT_EQ(site_back->tile_version, 90U);
  EXPECT_EQ(site_back->fragments, site.fragments);
  EXPECT_EQ(site_back->past, site.past);
  EXPECT_EQ(site_back->kept_apart, site.kept_apart);
  EXPECT_EQ(site_back->edits, site.edits);
  EXPECT_EQ(site_back->edits_version, 5U);
  EXPECT_EQ(site_back->anchors, site.anchors);
  EXPECT_EQ(site_back->given_up.versions, 3U);
  EXPECT_EQ(site_back->given_up.layers, 2U);
  EXPECT_EQ(site_back->given_up.sessions, 1U);

  StoredVersion version{.version = 3, .job = 8, .note = "smoothed", .parts = {{5, SampleGrid(1)}}, .smoothed = {}};
  version.smoothed["r5"] = {5, std::make_shared<const Trajectory>(Trajectory{{10, {1, 2, 3}}, {20, {4, 5, 6}}})};
  const auto version_back = VersionOf(BytesOf(version));
  ASSERT_TRUE(version_back);
  EXPECT_EQ(version_back->note, "smoothed");
  EXPECT_EQ(version_back->parts.at(5).keyframes, 12U);
  EXPECT_EQ(version_back->parts.at(5).chunks.at(1).cells.get()[5], 2);
  EXPECT_EQ(version_back->smoothed.at("r5").session, 5U);
  EXPECT_EQ(version_back->smoothed.at("r5").path->at(1).T_map_robot.y, 5.0);

  const auto layer = LayerOf(BytesOf(StoredLayer{6, SampleGrid(2)}));
  ASSERT_TRUE(layer);
  EXPECT_EQ(layer->session, 6U);
  EXPECT_EQ(layer->grid.chunks.size(), 2U);
  EXPECT_FALSE(layer->grid.fragment);
  StoredLayer apart_layer{6, SampleGrid(2)};
  apart_layer.grid.fragment = true;
  EXPECT_TRUE(LayerOf(BytesOf(apart_layer))->grid.fragment);

  // A path of all keyframes, and one from which some are missing.
  StoredGrid whole = SampleGrid(2);
  whole.path = std::make_shared<const std::vector<Pose2>>(12, Pose2{1.0, 2.0, 0.5});
  const StoredGrid whole_back = LayerOf(BytesOf(StoredLayer{6, whole}))->grid;
  EXPECT_EQ(*whole_back.path, *whole.path);
  EXPECT_EQ(whole_back.numbers, nullptr);
  StoredGrid thinned = SampleGrid(2);
  thinned.path = std::make_shared<const std::vector<Pose2>>(3, Pose2{1.0, 2.0, 0.5});
  thinned.numbers = std::make_shared<const std::vector<std::uint64_t>>(std::vector<std::uint64_t>{0, 7, 11});
  const StoredGrid thinned_back = LayerOf(BytesOf(StoredLayer{6, thinned}))->grid;
  ASSERT_NE(thinned_back.numbers, nullptr);
  EXPECT_EQ(*thinned_back.numbers, *thinned.numbers);
  EXPECT_EQ(thinned_back.path->size(), 3U);
  EXPECT_EQ(thinned_back.drawn, nullptr);
  for (StoredGrid* const grid : {&whole, &thinned}) {
    std::vector<Pose2> drawn = *grid->path;
    drawn[1].x += 0.5;
    grid->drawn = std::make_shared<const std::vector<Pose2>>(drawn);
    EXPECT_EQ(*LayerOf(BytesOf(StoredLayer{6, *grid}))->grid.drawn, drawn);
    drawn[2].y = std::nan("");
    grid->drawn = std::make_shared<const std::vector<Pose2>>(drawn);
    EXPECT_FALSE(LayerOf(BytesOf(StoredLayer{6, *grid})));
    grid->drawn = std::make_shared<const std::vector<Pose2>>(2);
    EXPECT_FALSE(LayerOf(BytesOf(StoredLayer{6, *grid})));
  }

  StoredJob job;
  job.job.id = 4;
  job.job.site = "lab";
  job.job.state = JobState::kRunning;
  job.job.progress = 0.5;
  job.job.message = "m";
  job.enable = false;
  const auto job_back = JobOf(BytesOf(job));
  ASSERT_TRUE(job_back);
  EXPECT_EQ(job_back->job.state, JobState::kRunning);
  EXPECT_FALSE(job_back->enable);
  job.job.kind = JobKind::kRelocalise;
  job.job.robot = "r5";
  job.job.places = {{7, {1.0, 2.0, 0.5}, 0.75}, {7, {3.0, 2.0, 0.5}, 0.25}};
  const auto looks_back = JobOf(BytesOf(job));
  ASSERT_TRUE(looks_back);
  EXPECT_EQ(looks_back->job.kind, JobKind::kRelocalise);
  EXPECT_EQ(looks_back->job.robot, "r5");
  ASSERT_EQ(looks_back->job.places.size(), 2U);
  EXPECT_EQ(looks_back->job.places[1].stamp, 7);
  EXPECT_EQ(looks_back->job.places[1].T_map_robot, (Pose2{3.0, 2.0, 0.5}));
  EXPECT_EQ(looks_back->job.places[1].weight, 0.25);
  job.job.places.resize(kMostHypotheses + 1);
  EXPECT_FALSE(JobOf(BytesOf(job)));
}

// A file may contain anything; the estimator relies on valid scans.
TEST(Records, ValuesThatNoServerWritesAreRefused) {
  auto scan = std::make_shared<Scan>(*testing::SampleScan(1).scan);
  scan->angle_step_rad = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(BatchOf(BytesOf(1, {ScanTaken{testing::SampleStream(), scan}})));
  OdometryTaken odometry = testing::SampleOdometry(1);
  odometry.odometry.T_odom_robot.x = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(BatchOf(BytesOf(1, {odometry})));
  for (const std::vector<std::uint64_t>& numbers :
       {std::vector<std::uint64_t>{0, 7, 7}, {0, 7, 12}, {7, 0, 11}, {0, 7}, {0, 3, 7, 11}}) {
    StoredGrid grid = SampleGrid(2);
    grid.path = std::make_shared<const std::vector<Pose2>>(3, Pose2{1.0, 2.0, 0.5});
    grid.numbers = std::make_shared<const std::vector<std::uint64_t>>(numbers);
    EXPECT_FALSE(LayerOf(BytesOf(StoredLayer{6, grid})));
  }
  StoredSession nameless = SampleSession(1);
  nameless.request.robot = "a/b";
  EXPECT_FALSE(SessionOf(BytesOf(nameless)));
  StoredSite impossible;
  impossible.name = "lab";
  impossible.enabled_version = impossible.next_version;
  EXPECT_FALSE(SiteOf(BytesOf(impossible)));
  for (const auto& spoil : std::vector<std::function<void(std::vector<MapEdit>&)>>{
           [](auto& edits) { edits[0].id = 0; }, [](auto& edits) { edits[0].id = 6; },
           [](auto& edits) { edits[1].id = 2; }, [](auto& edits) { edits[0].points_map[1].x() = 1e9; },
           [](auto& edits) { edits[0].kind = static_cast<MapEditKind>(kMapEditKindCount); },
           [](auto& edits) { edits[1].points_map.pop_back(); }, [](auto& edits) { edits[0].note = "T\xfcr"; },
           [](auto& edits) { edits[0].note = "\x1b[2J"; }}) {
    StoredSite edited = testing::SampleSiteRecord();
    EXPECT_TRUE(SiteOf(BytesOf(edited)));
    spoil(edited.edits);
    EXPECT_FALSE(SiteOf(BytesOf(edited)));
  }
  for (const auto& spoil : std::vector<std::function<void(EditAnchors&)>>{
           [](auto& anchors) { anchors.points_then.pop_back(); },
           [](auto& anchors) { anchors.points_then[1].y() = std::nan(""); },
           [](auto& anchors) { anchors.keyframes[0].T_map_then.x = std::nan(""); },
           [](auto& anchors) { anchors.keyframes[1].T_map_now.theta = INFINITY; },
           [](auto& anchors) { anchors.keyframes.resize(kMostEditPoints + 1); }}) {
    StoredSite anchored = testing::SampleSiteRecord();
    spoil(anchored.anchors.at(4));
    EXPECT_FALSE(SiteOf(BytesOf(anchored)));
  }
  StoredSite last = testing::SampleSiteRecord();
  last.edits_version = kMaxEditsVersion - last.edits.size() - 1;
  EXPECT_TRUE(SiteOf(BytesOf(last)));
  ++last.edits_version;
  EXPECT_FALSE(SiteOf(BytesOf(last))) << "there are no numbers for the removal of its edits";
  EXPECT_FALSE(VersionOf("\xff\xff\xff"));
  StoredLayer far{6, SampleGrid(1)};
  EXPECT_TRUE(LayerOf(BytesOf(far)));
  far.grid.chunks[1].y = std::numeric_limits<int>::min();  // Its cells have no numbers.
  EXPECT_FALSE(LayerOf(BytesOf(far)));
}

// The estimator follows this path, so it must be one.
TEST(Records, ThePathOfAGridIsOnePoseForEachOfItsKeyframes) {
  const auto with = [](std::vector<Pose2> path) {
    StoredLayer layer{6, SampleGrid(1)};
    layer.grid.path = std::make_shared<const std::vector<Pose2>>(std::move(path));
    return BytesOf(layer);
  };
  std::vector<Pose2> path(12, Pose2{1.0, 2.0, 0.5});
  path.back() = {-3.0, 4.0, -1.5};
  const auto back = LayerOf(with(path));
  ASSERT_TRUE(back && back->grid.path);
  EXPECT_EQ(*back->grid.path, path);
  EXPECT_EQ(LayerOf(BytesOf(StoredLayer{6, SampleGrid(1)}))->grid.path, nullptr);
  EXPECT_FALSE(LayerOf(with(std::vector<Pose2>(11))));
  path[3].x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(LayerOf(with(path)));
  path[3].x = 1e12;
  EXPECT_FALSE(LayerOf(with(path)));
}

}  // namespace
}  // namespace cairn::server
