#include "server/jobs/relation_books.h"

#include <gtest/gtest.h>

#include <future>

#include "tests/server/store/stored_sites.h"

namespace cairn::server {
namespace {

using slam::MeasurementKind;
using slam::RelationBook;

const std::vector<std::uint64_t> kSessions{3, 8};
bool Exists(const std::string&) {
  return true;
}

slam::Measurement Found(std::uint64_t seen) {
  return {.known = {1, 5},
          .seen = {seen, 77},
          .found = true,
          .T_known_seen = {1.0, 2.0, 0.3},
          .covariance = PoseCovariance(0.1, 0.02)};
}

class RelationBooksTest : public ::testing::Test {
 protected:
  // What one server measures; the next one begins with the same store.
  void Measure(std::uint64_t seen) {
    Journal journal(*store_, {.commit_delay_ms = 1});
    journal.Start();
    RelationBooks books(&journal);
    books.Open("lab", kSessions).Note({3, 8}, MeasurementKind::kRevisit, Found(seen));
    books.Close("lab", kSessions, Exists);
    journal.Stop();
  }
  std::size_t Restored() {
    Journal journal(*store_, {.commit_delay_ms = 1});
    return RelationBooks(&journal).Open("lab", kSessions).size();
  }

  std::unique_ptr<Store> store_ = testing::MemoryStore();
};

TEST_F(RelationBooksTest, TheNextServerKnowsWhatWasMeasured) {
  EXPECT_EQ(Restored(), 0U);
  Measure(1);
  Measure(2);
  EXPECT_EQ(Restored(), 2U);
}

TEST_F(RelationBooksTest, DamagedRecordsOnlyCostTime) {
  Measure(1);
  ASSERT_TRUE(store_->Commit({.removed = {}, .put = {{{RecordKind::kRelations, 8, 3}, "no measurements"}}}));
  EXPECT_EQ(Restored(), 0U);
  Measure(2);
  EXPECT_EQ(Restored(), 1U);
}

TEST_F(RelationBooksTest, WhatWasMeasuredOfARemovedSessionIsRemoved) {
  Measure(1);
  Journal journal(*store_, {.commit_delay_ms = 1});
  journal.Start();
  RelationBooks books(&journal);
  EXPECT_EQ(books.Open("lab", kSessions).size(), 1U);
  books.Close("lab", {8}, Exists);
  journal.Stop();
  EXPECT_EQ(Restored(), 0U);
}

TEST_F(RelationBooksTest, TheJournalRemovesItWithItsSession) {
  Measure(1);
  Journal journal(*store_, {.commit_delay_ms = 1});
  journal.Start();
  journal.Forget(8);
  journal.Stop();
  EXPECT_EQ(Restored(), 0U);
}

TEST_F(RelationBooksTest, WithoutAStoreTheyLastAsLongAsTheServer) {
  RelationBooks books;
  books.Open("lab", kSessions).Note({3, 8}, MeasurementKind::kRevisit, Found(1));
  books.Close("lab", kSessions, Exists);
  EXPECT_EQ(books.Open("lab", kSessions).size(), 1U);
  static_cast<void>(books.Open("hall", {}));
  books.Close("hall", {}, [](const std::string& site) { return site == "hall"; });
  EXPECT_EQ(books.Open("lab", kSessions).size(), 0U) << "the site is gone";
}

}  // namespace
}  // namespace cairn::server
