#include "server/jobs/job_list.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>

#include "server/jobs/job_worker.h"
#include "tests/eventually.h"

namespace cairn::server {
namespace {

class JobListTest : public ::testing::Test {
 protected:
  JobsOptions options_{.max_kept = 3};
  // What was published since the last call.
  std::vector<Job> TakeSent() {
    std::vector<Job> sent;
    while (auto value = outbound_.lane(Outbound::Lane::kLive).TryPop()) {
      if (const auto* const job = std::get_if<Job>(&*value)) sent.push_back(*job);
      if (const auto* const retired = std::get_if<Retired>(&*value)) retired_.push_back(std::get<Job>(retired->of).id);
    }
    return sent;
  }

  static constexpr std::size_t kLane = 32;
  Outbound outbound_{kLane};
  std::vector<std::uint64_t> retired_;  // Jobs whose key was given back.
  Stamp now_ = 100;
  JobList list_{options_, outbound_, [this] { return now_; }};
};

TEST_F(JobListTest, EveryChangeOfStateIsPublishedWithItsTime) {
  const auto job = list_.Add("lab", JobKind::kSmooth);
  ASSERT_TRUE(job);
  now_ = 200;
  EXPECT_TRUE(list_.Start(job->id));
  now_ = 300;
  list_.Succeed(job->id, {.cost_before = 2.0, .cost_after = 1.0, .map_version = 4, .message = "fine"});
  const std::vector<Job> sent = TakeSent();
  ASSERT_EQ(sent.size(), 3U);
  EXPECT_EQ(sent[0].state, JobState::kQueued);
  EXPECT_EQ(sent[0].submitted, 100);
  EXPECT_EQ(sent[1].state, JobState::kRunning);
  EXPECT_EQ(sent[1].started, 200);
  EXPECT_EQ(sent[2].state, JobState::kSucceeded);
  EXPECT_EQ(sent[2].ended, 300);
  EXPECT_EQ(sent[2].map_version, 4U);
  EXPECT_EQ(sent[2].cost_before, 2.0);
  EXPECT_EQ(sent[2].cost_after, 1.0);
  EXPECT_EQ(sent[2].message, "fine");
  EXPECT_EQ(sent[2].progress, 1.0);
}

// A server looks again and again whether there is something to join.
TEST_F(JobListTest, OfJobsThatHadNothingToJoinTheLastOneOfASiteIsKept) {
  JobList list(JobsOptions{}, outbound_, [this] { return now_; });
  const auto run = [&list](const std::string& site, JobKind kind, std::uint32_t version) {
    const auto job = list.Add(site, kind);
    EXPECT_TRUE(list.Start(job->id));
    list.Succeed(job->id, {.map_version = version, .message = {}});
    return job->id;
  };
  const std::uint64_t joined = run("lab", JobKind::kJoin, 2), elsewhere = run("hall", JobKind::kJoin, 0),
                      asked_for = run("lab", JobKind::kRelocalise, 0), first = run("lab", JobKind::kJoin, 0);
  const std::uint64_t waiting = list.Add("lab", JobKind::kJoin)->id;
  const std::uint64_t last = run("lab", JobKind::kJoin, 0);
  EXPECT_EQ(list.Find(first).error().code, StatusCode::kNotFound);
  for (const std::uint64_t stays : {joined, elsewhere, asked_for, waiting, last})
    EXPECT_TRUE(list.Find(stays)) << stays;
  static_cast<void>(TakeSent());
  EXPECT_EQ(retired_, std::vector<std::uint64_t>{first});
}

TEST_F(JobListTest, NothingChangesAJobThatHasEnded) {
  const auto job = list_.Add("lab", JobKind::kSmooth);
  EXPECT_TRUE(list_.Start(job->id));
  const auto control = list_.ControlOf(job->id);
  control->Progress(0.25);
  list_.Fail(job->id, {StatusCode::kInternal, "no memory"});
  TakeSent();
  list_.Succeed(job->id, {});
  control->Progress(0.75);
  EXPECT_FALSE(list_.Start(job->id));
  EXPECT_EQ(list_.Find(job->id)->state, JobState::kFailed);
  EXPECT_EQ(list_.Find(job->id)->message, "no memory");
  EXPECT_EQ(list_.Find(job->id)->progress, 0.25);
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(JobListTest, TheFirstProgressIsPublishedAtOnce) {
  const auto job = list_.Add("lab", JobKind::kSmooth);
  EXPECT_TRUE(list_.Start(job->id));
  TakeSent();
  list_.ControlOf(job->id)->Progress(0.25);
  const std::vector<Job> sent = TakeSent();
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].progress, 0.25);
}

TEST_F(JobListTest, ProgressOnlyGrowsAndIsThrottled) {
  const auto job = list_.Add("lab", JobKind::kSmooth);
  EXPECT_TRUE(list_.Start(job->id));
  const auto control = list_.ControlOf(job->id);
  TakeSent();
  for (int i = 1; i <= 1000; ++i) control->Progress(i / 1000.0);
  control->Progress(0.5);
  control->Progress(2.0);
  EXPECT_EQ(list_.Find(job->id)->progress, 1.0);
  EXPECT_LT(TakeSent().size(), 20U);
}

TEST_F(JobListTest, AQueuedJobIsCancelledAtOnceARunningOneWhenItLooks) {
  const auto queued = list_.Add("lab", JobKind::kSmooth);
  now_ = 150;
  const auto cancelled = list_.Cancel(queued->id);
  EXPECT_EQ(cancelled->state, JobState::kCancelled);
  EXPECT_EQ(cancelled->ended, 150);
  EXPECT_EQ(cancelled->message, "cancelled before it started");
  EXPECT_FALSE(list_.Start(queued->id));
  EXPECT_EQ(list_.Cancel(queued->id).error().code, StatusCode::kFailedPrecondition);
  const auto running = list_.Add("lab", JobKind::kSmooth);
  EXPECT_TRUE(list_.Start(running->id));
  EXPECT_EQ(list_.Cancel(running->id)->state, JobState::kRunning);
  EXPECT_TRUE(list_.ControlOf(running->id)->cancelled());
  list_.Fail(running->id, {StatusCode::kCancelled, "cancelled"});
  EXPECT_EQ(list_.Find(running->id)->state, JobState::kCancelled);
  EXPECT_EQ(list_.Cancel(999).error().code, StatusCode::kNotFound);
}

TEST_F(JobListTest, ForgetsTheOldestFinishedJobAndRefusesWhenNoneIs) {
  const auto first = list_.Add("lab", JobKind::kSmooth);
  EXPECT_TRUE(list_.Add("lab", JobKind::kSmooth));
  EXPECT_TRUE(list_.Add("hall", JobKind::kSmooth));
  EXPECT_EQ(list_.Add("lab", JobKind::kSmooth).error().code, StatusCode::kResourceExhausted);
  EXPECT_TRUE(list_.Cancel(first->id));
  EXPECT_TRUE(list_.Add("lab", JobKind::kSmooth));
  EXPECT_FALSE(list_.Find(first->id));
  TakeSent();
  EXPECT_EQ(retired_, std::vector<std::uint64_t>{first->id});
  EXPECT_EQ(list_.OfSite("lab").size(), 2U);
  EXPECT_EQ(list_.OfSite("").size(), 3U);
}

TEST_F(JobListTest, OfSeveralFinishedJobsTheOldestIsForgottenFirst) {
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(list_.Add("lab", JobKind::kSmooth));
  ASSERT_TRUE(list_.Cancel(3));
  ASSERT_TRUE(list_.Cancel(2));
  ASSERT_TRUE(list_.Add("lab", JobKind::kSmooth));
  EXPECT_FALSE(list_.Find(2));
  EXPECT_TRUE(list_.Find(3));
}

TEST_F(JobListTest, AJobThatIsForgottenOrWasNeverThereIsNotFound) {
  const auto job = list_.Add("lab", JobKind::kSmooth);
  ASSERT_TRUE(list_.Start(job->id));
  const auto control = list_.ControlOf(job->id);
  list_.Succeed(job->id, {});
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(list_.Add("lab", JobKind::kSmooth));
  TakeSent();
  control->Progress(0.5);  // Of the forgotten job.
  for (const std::uint64_t id : {job->id, std::uint64_t{999}}) {
    EXPECT_FALSE(list_.Start(id));
    list_.Succeed(id, {});
    EXPECT_EQ(list_.Find(id).error().code, StatusCode::kNotFound);
    EXPECT_EQ(list_.Cancel(id).error().code, StatusCode::kNotFound);
    EXPECT_EQ(list_.ControlOf(id), nullptr);
  }
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(JobListTest, KeysThatCouldNotBeGivenBackAreGivenBackLater) {
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(list_.Add("lab", JobKind::kSmooth));
  ASSERT_TRUE(list_.Cancel(1));
  ASSERT_TRUE(list_.Cancel(2));
  TakeSent();
  for (std::size_t i = 0; i < kLane; ++i) ASSERT_TRUE(outbound_.Send(Job{}));
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(list_.Add("lab", JobKind::kSmooth));
  TakeSent();
  EXPECT_TRUE(retired_.empty());
  list_.Tick();
  TakeSent();
  std::sort(retired_.begin(), retired_.end());
  EXPECT_EQ(retired_, (std::vector<std::uint64_t>{1, 2}));
}

TEST_F(JobListTest, ProgressIsPublishedAgainAfterAWhile) {
  const auto job = list_.Add("lab", JobKind::kSmooth);
  ASSERT_TRUE(list_.Start(job->id));
  TakeSent();
  std::size_t published = 0;
  double progress = 0.0;
  EXPECT_TRUE(test::Eventually([&] {
    list_.ControlOf(job->id)->Progress(progress += 1e-6);
    published += TakeSent().size();
    return published == 3;
  }));
}

TEST_F(JobListTest, WhatCouldNotBeSentIsSentLater) {
  for (std::size_t i = 0; i < kLane; ++i) ASSERT_TRUE(outbound_.Send(Job{}));
  const auto job = list_.Add("lab", JobKind::kSmooth);
  EXPECT_EQ(TakeSent().size(), kLane);
  list_.Tick();
  const std::vector<Job> sent = TakeSent();
  ASSERT_EQ(sent.size(), 1U);
  EXPECT_EQ(sent[0].id, job->id);
  list_.Tick();
  EXPECT_TRUE(TakeSent().empty());
}

TEST(JobWorker, RunsOneAfterTheOtherRefusesWhenFullAndStopsByCancelling) {
  JobsOptions options;
  options.max_queued = 1;
  Outbound outbound(32);
  JobList list(options, outbound, [] { return Stamp{0}; });
  BoundedChannel<std::uint64_t> started(8);
  JobWorker worker(options, list, [&](const Job& job, bool, const JobControl& control) {
    EXPECT_TRUE(started.TryPush(std::uint64_t{job.id}));
    while (!control.cancelled()) std::this_thread::yield();
    return Result<JobOutcome>(Fail(StatusCode::kCancelled, "cancelled"));
  });
  worker.Start();
  const auto first = worker.Submit("lab", JobKind::kSmooth, true);
  ASSERT_TRUE(first);
  EXPECT_EQ(started.Pop(), first->id);
  const auto second = worker.Submit("lab", JobKind::kSmooth, true);
  ASSERT_TRUE(second);
  EXPECT_EQ(worker.Submit("lab", JobKind::kSmooth, true).error().code, StatusCode::kResourceExhausted);
  EXPECT_EQ(list.OfSite("lab").back().state, JobState::kFailed) << "a refused job must not look as if it waited";
  EXPECT_TRUE(list.Cancel(first->id));
  EXPECT_EQ(started.Pop(), second->id);
  worker.Stop();
  EXPECT_EQ(list.Find(first->id)->state, JobState::kCancelled);
  EXPECT_EQ(list.Find(second->id)->state, JobState::kCancelled);
}

// A robot that is lost does not wait for a job that takes minutes.
TEST(JobWorker, AJobThatOnlyLooksForARobotRunsBesideOneThatMayChangeAMap) {
  Outbound outbound(32);
  JobList list({}, outbound, [] { return Stamp{0}; });
  BoundedChannel<std::uint64_t> started(8), ended(8);
  JobWorker worker({}, list, [&](const Job& job, bool, const JobControl& control) {
    EXPECT_TRUE(started.TryPush(std::uint64_t{job.id}));
    while (job.kind == JobKind::kSmooth && !control.cancelled()) std::this_thread::yield();
    EXPECT_TRUE(ended.TryPush(std::uint64_t{job.id}));
    return Result<JobOutcome>(JobOutcome{});
  });
  worker.Start();
  const auto smooth = worker.Submit("lab", JobKind::kSmooth, true);
  ASSERT_TRUE(smooth);
  EXPECT_EQ(started.Pop(), smooth->id);
  // This one joins a robot where somebody says that it is, which makes a map version.
  const auto join = worker.Submit("lab", JobKind::kRelocalise, true, "", {"r2", {PoseHypothesis{}}});
  ASSERT_TRUE(join);
  const auto look = worker.Submit("lab", JobKind::kRelocalise, true, "", {"r1"});
  ASSERT_TRUE(look);
  EXPECT_EQ(started.Pop(), look->id);
  EXPECT_EQ(ended.Pop(), look->id);
  EXPECT_EQ(list.Find(smooth->id)->state, JobState::kRunning);
  EXPECT_EQ(list.Find(join->id)->state, JobState::kQueued);
  worker.Stop();
}

TEST(JobWorker, AJobThatWasCancelledWhileItWaitedIsNotRun) {
  Outbound outbound(32);
  JobList list({}, outbound, [] { return Stamp{0}; });
  BoundedChannel<std::uint64_t> ran(8);
  JobWorker worker({}, list, [&](const Job& job, bool, const JobControl&) {
    EXPECT_TRUE(ran.TryPush(std::uint64_t{job.id}));
    return Result<JobOutcome>(JobOutcome{});
  });
  ASSERT_TRUE(worker.Submit("lab", JobKind::kSmooth, true));
  ASSERT_TRUE(worker.Submit("lab", JobKind::kSmooth, true));
  ASSERT_TRUE(list.Cancel(1));
  worker.Start();
  EXPECT_EQ(ran.Pop(), 2U);
  worker.Stop();
}

TEST(JobWorker, PassesOnWhetherToEnableTheResult) {
  Outbound outbound(32);
  JobList list({}, outbound, [] { return Stamp{0}; });
  BoundedChannel<bool> enabled(2);
  JobWorker worker({}, list, [&](const Job&, bool enable, const JobControl&) {
    EXPECT_TRUE(enabled.TryPush(bool{enable}));
    return Result<JobOutcome>(JobOutcome{});
  });
  ASSERT_TRUE(worker.Submit("lab", JobKind::kSmooth, false));
  ASSERT_TRUE(worker.Submit("lab", JobKind::kSmooth, true));
  worker.Start();
  EXPECT_EQ(enabled.Pop(), false);
  EXPECT_EQ(enabled.Pop(), true);
  worker.Stop();
}

TEST(JobWorker, RefusesAJobForWhichTheListHasNoRoomAndEveryJobOnceItHasStopped) {
  const JobsOptions options{.max_queued = 1, .max_kept = 2};
  Outbound outbound(32);
  JobList list(options, outbound, [] { return Stamp{0}; });
  ASSERT_TRUE(list.Add("lab", JobKind::kSmooth));
  ASSERT_TRUE(list.Add("lab", JobKind::kSmooth));
  JobWorker worker(options, list, [](const Job&, bool, const JobControl&) -> Result<JobOutcome> { return {}; });
  const auto refused = worker.Submit("lab", JobKind::kSmooth, true);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("jobs.max_kept"), std::string::npos);
  worker.Stop();
  EXPECT_FALSE(worker.Submit("lab", JobKind::kSmooth, true));
}

TEST(JobWorker, ItsEndCancelsTheRunningJob) {
  Outbound outbound(32);
  JobList list({}, outbound, [] { return Stamp{0}; });
  {
    BoundedChannel<int> started(1);
    JobWorker worker({}, list, [&](const Job&, bool, const JobControl& control) {
      EXPECT_TRUE(started.TryPush(1));
      while (!control.cancelled()) std::this_thread::yield();
      return Result<JobOutcome>(Fail(StatusCode::kCancelled, "cancelled"));
    });
    ASSERT_TRUE(worker.Submit("lab", JobKind::kSmooth, true));
    worker.Start();
    EXPECT_EQ(started.Pop(), 1);
  }
  EXPECT_EQ(list.Find(1)->state, JobState::kCancelled);
}

// The sessions of a server that stops must not wait for a search that cannot be left.
TEST(JobWorker, CancellingDoesNotWaitForAJobThatDoesNotEnd) {
  Outbound outbound(32);
  JobList list({}, outbound, [] { return Stamp{0}; });
  BoundedChannel<bool> started(1), ended(1);
  JobWorker worker({}, list, [&](const Job&, bool, const JobControl& control) {
    EXPECT_TRUE(started.TryPush(true));
    EXPECT_TRUE(ended.Pop());
    EXPECT_TRUE(control.cancelled());
    return Result<JobOutcome>(Fail(StatusCode::kCancelled, "cancelled"));
  });
  ASSERT_TRUE(worker.Submit("lab", JobKind::kRelocalise, true));
  worker.Start();
  EXPECT_TRUE(started.Pop());
  worker.Cancel();
  EXPECT_FALSE(worker.Submit("lab", JobKind::kSmooth, true));
  EXPECT_TRUE(ended.TryPush(true));
  worker.Stop();
  EXPECT_EQ(list.Find(1)->state, JobState::kCancelled);
}

TEST(JobWorker, RunsJobsAtTheConfiguredPriority) {
  JobsOptions options;
  options.nice = 7;
  Outbound outbound(32);
  JobList list(options, outbound, [] { return Stamp{0}; });
  BoundedChannel<int> nice(1);
  JobWorker worker(options, list, [&](const Job&, bool, const JobControl&) {
    EXPECT_TRUE(nice.TryPush(getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()))));
    return Result<JobOutcome>(JobOutcome{});
  });
  const int own = getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()));
  worker.Start();
  ASSERT_TRUE(worker.Submit("lab", JobKind::kSmooth, true));
  EXPECT_EQ(nice.Pop(), std::max(7, own));  // A thread cannot raise a priority that was lowered before.
  EXPECT_EQ(getpriority(PRIO_PROCESS, static_cast<id_t>(gettid())), own);
  worker.Stop();
}

// An exception in a job (no memory, a bug in a library) ended the process and with it every robot's session.
TEST(JobWorker, AnExceptionFailsTheJobAndTheNextOneIsDone) {
  const JobsOptions options;
  Outbound outbound(32);
  JobList list(options, outbound, [] { return Stamp{0}; });
  JobWorker worker(options, list, [](const Job& job, bool, const JobControl&) -> Result<JobOutcome> {
    if (job.site == "bad") throw std::runtime_error("out of luck");
    return JobOutcome{};
  });
  const auto bad = worker.Submit("bad", JobKind::kSmooth, true);
  const auto good = worker.Submit("good", JobKind::kSmooth, true);
  worker.Start();
  const auto over = [&](std::uint64_t id) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (!IsFinal(list.Find(id)->state) && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
    return *list.Find(id);
  };
  EXPECT_EQ(over(bad->id).state, JobState::kFailed);
  EXPECT_NE(over(bad->id).message.find("out of luck"), std::string::npos);
  EXPECT_EQ(over(good->id).state, JobState::kSucceeded);
  worker.Stop();
}

}  // namespace
}  // namespace cairn::server
