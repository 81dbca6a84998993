// The desk with the rooms behind it: which snapshots each kind of request gets, and what becomes of commands. The
// contents of the answers are tested in queries_test.cpp.
#include "server/queries/desk.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "server/store/sqlite_store.h"
#include "tests/eventually.h"
#include "tests/server/maps/uniform_chunk.h"
#include "tests/server/robots/one_session.h"

namespace cairn::server {
namespace {

using testing::RequestOf;

constexpr std::size_t kCapacity = 2;

class DeskTest : public ::testing::Test {
 protected:
  DeskTest() {
    for (const char* robot : {"r1", "r2"}) {
      SessionRequest request = RequestOf(robot);
      request.site = robot == std::string("r1") ? "lab" : "hall";
      roster_.Take(request);
    }
  }
  ~DeskTest() override {
    desk_.Stop();
    worker_.Stop();
    pool_.join();
  }

  static Request Of(RequestKind kind) {
    Request request;
    request.client = 42;
    request.kind = kind;
    request.site = "lab";
    request.robot = "r1";
    return request;
  }
  std::optional<Reply> NextReply() {
    auto value = outbound_.lane(Outbound::Lane::kReplies).PopFor(std::chrono::seconds(20));
    if (!value) return std::nullopt;
    return std::get<Reply>(*std::move(value));
  }
  Reply Ask(Request request) {
    if (!std::exchange(started_, true)) desk_.Start();
    request.sequence = ++sequence_;
    desk_.Take(std::move(request));
    Reply reply = NextReply().value_or(Reply{});
    EXPECT_EQ(reply.sequence, sequence_);
    EXPECT_EQ(reply.client, 42U);
    return reply;
  }

