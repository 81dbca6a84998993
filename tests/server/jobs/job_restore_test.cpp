// The job list of a server that was stopped or killed, as the next server on the same store finds it.
#include <gtest/gtest.h>

#include "server/jobs/job_worker.h"
#include "server/store/sqlite_store.h"
#include "tests/eventually.h"

namespace cairn::server {
namespace {

// A job list with its journal. Destroying it without `stop` is a kill: no job is cancelled.
struct StoredList {
  explicit StoredList(Store& store, const JobsOptions& options = {})
      : journal(store, {.commit_delay_ms = 1}),
        list(
            options, outbound, [this] { return now; }, &journal) {
    journal.Start();
  }
  ~StoredList() { journal.Stop(); }
  std::vector<Job> TakeSent() {
    std::vector<Job> sent;
    while (auto value = outbound.lane(Outbound::Lane::kLive).TryPop())
      if (const auto* const job = std::get_if<Job>(&*value)) sent.push_back(*job);
    return sent;
  }

  Stamp now = 100;
  Outbound outbound{32};
  Journal journal;
  JobList list;
};

class JobRestore : public ::testing::Test {
 protected:
  // Three jobs: one that has ended, one that runs and one that waits.
  void RunFirstServer() {
    StoredList first(*store_);
    ASSERT_TRUE(first.list.Add("lab", JobKind::kSmooth, true));
    ASSERT_TRUE(first.list.Add("hall", JobKind::kSmooth, false));
    ASSERT_TRUE(first.list.Add("lab", JobKind::kSmooth, true));
    ASSERT_TRUE(first.list.Start(1));
    first.list.Succeed(1, {.cost_before = 2.0, .cost_after = 1.0, .map_version = 4, .message = "fine"});
    ASSERT_TRUE(first.list.Start(2));
    first.list.ControlOf(2)->Progress(0.5);
  }

