#include "common/wire/library_repairs.h"

#include <fastdds/rtps/history/ReaderHistory.h>
#include <gtest/gtest.h>

#include <memory>
#include <utility>
#include <vector>

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

}  // namespace
}  // namespace cairn::wire