  asio::thread_pool pool_{2};
  Outbound outbound_{64};
  Atlas atlas_{MapsOptions{}, 0.05, true, pool_, outbound_};
  Roster roster_{RobotsOptions{}, slam::MapperOptions{}, pool_, outbound_, atlas_};
  JobList jobs_{JobsOptions{}, outbound_, [] { return Stamp{0}; }};
  std::optional<bool> enable_;  // As the work of the last job got it; read after the worker has stopped.
  JobWorker worker_{JobsOptions{}, jobs_, [this](const Job&, bool enable, const JobControl&) {
                      enable_ = enable;
                      return Result<JobOutcome>(JobOutcome{});
                    }};
  SavedSites saved_sites_{{}, 0, nullptr, {outbound_, roster_, atlas_, jobs_, worker_}};
  Desk desk_{kCapacity, outbound_, roster_, atlas_, jobs_, worker_, saved_sites_, 1};
  bool started_ = false;
  std::int64_t sequence_ = 0;
};

TEST_F(DeskTest, ARequestBeyondTheQueueIsAnsweredBusyAtOnceAndTheOthersLater) {
  for (std::int64_t sequence = 1; sequence <= 3; ++sequence) {  // Nobody serves yet.
    Request ping = Of(RequestKind::kPing);
    ping.sequence = sequence;
    desk_.Take(std::move(ping));
  }
  const auto busy = NextReply();
  ASSERT_TRUE(busy);
  EXPECT_EQ(busy->sequence, 3);
  EXPECT_EQ(busy->status.code, StatusCode::kResourceExhausted);
  EXPECT_EQ(outbound_.over_limit(), 1U);
  desk_.Start();
  desk_.Stop();  // It answers what waits before it ends.
  for (std::int64_t sequence = 1; sequence <= 2; ++sequence) {
    const auto reply = NextReply();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->sequence, sequence);
    EXPECT_TRUE(reply->status.ok());
  }
}

TEST_F(DeskTest, ASavedSiteBeyondTheQueueIsAnsweredBusyAtOnce) {
  desk_.Start();  // It hands them on to a thread that has not been started.
  constexpr std::int64_t kWaiting = 16;
  for (std::int64_t sequence = 1; sequence <= kWaiting + 1; ++sequence) {
    Request save = Of(RequestKind::kSiteSave);
    save.sequence = sequence;
    desk_.Take(std::move(save));
    ASSERT_TRUE(test::Eventually([&] { return desk_.pulse().finished == static_cast<std::uint64_t>(sequence); }));
  }
  const auto busy = NextReply();
  ASSERT_TRUE(busy);
  EXPECT_EQ(busy->sequence, kWaiting + 1);
  EXPECT_EQ(busy->status.code, StatusCode::kResourceExhausted);
  EXPECT_EQ(outbound_.over_limit(), 1U);
}

// The watchdog looks at it: a desk that has work and finishes none is stalled.
TEST_F(DeskTest, ItsPulseTellsWhetherRequestsWaitAndWhetherTheyAreTaken) {
  EXPECT_FALSE(desk_.pulse().busy);
  desk_.Take(Of(RequestKind::kPing));
  EXPECT_TRUE(desk_.pulse().busy);
  EXPECT_EQ(desk_.pulse().finished, 0U);
  desk_.Start();
  ASSERT_TRUE(NextReply());
  EXPECT_FALSE(desk_.pulse().busy);
  EXPECT_EQ(desk_.pulse().finished, 1U);
}

TEST_F(DeskTest, AMapInfoIsThatOfTheSiteOrOfAllSites) {
  const Reply one = Ask(Of(RequestKind::kMapInfo));
  ASSERT_EQ(one.maps.size(), 1U);
  EXPECT_EQ(one.maps[0].site, "lab");
  Request all = Of(RequestKind::kMapInfo);
  all.site.clear();
  EXPECT_EQ(Ask(all).maps.size(), 2U);
}

TEST_F(DeskTest, AStatusIsThatOfTheRobotOrOfAllRobots) {
  Request one = Of(RequestKind::kStatus);
  one.site.clear();
  const Reply reply = Ask(one);
  ASSERT_EQ(reply.robots.size(), 1U);
  EXPECT_EQ(reply.robots[0].session.robot, "r1");
  one.robot.clear();
  EXPECT_EQ(Ask(one).robots.size(), 2U);
}

TEST_F(DeskTest, LandmarksAreThoseOfTheRobotsOfTheSite) {
  LandmarkReport landmark;
  landmark.p_map = {1, 2};
  roster_.Find("r1")->record().SetLandmarks({landmark, landmark});
  roster_.Find("r2")->record().SetLandmarks({landmark});
  EXPECT_EQ(Ask(Of(RequestKind::kLandmarks)).landmarks.size(), 2U);
}

TEST_F(DeskTest, ALargeAnswerComesInNumberedParts) {
  constexpr std::size_t kCount = 3000;
  roster_.Find("r1")->record().SetLandmarks(std::vector<LandmarkReport>(kCount));
  Reply part = Ask(Of(RequestKind::kLandmarks));
  std::size_t landmarks = part.landmarks.size();
  EXPECT_FALSE(part.last);
  for (std::uint32_t number = 1; !part.last; ++number) {
    const auto next = NextReply();
    ASSERT_TRUE(next);
    part = *next;
    EXPECT_EQ(part.part, number);
    landmarks += part.landmarks.size();
  }
  EXPECT_EQ(landmarks, kCount);
}

TEST_F(DeskTest, ALargeAnswerLetsOtherClientsIn) {
  roster_.Find("r1")->record().SetLandmarks(std::vector<LandmarkReport>(10000));
  Request large = Of(RequestKind::kLandmarks);
  Request small = Of(RequestKind::kPing);
  small.client = 43;
  desk_.Take(std::move(large));
  desk_.Take(std::move(small));
  desk_.Start();
  int before = 0, after = 0;
  bool answered = false, last = false;
  while (!last) {
    const auto reply = NextReply();
    ASSERT_TRUE(reply);
    if (reply->client == 43) {
      answered = true;
      continue;
    }
    ++(answered ? after : before);
    last = reply->last;
  }
  EXPECT_LE(before, 4);
  EXPECT_GT(after, 20);
}

TEST_F(DeskTest, AJobGetsTheWishToEnableItsMap) {
  for (const bool enable : {true, false}) {
    Request submit = Of(RequestKind::kJobSubmit);
    submit.enable = enable;
    const Reply reply = Ask(submit);
    ASSERT_EQ(reply.jobs.size(), 1U);
    EXPECT_EQ(reply.jobs[0].site, "lab");
    if (enable) worker_.Start();
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (!IsFinal(jobs_.Find(reply.jobs[0].id)->state) && std::chrono::steady_clock::now() < deadline)
      std::this_thread::yield();
    ASSERT_EQ(jobs_.Find(reply.jobs[0].id)->state, JobState::kSucceeded);
    EXPECT_EQ(enable_, enable);
  }
}

// It was answered that the robot is looked for, and the robot was lost, but nobody looked for it.
TEST_F(DeskTest, ARobotIsNotLookedForWhereNoJobCanBeSubmitted) {
  for (std::int64_t i = 0; i < JobsOptions{}.max_queued; ++i)  // The worker has not been started.
    ASSERT_TRUE(worker_.Submit("hall", JobKind::kRelocalise, false));
  const std::size_t jobs = jobs_.OfSite({}).size();
  const Reply relocalised = Ask(Of(RequestKind::kRelocalise));
  EXPECT_TRUE(relocalised.jobs.empty());
  EXPECT_EQ(relocalised.status.code, StatusCode::kResourceExhausted);
  EXPECT_EQ(jobs_.OfSite({}).size(), jobs) << "a job that cannot be kept takes the place of another one";
  EXPECT_FALSE(roster_.Find("r1")->has_work()) << "the robot was told that it is lost";
  EXPECT_EQ(relocalised.status.message, "too many jobs are waiting (jobs.max_queued); try again later");
  EXPECT_TRUE(Ask(Of(RequestKind::kJobSubmit)).status.ok()) << "those that change maps wait elsewhere";
  // Where somebody says where it is, it looks there for itself.
  Request here = Of(RequestKind::kRelocalise);
  here.T_map_robot = Pose2{};
  const std::size_t before = jobs_.OfSite({}).size();
  EXPECT_TRUE(Ask(here).status.ok());
  EXPECT_EQ(jobs_.OfSite({}).size(), before);
}

// A server that was killed after its answer had forgotten the order when it started again.
TEST_F(DeskTest, OrdersAreAnsweredWhenTheyAreOnTheDisk) {
  const auto store = *OpenStore(kInMemory);
  Journal journal(*store, StoreOptions{});
  Desk desk{kCapacity, outbound_, roster_, atlas_, jobs_, worker_, saved_sites_, 1, &journal};
  desk.Start();
  for (const RequestKind kind : {RequestKind::kJobSubmit, RequestKind::kRelocalise}) {
    desk.Take(Of(kind));
    desk.Take(Of(RequestKind::kPing));
    EXPECT_FALSE(NextReply().value_or(Reply{}).server_version.empty()) << "a question is answered before";
  }
  EXPECT_TRUE(test::Eventually([&] { return !roster_.Find("r1")->has_work(); }));
  EXPECT_FALSE(outbound_.lane(Outbound::Lane::kReplies).TryPop());
  journal.Start();
  int jobs = 0;
  for (int i = 0; i < 2; ++i) {
    const auto reply = NextReply();
    ASSERT_TRUE(reply);
    EXPECT_TRUE(reply->status.ok()) << reply->status.message;
    jobs += static_cast<int>(reply->jobs.size());
  }
  EXPECT_EQ(jobs, 2);
  Request nobody = Of(RequestKind::kRelocalise);
  nobody.robot = "r9";
  desk.Take(std::move(nobody));
  EXPECT_EQ(NextReply().value_or(Reply{}).status.code, StatusCode::kNotFound);
  desk.Stop();
  journal.Stop();
}

// The session ends with the order still in its queue.
TEST(Receipt, SaysThatNobodyHasTakenIt) {
  std::vector<bool> told;
  const auto tell = [&told](bool taken) { told.push_back(taken); };
  { const Receipt forgotten(tell); }
  EXPECT_EQ(told, std::vector<bool>{false});
  Receipt(tell).Taken();
  EXPECT_EQ(told, (std::vector<bool>{false, true}));
  Receipt(tell).Cancel();
  EXPECT_EQ(told.size(), 2U);
}

TEST_F(DeskTest, JobsAreFoundListedAndCancelled) {
  Request job = Of(RequestKind::kJobSubmit);
  job.job = Ask(job).jobs.at(0).id;
  Request elsewhere = Of(RequestKind::kJobSubmit);
  elsewhere.site = "hall";
  EXPECT_EQ(Ask(elsewhere).jobs.size(), 1U);
  EXPECT_EQ(Ask(Of(RequestKind::kJobList)).jobs.size(), 1U);
  job.kind = RequestKind::kJobGet;
  EXPECT_EQ(Ask(job).jobs.at(0).state, JobState::kQueued);
  job.kind = RequestKind::kJobCancel;
  EXPECT_EQ(Ask(job).jobs.at(0).state, JobState::kCancelled);
  EXPECT_EQ(Ask(job).status.code, StatusCode::kFailedPrecondition);
  job.job = 999;
  EXPECT_EQ(Ask(job).status.code, StatusCode::kNotFound);
  Request nowhere = Of(RequestKind::kJobSubmit);
  nowhere.site = "moon";
  EXPECT_EQ(Ask(nowhere).status.code, StatusCode::kNotFound);
}

TEST_F(DeskTest, EndingASessionSaysWhetherThereIsOne) {
  EXPECT_TRUE(Ask(Of(RequestKind::kSessionEnd)).status.ok());
  EXPECT_TRUE(roster_.Find("r1")->ending());
  Request nobody = Of(RequestKind::kSessionEnd);
  nobody.robot = "r9";
  EXPECT_EQ(Ask(nobody).status.code, StatusCode::kNotFound);
}

// Both are made by the site when they are asked for.
TEST_F(DeskTest, TilesOfOneRobotAndOfTheLayerOfDisagreement) {
  Request tiles = Of(RequestKind::kTiles);
  tiles.site.clear();
  EXPECT_EQ(Ask(tiles).status.code, StatusCode::kNotFound) << "it has drawn nothing";
  atlas_.Find("lab")->Change({.session = roster_.Find("r1")->id(), .chunks = {{{2, 0}, UniformChunk(300)}}});
  const Reply own = Ask(tiles);
  ASSERT_EQ(own.tiles.size(), 1U);
  EXPECT_EQ(own.tiles[0].key, (TileKey{0, 2, 0}));
  tiles.level = 9;
  EXPECT_EQ(Ask(tiles).status.code, StatusCode::kInvalidArgument);
  tiles.level = 0;
  tiles.robot = "r9";
  EXPECT_EQ(Ask(tiles).status.code, StatusCode::kNotFound);

  Request differing = Of(RequestKind::kTiles);
  differing.disagreement = true;
  EXPECT_TRUE(Ask(differing).tiles.empty());
  atlas_.Find("lab")->Change({.session = 99, .chunks = {{{2, 0}, UniformChunk(-300)}}});
  EXPECT_EQ(Ask(differing).tiles.size(), 1U);
  differing.site = "moon";
  EXPECT_EQ(Ask(differing).status.code, StatusCode::kNotFound);
}

TEST_F(DeskTest, AMapVersionOrASiteThatDoesNotExistCannotBeEnabled) {
  Request enable = Of(RequestKind::kMapEnable);
  enable.map_version = 77;
  EXPECT_FALSE(Ask(enable).status.ok());
  enable.site = "moon";
  EXPECT_EQ(Ask(enable).status.code, StatusCode::kNotFound);
}

}  // namespace
}  // namespace cairn::server
