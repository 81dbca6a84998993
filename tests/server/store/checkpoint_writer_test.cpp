#include "server/store/checkpoint_writer.h"

#include <gtest/gtest.h>

#include <numeric>

#include "server/store/sqlite_store.h"

namespace cairn::server {
namespace {

constexpr std::uint64_t kSession = 7;

// Pieces that count how often their bytes are made.
class Pieces {
 public:
  CheckpointPiece Make(const std::string& text, std::size_t repeated = 1) {
    return {std::make_shared<const std::string>(text), [this, text, repeated] {
              ++made_;
              std::string bytes;
              for (std::size_t i = 0; i < repeated; ++i) bytes += text;
              return bytes;
            }};
  }
  int made() const { return made_; }

 private:
  int made_ = 0;
};

// Writes the whole checkpoint, and returns in how many commits.
int Write(CheckpointWriter& writer, Store& store, int at_most = 1000) {
  int commits = 0;
  while (!writer.complete() && commits < at_most) {
    RecordChanges changes;
    writer.AddTo(changes);
    EXPECT_TRUE(store.Commit(changes));
    ++commits;
  }
  return commits;
}

std::vector<std::string> TextsOf(const StoredCheckpoint& checkpoint) {
  const auto views = checkpoint.PiecesInOrder();
  return {views.begin(), views.end()};
}

std::size_t RecordsIn(Store& store) {
  std::size_t records = 0;
  EXPECT_TRUE(store.Read({.kind = RecordKind::kCheckpoint, .owner = kSession},
                         [&records](std::uint64_t, std::string_view) -> Result<void> {
                           ++records;
                           return {};
                         }));
  return records;
}

TEST(CheckpointWriter, WritesOnlyThePiecesThatAreNew) {
  const auto store = *OpenStore(":memory:");
  Pieces pieces;
  const CheckpointPiece a = pieces.Make("a"), b = pieces.Make("b"), c = pieces.Make("c");
  CheckpointWriter first(kSession, 10, {"main 1", {a, b}});
  EXPECT_EQ(Write(first, *store), 1);
  EXPECT_EQ(pieces.made(), 2);
  CheckpointWriter second(kSession, 20, {"main 2", {c, b}}, first.pieces());
  Write(second, *store);
  EXPECT_EQ(pieces.made(), 3);
  const auto read = ReadCheckpoint(*store, kSession);
  ASSERT_TRUE(read && *read);
  EXPECT_EQ((*read)->position, 20U);
  EXPECT_EQ((*read)->bytes, "main 2");
  EXPECT_EQ(TextsOf(**read), (std::vector<std::string>{"c", "b"}));
  EXPECT_EQ(RecordsIn(*store), 4U) << "the head, the main part, and two pieces: one that is not needed is removed";
}

TEST(CheckpointWriter, AServerThatStartsAgainKnowsThePiecesThatItHasRead) {
  const auto store = *OpenStore(":memory:");
  Pieces pieces;
  const CheckpointPiece a = pieces.Make("a"), b = pieces.Make("b");
  CheckpointWriter first(kSession, 10, {"main", {a, b}});
  Write(first, *store);
  const auto read = ReadCheckpoint(*store, kSession);
  ASSERT_TRUE(read && *read);
  // It needed the second one only.
  const CheckpointPiece known{std::make_shared<const std::string>("b"), nullptr}, fresh = pieces.Make("d");
  CheckpointWriter next(kSession, 20, {"main", {known, fresh}},
                        {{(*read)->order[0], {}}, {(*read)->order[1], {known.value}}});
  Write(next, *store);
  EXPECT_EQ(TextsOf(**ReadCheckpoint(*store, kSession)), (std::vector<std::string>{"b", "d"}));
  EXPECT_EQ(RecordsIn(*store), 4U);
}

TEST(CheckpointWriter, WhatACrashLeftIncompleteIsIgnoredAndThenReplaced) {
  const auto store = *OpenStore(":memory:");
  Pieces pieces;
  const CheckpointPiece a = pieces.Make("a");
  CheckpointWriter first(kSession, 10, {"main 1", {a}});
  Write(first, *store);
  const CheckpointPiece large = pieces.Make("l", CheckpointWriter::kBytesPerCommit);
  CheckpointWriter torn(kSession, 20, {"main 2", {large, pieces.Make("x"), pieces.Make("y")}}, first.pieces());
  EXPECT_EQ(Write(torn, *store, 1), 1);
  ASSERT_FALSE(torn.complete());
  auto read = ReadCheckpoint(*store, kSession);
  ASSERT_TRUE(read && *read);
  EXPECT_EQ((*read)->position, 10U);
  EXPECT_EQ(TextsOf(**read), std::vector<std::string>{"a"});
  CheckpointWriter next(kSession, 15, {"main 3", {a}}, first.pieces());
  Write(next, *store);
  EXPECT_EQ((*ReadCheckpoint(*store, kSession))->bytes, "main 3");
  EXPECT_EQ(RecordsIn(*store), 3U);
}

TEST(CheckpointWriter, ALargeOneTakesSeveralCommits) {
  const auto store = *OpenStore(":memory:");
  Pieces pieces;
  std::vector<CheckpointPiece> many;
  for (int i = 0; i < 5; ++i) many.push_back(pieces.Make("m", CheckpointWriter::kBytesPerCommit / 2));
  std::string main(CheckpointWriter::kBytesPerCommit, '\0');
  std::iota(main.begin(), main.end(), '\0');
  CheckpointWriter writer(kSession, 10, {main, many});
  EXPECT_EQ(Write(writer, *store), 4);
  const auto read = ReadCheckpoint(*store, kSession);
  ASSERT_TRUE(read && *read);
  EXPECT_EQ((*read)->bytes, main);
  EXPECT_EQ((*read)->pieces.size(), 5U);
}

// A piece was one record, so that a large one held up everything else, and one over 1 GB could never be written.
TEST(CheckpointWriter, ALargePieceTakesSeveralCommitsAndIsRemovedWhole) {
  const auto store = *OpenStore(":memory:");
  Pieces pieces;
  constexpr std::size_t kLarge = 2 * CheckpointWriter::kBytesPerCommit + 5;
  const CheckpointPiece small = pieces.Make("s"), large = pieces.Make("l", kLarge), empty = pieces.Make("");
  CheckpointWriter first(kSession, 10, {"main", {small, large, empty}});
  RecordChanges changes;
  first.AddTo(changes);
  for (const Record& record : changes.put) EXPECT_LE(record.bytes.size(), CheckpointWriter::kPartBytes);
  EXPECT_TRUE(store->Commit(changes));
  EXPECT_FALSE(first.complete());
  EXPECT_EQ(Write(first, *store), 2);
  EXPECT_EQ(pieces.made(), 3);
  const auto read = ReadCheckpoint(*store, kSession);
  ASSERT_TRUE(read && *read);
  EXPECT_EQ(TextsOf(**read), (std::vector<std::string>{"s", std::string(kLarge, 'l'), ""}));
  // It stays where the next one contains it, also for a server that has read it,
  const CheckpointPiece other = pieces.Make("o");
  StoredPieces stored;
  for (const auto& [number, parts] : (*read)->parts) stored[number].parts = parts;
  stored[(*read)->order[1]].value = large.value;
  CheckpointWriter second(kSession, 20, {"main", {large, other}}, stored);
  Write(second, *store);
  EXPECT_EQ(TextsOf(**ReadCheckpoint(*store, kSession)), (std::vector<std::string>{std::string(kLarge, 'l'), "o"}));
  // and goes with all its parts.
  CheckpointWriter third(kSession, 30, {"main", {other}}, second.pieces());
  Write(third, *store);
  EXPECT_EQ(RecordsIn(*store), 3U);
}

TEST(CheckpointWriter, AMissingPartOfAPieceMakesTheCheckpointUnreadable) {
  const auto store = *OpenStore(":memory:");
  Pieces pieces;
  CheckpointWriter writer(kSession, 10, {"main", {pieces.Make("l", 3 * CheckpointWriter::kPartBytes)}});
  Write(writer, *store);
  std::vector<std::uint64_t> rest =
      *store->Numbers({.kind = RecordKind::kCheckpoint, .owner = kSession, .first = (std::uint64_t{1} << 63) + 1});
  ASSERT_EQ(rest.size(), 2U);
  for (const std::uint64_t number : {rest[1], rest[0]}) {
    ASSERT_TRUE(store->Commit(
        {.removed = {{.kind = RecordKind::kCheckpoint, .owner = kSession, .first = number, .last = number}},
         .put = {}}));
    EXPECT_EQ(ReadCheckpoint(*store, kSession).error().code, StatusCode::kDataLoss);
  }
}

TEST(CheckpointWriter, APieceThatIsMissingMakesTheCheckpointUnreadable) {
  const auto store = *OpenStore(":memory:");
  Pieces pieces;
  CheckpointWriter writer(kSession, 10, {"main", {pieces.Make("a"), pieces.Make("b")}});
  Write(writer, *store);
  constexpr std::uint64_t kSecond = (std::uint64_t{1} << 63) + 1;
  ASSERT_TRUE(store->Commit(
      {.removed = {{.kind = RecordKind::kCheckpoint, .owner = kSession, .first = kSecond, .last = kSecond}},
       .put = {}}));
  EXPECT_EQ(ReadCheckpoint(*store, kSession).error().code, StatusCode::kDataLoss);
}

TEST(CheckpointWriter, TheSameValueTwiceIsTwoPieces) {
  const auto store = *OpenStore(":memory:");
  Pieces pieces;
  const CheckpointPiece a = pieces.Make("a");
  CheckpointWriter first(kSession, 10, {"main", {a, a}});
  Write(first, *store);
  CheckpointWriter second(kSession, 20, {"main", {a, a}}, first.pieces());
  Write(second, *store);
  EXPECT_EQ(TextsOf(**ReadCheckpoint(*store, kSession)), (std::vector<std::string>{"a", "a"}));
}

}  // namespace
}  // namespace cairn::server
