#include "server/slam/site/session_map.h"

#include <gtest/gtest.h>

#include <memory>

#include "tests/server/slam/site/site_drives.h"

namespace cairn::slam {
namespace {

constexpr double kAroundM = 7.0;

// A robot that has driven a ring of 112 m and a third of it again.
struct LongSession : ::testing::Test {
  LongSession() {
    const auto drive = test::DriveThrough(test::RingCorridor(false), {}, test::RingSteps(150.0, 0.4), {}, 1, 0.0);
    MapperOptions options;
    options.recovery.place.map_reach_m = 25.0;  // As if everything was twelve times as large.
    map = std::make_unique<SessionMap>(1, drive.snapshot, drive.truth, SiteOptionsOf(options));
  }

  std::unique_ptr<SessionMap> map;
};

TEST_F(LongSession, KnowsItsOwnPlacesHoweverFarFromItsEndTheyAre) {
  const auto scans = map->ScansAround(map->NearestTo({0.0, 18.0, -kPi / 2}), kAroundM);
  EXPECT_GT(map->ScoreAt(scans, scans.back().T_track_robot), 0.7);
}

}  // namespace
}  // namespace cairn::slam
