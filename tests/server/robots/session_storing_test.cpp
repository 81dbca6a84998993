// A session that was not stored for a while, and is again; and what an exception leaves of one that is read back.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/server/robots/one_session.h"

namespace cairn::server::testing {
namespace {

class StoredSessionTest : public ::testing::Test {
 protected:
  StoredSessionTest() {
    one_.on_recover = [this] {
      one_.position = ++recovered_ * 10;
      return one_.position.load();
    };
    one_.session().ExpectDurable();
    one_.session().Durable({});
  }
  void Lose() { one_.session().Lost({StatusCode::kUnavailable, "the disk is full"}); }
  [[nodiscard]] SessionState state() { return one_.session().record().state(); }

  std::uint64_t recovered_ = 0;
  OneSession one_;
};

TEST_F(StoredSessionTest, CountsAsStoredAgainWhenItsCheckpointIsOnTheDisk) {
  ASSERT_TRUE(state().durable);
  one_.Drive(0, 4);
  ASSERT_TRUE(one_.WaitSettled(4));  // So that the checkpoint stands for them.
  Lose();
  EXPECT_FALSE(state().durable);
  EXPECT_EQ(state().status.message, "the disk is full");
  const Journal::Done done = one_.WaitStoring();
  EXPECT_FALSE(state().durable);
  EXPECT_EQ(one_.ledger().durable_through, 0U);
  done(true);
  EXPECT_TRUE(state().durable);
  EXPECT_TRUE(state().status.ok()) << state().status.message;
  EXPECT_EQ(one_.ledger().durable_through, 4U);
}

// The robot may be silent; housekeeping finds that the disk works again.
TEST_F(StoredSessionTest, TriesAgainWhereItsCheckpointCouldNotBeMade) {
  one_.Drive(0, 4);
  ASSERT_TRUE(one_.WaitSettled(4));
  Lose();
  one_.WaitStoring()(false);
  one_.position = 0;
  one_.WaitStoring()(true);
  EXPECT_EQ(recovered_, 2U);
  EXPECT_TRUE(state().durable);
  EXPECT_EQ(one_.ledger().durable_through, 4U);
}

// What became of an attempt that was given up says nothing about the next one.
TEST_F(StoredSessionTest, OnlyTheNewestCheckpointMakesItDurable) {
  one_.Drive(0, 4);
  ASSERT_TRUE(one_.WaitSettled(4));
  Lose();
  const Journal::Done first = one_.WaitStoring();
  Lose();  // From another thread, late: the journal stores the session.
  const Journal::Done second = one_.WaitStoring();
  first(true);
  EXPECT_FALSE(state().durable);
  second(true);
  EXPECT_TRUE(state().durable);
}

// It went on after the next start, as if it had not ended.
TEST_F(StoredSessionTest, IsStoredAgainAlsoAfterItsEnd) {
  one_.Drive(0, 4);
  Lose();
  one_.position = 0;
  one_.session().End();
  ASSERT_TRUE(one_.WaitPhase(SessionPhase::kEnded));
  one_.WaitStoring()(true);
  EXPECT_TRUE(state().durable);
  EXPECT_TRUE(one_.sent().WaitFor([&] { return !one_.session().has_work(); }));
}

std::size_t EndsTold(const Sent& sent) {
  return static_cast<std::size_t>(
      std::ranges::count(sent.All<SessionState>(), SessionPhase::kEnded, &SessionState::phase));
}

// A robot that was told so began something else; after a kill its session went on.
TEST_F(StoredSessionTest, ItsEndIsToldWhenThatIsOnTheDisk) {
  one_.position = 5;
  one_.session().End();
  ASSERT_TRUE(one_.WaitPhase(SessionPhase::kEnded));
  one_.session().Announce();
  one_.session().Durable({OdometryTaken{}});
  EXPECT_EQ(EndsTold(one_.sent()), 0U);
  EXPECT_TRUE(one_.session().end_untold());
  one_.session().Durable({SessionFinished{true, {}}});
  EXPECT_EQ(EndsTold(one_.sent()), 1U);
}

TEST_F(StoredSessionTest, ItsEndIsToldSoonAlsoWhereTheDiskIsSlow) {
  one_.position = 5;
  one_.session().End();
  ASSERT_TRUE(one_.WaitPhase(SessionPhase::kEnded));
  EXPECT_TRUE(one_.sent().WaitFor([&] {
    one_.session().Tick();
    return EndsTold(one_.sent()) == 1;
  }));
}

// Its journal grew with every switch of the map, for ever.
TEST_F(StoredSessionTest, ThatHasEndedTakesACheckpointAfterItsEndAndAfterEachMapSwitch) {
  one_.Drive(0, 10);
  ASSERT_TRUE(one_.WaitSettled(10));
  const auto Ticked = [this](int checkpoints) {
    return one_.sent().WaitFor([&] {
      one_.session().Tick();
      return !one_.session().has_work() && one_.checkpoints == checkpoints;
    });
  };
  one_.session().End();
  ASSERT_TRUE(one_.WaitPhase(SessionPhase::kEnded));
  EXPECT_EQ(one_.checkpoints, 0);  // The journal has nothing of it yet.
  one_.position = 5;
  EXPECT_TRUE(Ticked(1));
  const auto completed = std::make_shared<std::atomic<bool>>(false);
  std::atomic<bool> adopted{false};
  one_.session().Adopt(
      {.epoch = 4, .generation = 1, .grid = {}, .done = [&](Adopted&&) { adopted = true; }, .completed = completed});
  ASSERT_TRUE(one_.sent().WaitFor([&] { return adopted.load(); }));
  one_.position = 6;
  EXPECT_TRUE(Ticked(1));
  *completed = true;
  EXPECT_TRUE(Ticked(2));
  one_.session().SetMapEpoch(5);  // The journal has no entry of it, so there is nothing to be saved.
  ASSERT_TRUE(one_.sent().WaitFor([&] { return one_.session().record().epoch() == 5; }));
  EXPECT_TRUE(Ticked(2));
}

// A session whose robot is away, or that has ended, gets no scan with which it could draw.
TEST(StoredSession, WhatAMapLacksThatItTakesOverIsDrawnWithoutFurtherScans) {
  OneSession one;
  for (int step = 0; step < 260; step += 20) {
    one.Drive(step, step + 20);
    ASSERT_TRUE(one.WaitSettled(static_cast<std::uint64_t>(step) + 20));
  }
  ASSERT_GT(one.ledger().keyframes, 40U);
  ASSERT_TRUE(one.sent().WaitFor([&] { return !one.session().has_work(); }));
  const int before = one.grid_changes;
  std::atomic<bool> adopted{false};
  one.session().Adopt({.epoch = 4, .grid = {}, .done = [&](Adopted&&) { adopted = true; }});
  EXPECT_TRUE(one.sent().WaitFor([&] { return adopted && !one.session().has_work(); }));
  EXPECT_GE(one.grid_changes - before, 3) << "twenty keyframes at a time";
}

// It fails at the same scan each time that it is read: nothing of its map was shown any more.
TEST(StoredSession, AnExceptionWhileItIsRestoredLeavesItsPartOfTheMap) {
  std::vector<JournalEntry> journal;
  OneSession first, later;
  first.on_store = [&journal](JournalEntry&& entry) { journal.push_back(std::move(entry)); };
  first.Drive(0, 10);
  ASSERT_TRUE(first.WaitSettled(10));
  const auto switched = [](std::uint32_t, std::uint64_t) -> bool { throw std::runtime_error("not known"); };
  for (JournalEntry& entry : journal) later.session().Replay(std::move(entry), switched);
  later.session().Replay(CorrectionTaken{}, switched);
  later.session().Replayed();
  EXPECT_EQ(later.phase(), SessionPhase::kEnded);
  EXPECT_GT(later.grid_changes, 0);
}

// The next server may not fail where the first one did; but the robot was told that the session has ended.
TEST(StoredSession, ThatAnExceptionEndedHasEndedForTheNextServerToo) {
  std::vector<JournalEntry> journal;
  OneSession broken, later;
  broken.on_store = [&journal](JournalEntry&& entry) { journal.push_back(std::move(entry)); };
  broken.on_send = [](const OutboundValue& value) {
    const PoseReport* const pose = std::get_if<PoseReport>(&value);
    if (pose != nullptr && pose->scan_sequence == 5) throw std::runtime_error("no memory for pose 5");
    return true;
  };
  broken.Drive(0, 10);
  ASSERT_TRUE(broken.WaitSettled(10));
  std::promise<void> stopped;
  broken.session().Suspend([&stopped] { stopped.set_value(); });
  stopped.get_future().wait();
  std::size_t ends = 0;
  for (JournalEntry& entry : journal) {
    ends += std::holds_alternative<SessionFinished>(entry) ? 1 : 0;
    later.session().Replay(std::move(entry), [](std::uint32_t, std::uint64_t) { return true; });
  }
  later.session().Replayed();
  EXPECT_EQ(ends, 1U);
  EXPECT_EQ(later.phase(), SessionPhase::kEnded);
  EXPECT_GT(later.grid_changes, 0);
}

}  // namespace
}  // namespace cairn::server::testing
