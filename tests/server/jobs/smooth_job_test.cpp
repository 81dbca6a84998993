#include "server/jobs/smooth_job.h"

#include <gtest/gtest.h>

#include "tests/server/support/room_world.h"

namespace cairn::server {
namespace {

using testing::RoomScan;
using testing::TruePose;

constexpr int kKeyframes = 20;

// A robot whose online path went wrong by 0.15 m half way and whose full path is right.
SessionMaterial Material() {
  SessionMaterial material{.session = 5, .robot = "r1", .snapshot = {}, .grid_options = {}};
  for (int k = 0; k < kKeyframes; ++k) {
    Pose2 online = TruePose(4 * k);
    if (k > kKeyframes / 2) online.x += 0.15;
    material.snapshot.keyframes.push_back({std::make_shared<const Scan>(RoomScan(4 * k)), TruePose(4 * k)});
    material.snapshot.online_path.push_back(online);
    material.snapshot.full_path.push_back(TruePose(4 * k));
    material.snapshot.scans.push_back({RoomScan(4 * k).stamp, static_cast<std::size_t>(k), {}});
  }
  return material;
}

class SmoothSiteTest : public ::testing::Test {
 protected:
  std::vector<double> progress_;
  JobControl control_{[this](double progress) { progress_.push_back(progress); }};
  Job job_ = [] {
    Job job;
    job.id = 9;
    job.site = "lab";
    return job;
  }();
};

TEST_F(SmoothSiteTest, RedrawsTheMapAlongTheFullPathAndSaysHowMuchBetterItFits) {
  const auto smoothed = SmoothSite(job_, {Material()}, control_);
  ASSERT_TRUE(smoothed);
  EXPECT_LT(smoothed->outcome.cost_after, smoothed->outcome.cost_before);
  EXPECT_EQ(smoothed->version.info.job, 9U);
  slam::OccupancyGrid expected{slam::GridOptions{}};
  for (int k = 0; k < kKeyframes; ++k) expected.Draw(RoomScan(4 * k), TruePose(4 * k));
  const RobotGrid& part = smoothed->version.parts.at(5);
  ASSERT_EQ(part.chunks.size(), expected.chunk_count());
  expected.ForEachChunk([&](const slam::ChunkKey& key, const slam::GridChunk& chunk) {
    EXPECT_EQ(part.chunks.at(key)->log_odds, chunk.log_odds);
  });
  EXPECT_EQ(part.keyframes, static_cast<std::size_t>(kKeyframes));
  EXPECT_EQ(smoothed->version.smoothed.at("r1")->size(), static_cast<std::size_t>(kKeyframes));
}

TEST_F(SmoothSiteTest, ProgressGoesFromNothingToAll) {
  ASSERT_TRUE(SmoothSite(job_, {Material()}, control_));
  ASSERT_EQ(progress_.size(), 4U * kKeyframes);
  EXPECT_TRUE(std::is_sorted(progress_.begin(), progress_.end()));
  EXPECT_EQ(progress_.front(), 0.0);
  EXPECT_GT(progress_.back(), 0.95);
}

TEST_F(SmoothSiteTest, CancellingEndsItAtTheNextStep) {
  control_.Cancel();
  const auto smoothed = SmoothSite(job_, {Material()}, control_);
  ASSERT_FALSE(smoothed);
  EXPECT_EQ(smoothed.error().code, StatusCode::kCancelled);
  EXPECT_EQ(progress_.size(), 1U);
}

TEST_F(SmoothSiteTest, ASiteWithoutScansFailsWithAReason) {
  EXPECT_EQ(SmoothSite(job_, {}, control_).error().code, StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace cairn::server
