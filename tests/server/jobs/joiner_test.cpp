#include "server/jobs/joiner.h"

#include <future>
#include <vector>

#include "tests/server/robots/roster_fixture.h"

namespace cairn::server {
namespace {

using testing::RequestOf;

// Robots that have driven as far as the test says; r1 has begun the map.
class JoinerTest : public testing::RosterTest {
 protected:
  JoinerTest() {
    options_.join_way_m = 20.0;
    roster().Take(RequestOf("r1", 7));
    roster().Take(RequestOf("r2", 8));
  }

  void Driven(const std::string& robot, double way_m) {
    SessionRecord& record = roster().Find(robot)->record();
    record.SetJoining({record.joining().fragment, way_m});
  }
  // Whether a job is submitted now. It ends at once.
  bool Tries() {
    joiner_.Tick();
    bool tries = false;
    for (const Job& job : jobs_.OfSite("lab")) {
      if (IsFinal(job.state)) continue;
      tries = true;
      EXPECT_EQ(job.kind, JobKind::kJoin);
      EXPECT_TRUE(jobs_.Start(job.id));
      jobs_.Succeed(job.id, {});
    }
    return tries;
  }

  JobsOptions options_;
  JobList jobs_{options_, outbound_, [] { return Stamp{0}; }};
  JobWorker worker_{options_, jobs_, [](const Job&, bool, const JobControl&) { return JobOutcome{}; }};
  Joiner joiner_{options_, roster(), *atlas_, jobs_, worker_};
};

TEST_F(JoinerTest, TriesWhenBothHaveDrivenFarEnough) {
  Driven("r1", 100.0);
  Driven("r2", 19.0);
  EXPECT_FALSE(Tries());
  Driven("r1", 19.0);
  Driven("r2", 100.0);
  EXPECT_FALSE(Tries());
  Driven("r1", 20.0);
  EXPECT_TRUE(Tries());
}

TEST_F(JoinerTest, TriesAgainWhenEitherHasDrivenATenthMore) {
  Driven("r1", 100.0);
  Driven("r2", 40.0);
  EXPECT_TRUE(Tries());
  EXPECT_FALSE(Tries());
  Driven("r2", 43.0);
  EXPECT_FALSE(Tries());
  Driven("r2", 45.0);
  EXPECT_TRUE(Tries());
  Driven("r1", 109.0);
  EXPECT_FALSE(Tries());
  Driven("r1", 111.0);
  EXPECT_TRUE(Tries());
  EXPECT_FALSE(Tries());
  roster().Take(RequestOf("r3", 9));
  Driven("r3", 20.0);
  EXPECT_TRUE(Tries());
}

TEST_F(JoinerTest, DoesNothingWhileTheSiteHasAJobAndForRobotsWhosePlacesAreKnown) {
  Driven("r1", 100.0);
  Driven("r2", 40.0);
  const auto job = jobs_.Add("lab", JobKind::kSmooth);
  ASSERT_TRUE(job);
  joiner_.Tick();
  EXPECT_EQ(jobs_.OfSite("lab").size(), 1U);
  jobs_.Fail(job->id, {StatusCode::kCancelled, "cancelled"});
  roster().Find("r2")->record().SetJoining({false, 19.0});
  EXPECT_FALSE(Tries());
  roster().Find("r2")->record().SetJoining({true, 40.0});
  EXPECT_TRUE(Tries());
}

// Robots that have said where they start are fitted to each other, too.
TEST_F(JoinerTest, AlignsRobotsWithKnownStartsAndAgainAfterAQuarterMore) {
  roster().Find("r2")->record().SetJoining({false, 0.0});
  Driven("r1", 100.0);
  Driven("r2", 19.0);
  EXPECT_FALSE(Tries());
  Driven("r2", 20.0);
  EXPECT_TRUE(Tries());
  EXPECT_FALSE(Tries());
  Driven("r1", 129.0);
  EXPECT_FALSE(Tries());
  Driven("r1", 130.0);
  EXPECT_TRUE(Tries());
  roster().Take(RequestOf("r3", 9));
  roster().Find("r3")->record().SetJoining({false, 21.0});
  EXPECT_TRUE(Tries()) << "one more has driven far enough";
}

// After months a quarter of all that was driven would be weeks.
TEST_F(JoinerTest, TwoHundredMetresOfARobotOfTodayAreEnoughHoweverFarOthersHaveDriven) {
  roster().Find("r2")->record().SetJoining({false, 20.0});
  Driven("r1", 100000.0);
  EXPECT_TRUE(Tries());
  Driven("r2", 219.0);
  EXPECT_FALSE(Tries());
  Driven("r2", 220.0);
  EXPECT_TRUE(Tries());
  EXPECT_FALSE(Tries());
  Driven("r1", 100201.0);
  EXPECT_TRUE(Tries()) << "any robot of today";
  roster().Take(RequestOf("r3", 9));
  Driven("r3", 5000.0);
  EXPECT_TRUE(Tries()) << "a fragment";
  Driven("r3", 5199.0);
  EXPECT_FALSE(Tries());
  Driven("r3", 5200.0);
  EXPECT_TRUE(Tries());
  EXPECT_FALSE(Tries());
  Driven("r2", 421.0);
  EXPECT_TRUE(Tries()) << "it may be where the fragment has been";
}

TEST_F(JoinerTest, AlignsNothingWhereItIsSwitchedOffOrAPersonHasChosenTheMap) {
  roster().Find("r2")->record().SetJoining({false, 40.0});
  Driven("r1", 100.0);
  JobsOptions off = options_;
  off.align = false;
  Joiner(off, roster(), *atlas_, jobs_, worker_).Tick();
  EXPECT_TRUE(jobs_.OfSite("lab").empty());
  std::promise<void> chosen;
  atlas_->Find("lab")->Enable(1, [&chosen](const Result<std::uint32_t>&) { chosen.set_value(); });
  chosen.get_future().wait();
  EXPECT_FALSE(Tries());
}

TEST_F(JoinerTest, DoesNothingWhereItIsSwitchedOff) {
  Driven("r1", 100.0);
  Driven("r2", 40.0);
  for (bool JobsOptions::*const flag : {&JobsOptions::join, &JobsOptions::joint}) {
    JobsOptions off = options_;
    off.*flag = false;
    Joiner(off, roster(), *atlas_, jobs_, worker_).Tick();
    EXPECT_TRUE(jobs_.OfSite("lab").empty());
  }
}

}  // namespace
}  // namespace cairn::server
