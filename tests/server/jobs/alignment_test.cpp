#include "server/jobs/alignment.h"

#include <gtest/gtest.h>

#include "server/jobs/smooth_job.h"
#include "tests/server/slam/site/site_drives.h"

namespace cairn::server {
namespace {

// Two robots that said where they start; the second one's start was wrong by 0.2 m.
TEST(Alignment, RobotsWithKnownStartsAreFittedToEachOtherOnlyWhereThatIsBetter) {
  const slam::test::World world = slam::test::RingCorridor(true);
  const auto material_of = [&](SessionId session, double from_m, const Pose2& T_own_start) {
    return SessionMaterial{.session = session,
                           .robot = "r" + std::to_string(session),
                           .snapshot = slam::test::DriveRing(world, from_m, 40.0, T_own_start, session).snapshot,
                           .grid_options = {}};
  };
  std::vector<SessionMaterial> material{material_of(1, 0.0, {}), material_of(2, 8.0, {8.15, 0.15, 0.0})};
  const slam::SiteOptions options = SiteOptionsOf(slam::MapperOptions{});
  Job job;
  job.id = 9;
  job.site = "lab";
  job.kind = JobKind::kJoin;
  const JobControl control([](double) {});
  EXPECT_FALSE(SmoothSite(job, material, &options, control)->version) << "it was not asked to";
  slam::RelationBook book;
  const auto first = SmoothSite(job, material, &options, control, &book, true);
  ASSERT_TRUE(first && first->version) << first->outcome.message;
  EXPECT_TRUE(first->aligns);
  EXPECT_NE(first->outcome.message.find("; moved by up to"), std::string::npos) << first->outcome.message;
  const std::size_t measured = book.measured();
  EXPECT_GT(measured, 20U);
  // The robots have taken it over: nothing is left to do, and nothing to be measured.
  for (SessionMaterial& one : material)
    one.snapshot.online_path = one.snapshot.full_path = *first->version->parts.at(one.session).path;
  book.BeginJob();
  const auto second = SmoothSite(job, material, &options, control, &book, true);
  ASSERT_TRUE(second);
  EXPECT_FALSE(second->version) << second->outcome.message;
  EXPECT_LT(book.measured(), measured / 10);
}

SessionMaterial WithKeyframes(bool start_known, std::size_t keyframes) {
  SessionMaterial material{.session = 1, .robot = "r", .snapshot = {}, .grid_options = {}, .start_known = start_known};
  material.snapshot.keyframes.resize(keyframes);
  return material;
}

TEST(AlignmentPace, ARobotThatWaitsToBeJoinedComesFirst) {
  AlignmentPace pace;
  const auto due = [&pace](std::size_t known, std::size_t keyframes, bool waits) {
    std::vector<SessionMaterial> material(known, WithKeyframes(true, keyframes));
    for (std::size_t i = 0; i < known; ++i) material[i].session = i + 2;
    if (waits) material.push_back(WithKeyframes(false, 5));
    return pace.IsDue("lab", material);
  };
  EXPECT_FALSE(due(1, 10, true));
  EXPECT_FALSE(due(3, 20, true)) << "two were joined by the last job";
  EXPECT_FALSE(due(3, 39, true));
  EXPECT_TRUE(due(3, 40, true)) << "twice as many as when the last one was joined";
  EXPECT_FALSE(due(3, 41, true));
  EXPECT_TRUE(due(3, 42, false)) << "nobody waits";
  pace.KeepOnly([](const std::string&) { return false; });
  EXPECT_FALSE(due(3, 43, true)) << "another site of this name";
}

// A robot that is never joined must not keep those of today from being aligned for days, however long the past is.
TEST(AlignmentPace, AThousandKeyframesOfOneRobotAreEnough) {
  AlignmentPace pace;
  const auto due = [&pace](std::size_t today) {
    std::vector<SessionMaterial> material{WithKeyframes(true, 50000), WithKeyframes(true, today),
                                          WithKeyframes(false, 5)};
    for (std::size_t i = 0; i < material.size(); ++i) material[i].session = i + 1;
    return pace.IsDue("lab", material);
  };
  EXPECT_FALSE(due(100)) << "joined by the last job";
  EXPECT_FALSE(due(1099));
  EXPECT_TRUE(due(1100));
  EXPECT_FALSE(due(2099));
  EXPECT_TRUE(due(2100));
}

}  // namespace
}  // namespace cairn::server
