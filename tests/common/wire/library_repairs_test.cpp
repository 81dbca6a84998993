#include "common/wire/library_repairs.h"

#include <fastdds/rtps/history/ReaderHistory.h>
#include <fastdds/rtps/history/WriterHistory.h>
#include <fastdds/rtps/resources/ResourceEvent.h>
#include <fastdds/rtps/writer/LivelinessManager.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "tests/eventually.h"

namespace cairn::wire {
namespace {

namespace rtps = eprosima::fastrtps::rtps;

rtps::GUID_t WriterOf(std::uint8_t number) {
  rtps::GUID_t guid;
  guid.guidPrefix.value[0] = number;
  return guid;
}

// The history of a reader, with the changes in the order in which they are given.
class History : public rtps::ReaderHistory {
 public:
  explicit History(const std::vector<std::pair<std::uint8_t, std::uint32_t>>& changes)
      : rtps::ReaderHistory(rtps::HistoryAttributes()) {
    mp_mutex = &own_mutex_;
    for (const auto& [writer, number] : changes) {
      own_.push_back(std::make_unique<rtps::CacheChange_t>());
      own_.back()->writerGUID = WriterOf(writer);
      own_.back()->sequenceNumber = rtps::SequenceNumber_t(0, number);
      m_changes.push_back(own_.back().get());
    }
  }
  ~History() override {
    m_changes.clear();
    mp_mutex = nullptr;
  }

  // As the library asks when samples have arrived.
  [[nodiscard]] bool Has(std::uint8_t writer, std::uint32_t number) const {
    rtps::CacheChange_t* found = nullptr;
    return get_change({0, number}, WriterOf(writer), &found) && found->sequenceNumber.low == number &&
           found->writerGUID == WriterOf(writer);
  }

 private:
  eprosima::fastrtps::RecursiveTimedMutex own_mutex_;
  std::vector<std::unique_ptr<rtps::CacheChange_t>> own_;
};

// One that came late stood behind its successor. It was read before its arrival was noticed, and the process ended.
TEST(LibraryRepairs, AChangeIsFoundAlsoBehindItsSuccessor) {
  UseRepairs();
  const History history({{1, 2}, {2, 7}, {1, 1}, {2, 8}, {1, 4}});
  EXPECT_TRUE(history.Has(1, 1));
  EXPECT_TRUE(history.Has(1, 2));
  EXPECT_FALSE(history.Has(1, 3));
  EXPECT_TRUE(history.Has(1, 4));
  EXPECT_TRUE(history.Has(2, 7));
  EXPECT_TRUE(history.Has(2, 8));
  EXPECT_FALSE(history.Has(2, 1));
}

TEST(LibraryRepairs, WhereAChangeIsMissingTheNextOneOfItsWriterIsGiven) {
  UseRepairs();
  History history({{1, 2}, {2, 3}, {1, 5}});
  rtps::CacheChange_t* found = nullptr;
  const auto next = history.get_change_nts({0, 3}, WriterOf(1), &found, history.changesBegin());
  EXPECT_EQ(found, nullptr);
  ASSERT_NE(next, history.changesEnd());
  EXPECT_EQ((*next)->sequenceNumber.low, 5U);
  EXPECT_EQ(history.get_change_nts({0, 6}, WriterOf(1), &found, history.changesBegin()), history.changesEnd());
}

// The history of a writer that is not there. What it looks for is never found.
class EmptyHistory : public rtps::WriterHistory {
 public:
  EmptyHistory() : rtps::WriterHistory(rtps::HistoryAttributes()) {
    mp_mutex = &mutex;
    mp_writer = reinterpret_cast<rtps::RTPSWriter*>(this);  // It only must not be null.
  }
  ~EmptyHistory() override {
    mp_mutex = nullptr;
    mp_writer = nullptr;
  }
  eprosima::fastrtps::RecursiveTimedMutex mutex;
};

// A message of a handshake that was not found for this reason was never sent again.
TEST(LibraryRepairs, AChangeIsNotLookedForWhileTheHistoryChanges) {
  UseRepairs();
  EmptyHistory history;
  std::atomic<bool> looked{false};
  std::unique_lock<eprosima::fastrtps::RecursiveTimedMutex> changing(history.mutex);
  std::jthread other([&] {
    EXPECT_EQ(history.remove_change_and_reuse({0, 1}), nullptr);
    looked = true;
  });
  EXPECT_FALSE(cairn::test::Eventually([&] { return looked.load(); }, std::chrono::milliseconds(100)));
  changing.unlock();
  EXPECT_TRUE(cairn::test::Eventually([&] { return looked.load(); }));
}

// Leases run out while they are renewed, as where a process stood still: a loss and a return must be told in turn. The
// library's own functions told two losses or two returns after each other, or both at the same time.
TEST(LibraryRepairs, ChangesOfLivelinessAreToldInTheirOrder) {
  UseRepairs();
  constexpr int kLosses = 300;
  const auto kind = eprosima::fastdds::dds::AUTOMATIC_LIVELINESS_QOS;
  const eprosima::fastrtps::Duration_t lease(0, 2'000'000);
  std::atomic<int> alive{0};
  std::atomic<int> losses{0};
  std::atomic<int> out_of_order{0};
  std::atomic<int> telling{0};
  rtps::ResourceEvent events;
  events.init_thread();
  {
    rtps::LivelinessManager manager(
        [&](const rtps::GUID_t&, const auto&, const auto&, std::int32_t alive_change, std::int32_t) {
          if (telling.fetch_add(1) != 0) ++out_of_order;
          std::this_thread::sleep_for(std::chrono::microseconds(200));  // So that another thread may overtake it.
          if (alive.fetch_add(alive_change) + alive_change != (alive_change > 0 ? 1 : 0)) ++out_of_order;
          if (alive_change < 0) ++losses;
          telling.fetch_sub(1);
        },
        events, true);
    ASSERT_TRUE(manager.add_writer(WriterOf(1), kind, lease));
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    for (int i = 0; losses < kLosses && std::chrono::steady_clock::now() < deadline; ++i) {
      manager.assert_liveliness(WriterOf(1), kind, lease);
      // From half the lease (the library counts whole milliseconds) to more than the lease, so that a loss and a
      // return meet at every moment.
      std::this_thread::sleep_for(std::chrono::microseconds(800 + 20 * (i % 80)));
    }
    events.stop_thread();
  }
  EXPECT_GE(losses, kLosses);
  EXPECT_EQ(out_of_order, 0);
}

}  // namespace
}  // namespace cairn::wire
