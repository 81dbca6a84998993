#include "server/jobs/job_list.h"

#include <gtest/gtest.h>

#include "server/jobs/job_worker.h"

namespace cairn::server {
namespace {

class JobListTest : public ::testing::Test {
 protected:
  JobsOptions options_{.max_kept = 3};
  bool full_ = false;
  std::vector<Job> sent_;
  Stamp now_ = 100;
  JobList list_{options_,
                [this](OutboundValue value) {
                  if (full_) return false;
                  sent_.push_back(std::get<Job>(value));
                  return true;
                },
                [this] { return now_; }};
};

TEST_F(JobListTest, EveryChangeOfStateIsPublishedWithItsTime) {
  const auto job = list_.Add("lab", JobKind::kSmooth);
  ASSERT_TRUE(job);
  now_ = 200;
  EXPECT_TRUE(list_.Start(job->id));
  now_ = 300;
  list_.Succeed(job->id, {.cost_before = 2.0, .cost_after = 1.0, .map_version = 4, .message = "fine"});
  ASSERT_EQ(sent_.size(), 3U);
  EXPECT_EQ(sent_[0].state, JobState::kQueued);
  EXPECT_EQ(sent_[0].submitted, 100);
  EXPECT_EQ(sent_[1].state, JobState::kRunning);
  EXPECT_EQ(sent_[1].started, 200);
  EXPECT_EQ(sent_[2].state, JobState::kSucceeded);
  EXPECT_EQ(sent_[2].ended, 300);
  EXPECT_EQ(sent_[2].map_version, 4U);
}

TEST_F(JobListTest, ProgressOnlyGrowsAndIsThrottled) {
  const auto job = list_.Add("lab", JobKind::kSmooth);
  EXPECT_TRUE(list_.Start(job->id));
  const auto control = list_.ControlOf(job->id);
  const std::size_t before = sent_.size();
  for (int i = 1; i <= 1000; ++i) control->Progress(i / 1000.0);
  control->Progress(0.5);
  EXPECT_EQ(list_.Find(job->id)->progress, 1.0);
  EXPECT_LT(sent_.size() - before, 20U);
}

TEST_F(JobListTest, AQueuedJobIsCancelledAtOnceARunningOneWhenItLooks) {
  const auto queued = list_.Add("lab", JobKind::kSmooth);
  EXPECT_EQ(list_.Cancel(queued->id)->state, JobState::kCancelled);
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
  EXPECT_EQ(list_.OfSite("lab").size(), 2U);
  EXPECT_EQ(list_.OfSite("").size(), 3U);
}

TEST_F(JobListTest, WhatCouldNotBeSentIsSentLater) {
  full_ = true;
  const auto job = list_.Add("lab", JobKind::kSmooth);
  EXPECT_TRUE(sent_.empty());
  full_ = false;
  list_.Tick();
  ASSERT_EQ(sent_.size(), 1U);
  EXPECT_EQ(sent_[0].id, job->id);
  list_.Tick();
  EXPECT_EQ(sent_.size(), 1U);
}

TEST(JobWorker, RunsOneAfterTheOtherRefusesWhenFullAndStopsByCancelling) {
  JobsOptions options;
  options.max_queued = 1;
  JobList list(
      options, [](OutboundValue) { return true; }, [] { return Stamp{0}; });
  BoundedChannel<std::uint64_t> started(8);
  JobWorker worker(options, list, {{JobKind::kSmooth, [&](const Job& job, bool, const JobControl& control) {
                                      EXPECT_TRUE(started.TryPush(std::uint64_t{job.id}));
                                      while (!control.cancelled()) std::this_thread::yield();
                                      return Result<JobOutcome>(Fail(StatusCode::kCancelled, "cancelled"));
                                    }}});
  worker.Start();
  EXPECT_EQ(worker.Submit("lab", JobKind::kExport, true).error().code, StatusCode::kUnimplemented);
  const auto first = worker.Submit("lab", JobKind::kSmooth, true);
  ASSERT_TRUE(first);
  EXPECT_EQ(started.Pop(), first->id);
  const auto second = worker.Submit("lab", JobKind::kSmooth, true);
  ASSERT_TRUE(second);
  EXPECT_EQ(worker.Submit("lab", JobKind::kSmooth, true).error().code, StatusCode::kResourceExhausted);
  EXPECT_TRUE(list.Cancel(first->id));
  EXPECT_EQ(started.Pop(), second->id);
  worker.Stop();
  EXPECT_EQ(list.Find(first->id)->state, JobState::kCancelled);
  EXPECT_EQ(list.Find(second->id)->state, JobState::kCancelled);
}

}  // namespace
}  // namespace cairn::server
