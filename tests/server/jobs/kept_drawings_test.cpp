#include "server/jobs/kept_drawings.h"

#include <gtest/gtest.h>

#include "server/jobs/smooth_job.h"
#include "tests/server/support/room_world.h"

namespace cairn::server {
namespace {

const std::vector<std::uint64_t> kDrivers{3, 8};
constexpr std::size_t kChunkBytes = sizeof(slam::GridChunk);

std::shared_ptr<const slam::DrawnMap> WithOneChunk() {
  auto drawn = std::make_shared<slam::DrawnMap>();
  drawn->chunks[{0, 0}] = std::make_shared<const slam::GridChunk>();
  return drawn;
}

void DrawInJob(KeptDrawings& kept, const std::string& site, std::uint64_t session) {
  kept.Open(site)[session].online = WithOneChunk();
  kept.Close(site, kDrivers, [](const std::string&) { return true; });
}

TEST(KeptDrawings, AreThoseOfSessionsAndSitesThatThereAre) {
  KeptDrawings kept;
  DrawInJob(kept, "lab", 3);
  DrawInJob(kept, "lab", 8);
  DrawInJob(kept, "hall", 3);
  EXPECT_EQ(kept.Bytes(), 3 * kChunkBytes);
  EXPECT_EQ(kept.Open("lab").size(), 2U);
  kept.Close("lab", {8}, [](const std::string& site) { return site == "lab"; });
  EXPECT_EQ(kept.Bytes(), kChunkBytes);
  EXPECT_TRUE(kept.Open("lab").contains(8));
}

TEST(KeptDrawings, ThoseOfTheSiteWhoseLastJobIsTheLongestAgoGoFirst) {
  KeptDrawings kept(2 * kChunkBytes);
  DrawInJob(kept, "lab", 3);
  DrawInJob(kept, "hall", 3);
  DrawInJob(kept, "lab", 3);
  DrawInJob(kept, "yard", 3);
  EXPECT_EQ(kept.Bytes(), 2 * kChunkBytes);
  EXPECT_TRUE(kept.Open("hall").empty());
  EXPECT_FALSE(kept.Open("lab").empty());
  EXPECT_FALSE(kept.Open("yard").empty());
}

TEST(KeptDrawings, ASiteThatIsTooLargeAloneIsNotKept) {
  KeptDrawings kept(kChunkBytes);
  kept.Open("lab")[3] = {.online = WithOneChunk(), .smoothed = WithOneChunk()};
  kept.Close("lab", kDrivers, [](const std::string&) { return true; });
  EXPECT_EQ(kept.Bytes(), 0U);
}

TEST(KeptDrawings, ADrawingThatIsBothCountsOnce) {
  slam::DrawnMaps drawn{.online = WithOneChunk(), .smoothed = nullptr};
  drawn.smoothed = drawn.online;
  EXPECT_EQ(drawn.Bytes(), kChunkBytes);
}

// A second job, before which a robot has driven a little on, shares the chunks with the first one's version that the
// new scans have not reached.
TEST(KeptDrawings, ASecondJobDrawsWhatIsNew) {
  constexpr int kKeyframes = 20, kNew = 2;
  const auto material_of = [](int keyframes) {
    SessionMaterial material{.session = 5, .robot = "r1", .snapshot = {}, .grid_options = {}};
    material.grid_options.resolution_m = 0.02;
    material.grid_options.max_ray_m = 2.0;
    for (int k = 0; k < keyframes; ++k) {
      const Pose2 pose = testing::TruePose(4 * k);
      material.snapshot.keyframes.push_back({std::make_shared<const Scan>(testing::RoomScan(4 * k)), pose});
      material.snapshot.online_path.push_back(pose);
      material.snapshot.full_path.push_back(pose);
    }
    return material;
  };
  Job job;
  job.site = "lab";
  const JobControl control{[](double) {}};
  KeptDrawings::OfSite drawings;
  const auto run = [&](int keyframes, KeptDrawings::OfSite* kept) {
    return SmoothSite(job, {material_of(keyframes)}, nullptr, control, nullptr, false, kept);
  };
  const auto first = run(kKeyframes - kNew, &drawings);
  const auto second = run(kKeyframes, &drawings);
  const auto anew = run(kKeyframes, nullptr);
  ASSERT_TRUE(first && second && anew);
  EXPECT_EQ(drawings.at(5).smoothed->drawn_anew, static_cast<std::size_t>(kNew));
  EXPECT_EQ(second->outcome.cost_before, anew->outcome.cost_before);
  EXPECT_EQ(second->outcome.cost_after, anew->outcome.cost_after);
  const auto& chunks = second->version->parts.at(5).chunks;
  ASSERT_EQ(chunks.size(), anew->version->parts.at(5).chunks.size());
  std::size_t shared = 0;
  for (const auto& [key, chunk] : chunks) {
    EXPECT_TRUE(chunk->log_odds == anew->version->parts.at(5).chunks.at(key)->log_odds);
    const auto& before = first->version->parts.at(5).chunks;
    if (before.contains(key) && before.at(key) == chunk) ++shared;
  }
  EXPECT_GT(shared, 0U);
}

}  // namespace
}  // namespace cairn::server
