#include "server/jobs/lost_robots.h"

#include <chrono>
#include <string>

#include "tests/server/robots/roster_fixture.h"

namespace cairn::server {
namespace {

using std::chrono::seconds;
using testing::RequestOf;

// r1 has begun the map, and its pose is what the test says.
class LostRobotsTest : public testing::RosterTest {
 protected:
  LostRobotsTest() { roster().Take(RequestOf("r1", testing::kOwner)); }

  void Report(const std::string& robot, PoseReason reason, SessionToken token = testing::kOwner) {
    PoseReport pose;
    pose.stamp = ++stamp_;
    pose.scan_sequence = static_cast<std::uint64_t>(stamp_);
    pose.localized = reason == PoseReason::kTracking;
    pose.reason = reason;
    const StreamId stream{HashName(robot), HashName("laser"), token};
    SessionRecord& record = roster().Find(robot)->record();
    EXPECT_EQ(record.ScanReceived(stream, pose.scan_sequence), SessionRecord::Arrival::kNew);
    record.ScanUsed(stream, pose, pose.stamp, true, 1.0);
  }
  std::size_t JobsAfter(seconds since_begin) {
    lost_.Tick(begin_ + since_begin);
    return jobs_.OfSite({}).size();
  }
  void EndAll() {
    for (const Job& job : jobs_.OfSite({})) {
      if (!IsFinal(job.state)) jobs_.Fail(job.id, {StatusCode::kCancelled, "cancelled"});
    }
  }

  Stamp stamp_ = 0;
  JobsOptions options_;
  JobList jobs_{options_, outbound_, [] { return Stamp{0}; }};
  JobWorker worker_{options_, jobs_, [](const Job&, bool, const JobControl&) { return JobOutcome{}; }};
  LostRobots lost_{options_, roster(), jobs_, worker_};
  const LostRobots::Clock::time_point begin_ = LostRobots::Clock::now();
};

TEST_F(LostRobotsTest, HasARobotLookedForThatIsLostForSomeTimeAndAgainLater) {
  Report("r1", PoseReason::kLost);
  EXPECT_EQ(JobsAfter(seconds(0)), 0U);
  EXPECT_EQ(JobsAfter(seconds(9)), 0U);
  ASSERT_EQ(JobsAfter(seconds(10)), 1U);
  const Job job = jobs_.OfSite("lab").front();
  EXPECT_EQ(job.kind, JobKind::kRelocalise);
  EXPECT_EQ(job.robot, "r1");
  EndAll();
  EXPECT_EQ(JobsAfter(seconds(29)), 1U);
  EXPECT_EQ(JobsAfter(seconds(30)), 2U);
}

TEST_F(LostRobotsTest, ARobotThatWasFoundMeanwhileIsNotLookedFor) {
  Report("r1", PoseReason::kLost);
  EXPECT_EQ(JobsAfter(seconds(0)), 0U);
  Report("r1", PoseReason::kTracking);
  EXPECT_EQ(JobsAfter(seconds(5)), 0U);
  Report("r1", PoseReason::kLost);
  EXPECT_EQ(JobsAfter(seconds(10)), 0U) << "it is lost anew";
  EXPECT_EQ(JobsAfter(seconds(20)), 1U);
}

// Jobs that take minutes, of its site and of others, do not keep it waiting.
TEST_F(LostRobotsTest, IsLookedForWhileOtherJobsRun) {
  Report("r1", PoseReason::kLost);
  for (const char* const site : {"lab", "hall"}) {
    const auto job = jobs_.Add(site, JobKind::kSmooth);
    ASSERT_TRUE(job);
    ASSERT_TRUE(jobs_.Start(job->id));
  }
  EXPECT_EQ(JobsAfter(seconds(0)), 2U);
  EXPECT_EQ(JobsAfter(seconds(10)), 3U);
  EXPECT_EQ(JobsAfter(seconds(31)), 3U) << "it is looked for already";
}

TEST_F(LostRobotsTest, OnlyOneJobLooksForRobotsAndOfTheseTheOneFirstThatHasWaitedLongest) {
  const auto looked_for = [this] {
    for (const Job& job : jobs_.OfSite({}))
      if (!IsFinal(job.state)) return job.robot;
    return std::string("nobody");
  };
  roster().Take(RequestOf("r2", 8));
  roster().Find("r2")->record().SetJoining({});
  Report("r2", PoseReason::kLost, 8);
  EXPECT_EQ(JobsAfter(seconds(0)), 0U);
  Report("r1", PoseReason::kLost);
  EXPECT_EQ(JobsAfter(seconds(5)), 0U);
  EXPECT_EQ(JobsAfter(seconds(16)), 1U);
  EXPECT_EQ(looked_for(), "r2");
  EXPECT_EQ(JobsAfter(seconds(17)), 1U);
  EndAll();
  EXPECT_EQ(JobsAfter(seconds(18)), 2U);
  EXPECT_EQ(looked_for(), "r1");
}

TEST_F(LostRobotsTest, WhereAPersonHasSaidWhereItIsItIsNotLookedFor) {
  Report("r1", PoseReason::kLost);
  ASSERT_TRUE(jobs_.Add("lab", JobKind::kRelocalise, true, {"r1", {PoseHypothesis{}}}));
  EXPECT_EQ(JobsAfter(seconds(0)), 1U);
  EXPECT_EQ(JobsAfter(seconds(20)), 1U);
  EndAll();
  EXPECT_EQ(JobsAfter(seconds(21)), 2U);
}

TEST_F(LostRobotsTest, ThoseThatAreNotJoinedOrOnlyLocalisedAreLeftAlone) {
  Report("r1", PoseReason::kLost);
  SessionRecord& record = roster().Find("r1")->record();
  record.SetJoining({.fragment = true});
  EXPECT_EQ(JobsAfter(seconds(0)), 0U);
  EXPECT_EQ(JobsAfter(seconds(20)), 0U);
  record.SetJoining({});
  record.SetLocalises(true);
  EXPECT_EQ(JobsAfter(seconds(40)), 0U);
  EXPECT_EQ(JobsAfter(seconds(60)), 0U);
  record.SetLocalises(false);
  EXPECT_EQ(JobsAfter(seconds(80)), 0U);
  EXPECT_EQ(JobsAfter(seconds(90)), 1U);
}

TEST_F(LostRobotsTest, DoesNothingWhereItIsSwitchedOff) {
  Report("r1", PoseReason::kLost);
  JobsOptions off = options_;
  off.relocalise_after_s = 0.0;
  LostRobots none(off, roster(), jobs_, worker_);
  none.Tick(begin_);
  none.Tick(begin_ + seconds(1000));
  EXPECT_TRUE(jobs_.OfSite({}).empty());
}

}  // namespace
}  // namespace cairn::server