  const std::unique_ptr<Store> store_ = *OpenStore(std::string(kInMemory));
};

TEST_F(JobRestore, JobsThatHadNotEndedAreQueuedAgainInTheirOrder) {
  RunFirstServer();
  StoredList second(*store_);
  const auto unfinished = second.list.Restore();
  ASSERT_TRUE(unfinished) << unfinished.error().message;
  ASSERT_EQ(unfinished->size(), 2U);
  EXPECT_EQ((*unfinished)[0].job.id, 2U);
  EXPECT_FALSE((*unfinished)[0].enable);
  EXPECT_EQ((*unfinished)[1].job.id, 3U);
  EXPECT_TRUE((*unfinished)[1].enable);
  const Job ended = *second.list.Find(1);
  EXPECT_EQ(ended.state, JobState::kSucceeded);
  EXPECT_EQ(ended.progress, 1.0);
  EXPECT_EQ(ended.map_version, 4U);
  EXPECT_EQ(ended.message, "fine");
  for (const std::uint64_t id : {2U, 3U}) {
    EXPECT_EQ(second.list.Find(id)->state, JobState::kQueued) << id;
    EXPECT_EQ(second.list.Find(id)->progress, 0.0) << id;
    EXPECT_TRUE(second.list.Start(id)) << id;
  }
  second.list.ControlOf(2)->Progress(0.25);
  EXPECT_EQ(second.list.Find(2)->progress, 0.25);
  EXPECT_EQ(second.list.Add("lab", JobKind::kSmooth)->id, 4U) << "ids of earlier servers are not used again";
}

TEST_F(JobRestore, RestoredJobsArePublishedWithTheNextTick) {
  RunFirstServer();
  StoredList second(*store_);
  ASSERT_TRUE(second.list.Restore());
  second.list.Tick();
  const std::vector<Job> sent = second.TakeSent();
  ASSERT_EQ(sent.size(), 3U);
  EXPECT_EQ(sent[0].state, JobState::kSucceeded);
  EXPECT_EQ(sent[1].state, JobState::kQueued);
}

// A restored job keeps its choice through a second restart, even if nothing but its start is stored in between.
TEST_F(JobRestore, WhetherToEnableTheResultSurvivesTwoRestarts) {
  RunFirstServer();
  {
    StoredList second(*store_);
    ASSERT_TRUE(second.list.Restore());
    ASSERT_TRUE(second.list.Start(2));
  }
  StoredList third(*store_);
  const auto unfinished = third.list.Restore();
  ASSERT_EQ(unfinished->size(), 2U);
  EXPECT_FALSE(unfinished->front().enable);
}

TEST_F(JobRestore, AStopCancelsTheJobsButTheNextServerStartsThemAgain) {
  {
    StoredList first(*store_);
    ASSERT_TRUE(first.list.Add("lab", JobKind::kSmooth));
    ASSERT_TRUE(first.list.Add("lab", JobKind::kSmooth));
    ASSERT_TRUE(first.list.Add("lab", JobKind::kSmooth));
    ASSERT_TRUE(first.list.Start(1));
    first.list.Succeed(1, {});
    ASSERT_TRUE(first.list.Start(2));
    first.list.CancelAll();
    EXPECT_FALSE(first.list.ControlOf(1)->cancelled());
    EXPECT_TRUE(first.list.ControlOf(2)->cancelled());
    first.list.Fail(2, {StatusCode::kCancelled, "cancelled"});
    EXPECT_EQ(first.list.Find(1)->state, JobState::kSucceeded);
    EXPECT_EQ(first.list.Find(2)->state, JobState::kCancelled);
    EXPECT_EQ(first.list.Find(3)->state, JobState::kCancelled);
  }
  StoredList second(*store_);
  EXPECT_EQ(second.list.Restore()->size(), 2U);
}

TEST_F(JobRestore, AReplacedJobIsRemovedFromTheStore) {
  {
    StoredList first(*store_, {.max_kept = 2});
    ASSERT_TRUE(first.list.Add("lab", JobKind::kSmooth));
    ASSERT_TRUE(first.list.Cancel(1));
    ASSERT_TRUE(first.list.Add("lab", JobKind::kSmooth));
    ASSERT_TRUE(first.list.Add("lab", JobKind::kSmooth));
  }
  StoredList second(*store_);
  ASSERT_TRUE(second.list.Restore());
  EXPECT_FALSE(second.list.Find(1));
  EXPECT_TRUE(second.list.Find(2));
  EXPECT_TRUE(second.list.Find(3));
}

TEST_F(JobRestore, ADamagedRecordIsSetAsideAndItsNumberIsNotUsedAgain) {
  RunFirstServer();
  ASSERT_TRUE(store_->Commit({.removed = {}, .put = {{{RecordKind::kJob, 7, 0}, "no job at all"}}}));
  StoredList second(*store_);
  const auto unfinished = second.list.Restore();
  ASSERT_TRUE(unfinished) << unfinished.error().message;
  EXPECT_EQ(unfinished->size(), 2U);
  EXPECT_FALSE(second.list.Find(7));
  EXPECT_THAT(second.journal.set_aside().text(), ::testing::HasSubstr("job 7"));
  EXPECT_EQ(second.list.Add("lab", JobKind::kSmooth, true)->id, 8U);
}

// A store whose list of owners cannot be read.
struct BrokenStore final : Store {
  Result<void> Commit(const RecordChanges& /*changes*/) override { return {}; }
  Result<void> CommitEach(const Next& /*next*/) override { return {}; }
  Result<std::size_t> RemoveFirst(const RecordRange& /*range*/, std::size_t /*count*/) override { return 0; }
  Result<void> Read(const RecordRange& /*range*/, const Visit& /*visit*/) override { return {}; }
  Result<std::vector<std::uint64_t>> Owners(RecordKind /*kind*/) override {
    return Fail(StatusCode::kUnavailable, "the disk does not answer");
  }
  Result<std::vector<std::uint64_t>> Numbers(const RecordRange& /*range*/) override { return {}; }
  Result<std::uint64_t> bytes_used() override { return 0; }
};

TEST_F(JobRestore, ADiskThatCannotBeReadIsAnError) {
  BrokenStore broken;
  StoredList second(broken);
  const auto restored = second.list.Restore();
  ASSERT_FALSE(restored);
  EXPECT_EQ(restored.error().code, StatusCode::kUnavailable);
}

TEST_F(JobRestore, WithoutAJournalThereIsNothingToRestore) {
  Outbound outbound(32);
  JobList list({}, outbound, [] { return Stamp{0}; });
  const auto restored = list.Restore();
  ASSERT_TRUE(restored);
  EXPECT_TRUE(restored->empty());
}

TEST_F(JobRestore, AJobThatIsQueuedAgainIsRunWithItsChoice) {
  RunFirstServer();
  StoredList second(*store_);
  BoundedChannel<std::pair<std::uint64_t, bool>> run(4);
  JobWorker worker({}, second.list, [&](const Job& job, bool enable, const JobControl&) {
    EXPECT_TRUE(run.TryPush({job.id, enable}));
    return Result<JobOutcome>(JobOutcome{});
  });
  const auto unfinished = second.list.Restore();
  ASSERT_TRUE(unfinished);
  for (const StoredJob& job : *unfinished) worker.Requeue(job.job.id, job.enable);
  worker.Start();
  EXPECT_EQ(run.Pop(), std::pair(std::uint64_t{2}, false));
  EXPECT_EQ(run.Pop(), std::pair(std::uint64_t{3}, true));
  EXPECT_TRUE(test::Eventually([&] { return second.list.Find(3)->state == JobState::kSucceeded; }));
  worker.Stop();
}

// A job that needs more memory than there is ended every server that began it, for ever.
TEST_F(JobRestore, AJobThatEndsServersIsGivenUp) {
  RunFirstServer();
  for (int server = 2; server <= 8; ++server) {
    StoredList list(*store_);
    const auto unfinished = list.list.Restore();
    ASSERT_TRUE(unfinished);
    ASSERT_EQ(unfinished->size(), 2U) << server;
    ASSERT_TRUE(list.list.Start(2));
    EXPECT_FALSE(list.list.EndsServers("hall", JobKind::kSmooth));
  }
  StoredList last(*store_, {.max_queued = 1, .max_kept = 4});
  const auto unfinished = last.list.Restore();
  ASSERT_TRUE(unfinished);
  ASSERT_EQ(unfinished->size(), 1U);  // The one that only waited.
  EXPECT_EQ(last.list.Find(2)->state, JobState::kFailed);
  EXPECT_NE(last.list.Find(2)->message.find("ended 8 times"), std::string::npos) << last.list.Find(2)->message;
  EXPECT_TRUE(last.list.EndsServers("hall", JobKind::kSmooth));
  EXPECT_FALSE(last.list.EndsServers("hall", JobKind::kJoin));
  EXPECT_FALSE(last.list.EndsServers("lab", JobKind::kSmooth));
  // Many later jobs do not make it forgotten.
  for (int later = 0; later < 8; ++later) {
    const auto job = last.list.Add("lab", JobKind::kRelocalise);
    ASSERT_TRUE(job);
    last.list.Fail(job->id, {StatusCode::kFailedPrecondition, "found nowhere"});
  }
  EXPECT_TRUE(last.list.EndsServers("hall", JobKind::kSmooth));
}

TEST_F(JobRestore, AServerThatIsStoppedWhileAJobRunsWasNotEndedByIt) {
  RunFirstServer();
  for (int server = 2; server <= 20; ++server) {
    StoredList list(*store_);
    ASSERT_EQ(list.list.Restore()->size(), 2U) << server;
    ASSERT_TRUE(list.list.Start(2));
    list.list.CancelAll();
  }
}

// The one that ran and those that waited: one more than may be submitted.
TEST_F(JobRestore, TheJobThatRanWaitsBesideThoseThatWaited) {
  RunFirstServer();
  const JobsOptions options{.max_queued = 1};
  StoredList second(*store_, options);
  JobWorker worker(options, second.list, [](const Job&, bool, const JobControl&) -> Result<JobOutcome> { return {}; });
  const auto unfinished = second.list.Restore();
  ASSERT_TRUE(unfinished);
  ASSERT_EQ(unfinished->size(), 2U);
  for (const StoredJob& job : *unfinished) worker.Requeue(job.job.id, job.enable);
  EXPECT_EQ(second.list.Find(2)->state, JobState::kQueued);
  EXPECT_EQ(second.list.Find(3)->state, JobState::kQueued);
  const auto submitted = worker.Submit("lab", JobKind::kSmooth, false);
  ASSERT_FALSE(submitted);
  EXPECT_EQ(submitted.error().code, StatusCode::kResourceExhausted);
  // With fewer that may wait than before, those that find no place fail and say why.
  const auto another = second.list.Add("lab", JobKind::kSmooth, false);
  ASSERT_TRUE(another);
  worker.Requeue(another->id, false);
  EXPECT_EQ(second.list.Find(another->id)->state, JobState::kFailed);
  EXPECT_NE(second.list.Find(another->id)->message.find("jobs.max_queued"), std::string::npos);
}

}  // namespace
}  // namespace cairn::server
