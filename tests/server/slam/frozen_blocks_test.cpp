#include "server/slam/state/frozen_blocks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "server/slam/trail/shared_sequence.h"
#include "server/slam/trail/trail.h"

namespace cairn::slam {
namespace {

std::string BytesInBlocks(const FrozenBlocks<Pose2>& blocks, const std::vector<Pose2>& values) {
  StateWriter writer;
  InBlocks(writer, blocks, values);
  return writer.Bytes();
}

std::vector<Pose2> PosesUpTo(std::size_t size) {
  std::vector<Pose2> poses;
  for (std::size_t i = 0; i < size; ++i) poses.push_back({0.5 * static_cast<double>(i), 1.0, 0.25});
  return poses;
}

TEST(FrozenBlocks, TheSameSequenceComesBackWhateverItsLength) {
  FrozenBlocks<Pose2> growing;
  for (const std::size_t size : {0U, 1U, 1023U, 1024U, 1025U, 2048U, 5000U}) {
    const std::vector<Pose2> poses = PosesUpTo(size);
    const std::string bytes = BytesInBlocks(growing, poses);
    // Blocks from earlier make no difference.
    EXPECT_TRUE(bytes == BytesInBlocks(FrozenBlocks<Pose2>(), poses)) << size;
    StateReader reader(bytes);
    FrozenBlocks<Pose2> blocks;
    std::vector<Pose2> read = PosesUpTo(3);
    InBlocks(reader, blocks, read);
    ASSERT_TRUE(reader.done()) << size;
    EXPECT_EQ(read, poses);
    EXPECT_TRUE(BytesInBlocks(blocks, read) == bytes) << size;
  }
}

TEST(FrozenBlocks, WhatChangedIsCopiedAnewAfterForgetAndEarlierCheckpointsKeepTheOld) {
  FrozenBlocks<Pose2> blocks;
  std::vector<Pose2> poses = PosesUpTo(3000);
  StateWriter before;
  InBlocks(before, blocks, poses);
  const std::string old = BytesInBlocks(FrozenBlocks<Pose2>(), poses);
  poses[7].x = -1.0;
  blocks.Forget();
  EXPECT_TRUE(BytesInBlocks(blocks, poses) == BytesInBlocks(FrozenBlocks<Pose2>(), poses));
  EXPECT_TRUE(before.Bytes() == old);
}

// The bytes of an older format must not become a part of a checkpoint of this one.
TEST(FrozenBlocks, BlocksOfAnOlderFormatAreWrittenAgain) {
  const std::vector<Pose2> poses = PosesUpTo(3000);
  StateWriter first;
  InBlocks(first, FrozenBlocks<Pose2>(), poses);
  std::vector<std::string> bytes;
  for (const StatePiece& piece : first.pieces()) bytes.push_back(piece.Bytes());
  const std::vector<std::string_view> pieces(bytes.begin(), bytes.end());
  const std::string main = first.Main();
  for (const std::uint32_t format : {kStateFormat, kStateFormat - 1}) {
    StateReader reader(main, pieces, format);
    FrozenBlocks<Pose2> blocks;
    std::vector<Pose2> read;
    InBlocks(reader, blocks, read);
    ASSERT_TRUE(reader.done());
    EXPECT_EQ(read, poses);
    StateWriter again;
    InBlocks(again, blocks, read);
    const auto known = reader.values();
    const bool shared = std::ranges::find(known, again.pieces().front().value) != known.end();
    EXPECT_EQ(shared, format == kStateFormat) << format;
  }
}

// Of 3000 values only the blocks before the first changed one are kept.
TEST(FrozenBlocks, OnlyWhatComesBeforeTheFirstChangeIsKept) {
  for (const std::size_t first : {0U, 255U, 256U, 257U, 1000U, 2816U, 2999U}) {
    FrozenBlocks<Pose2> blocks;
    std::vector<Pose2> poses = PosesUpTo(3000);
    static_cast<void>(BytesInBlocks(blocks, poses));
    for (std::size_t i = first; i < poses.size(); ++i) poses[i].x = -1.0;
    blocks.ForgetFrom(first);
    EXPECT_TRUE(BytesInBlocks(blocks, poses) == BytesInBlocks(FrozenBlocks<Pose2>(), poses)) << first;
    // A value before it, whose change was not told, shows that its block was kept.
    if (first < 256) continue;
    const std::string right = BytesInBlocks(blocks, poses);
    poses[first / 256 * 256 - 1].x = -2.0;
    EXPECT_TRUE(BytesInBlocks(blocks, poses) == right) << first;
  }
}

TEST(FrozenBlocks, EveryShorterOrOtherTextIsRefusedOrReadWithoutHarm) {
  const std::string bytes = BytesInBlocks(FrozenBlocks<Pose2>(), PosesUpTo(1500));
  for (std::size_t size = 0; size < bytes.size(); size += 97) {
    StateReader reader(std::string_view(bytes).substr(0, size));
    FrozenBlocks<Pose2> blocks;
    std::vector<Pose2> read;
    InBlocks(reader, blocks, read);
    EXPECT_FALSE(reader.done()) << size;
  }
  for (std::size_t at = 0; at < 100; ++at) {
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 3);
    StateReader reader(changed);
    FrozenBlocks<Pose2> blocks;
    std::vector<Pose2> read;
    InBlocks(reader, blocks, read);
    EXPECT_TRUE(!reader.done() || read.size() <= 1500) << at;
  }
}

// Pointers to values that never change are saved with what they point to, equal neighbours once.
TEST(FrozenBlocks, EqualNeighboursAreSavedOnceAndSharedAgain) {
  const auto one = std::make_shared<const std::vector<double>>(100, 1.5);
  const std::vector<std::shared_ptr<const std::vector<double>>> values(2000, one);
  const FrozenBlocks<std::shared_ptr<const std::vector<double>>> blocks;
  StateWriter writer;
  InBlocks(writer, blocks, values);
  const std::string bytes = writer.Bytes();
  EXPECT_LT(bytes.size(), 10000U);
  StateReader reader(bytes);
  FrozenBlocks<std::shared_ptr<const std::vector<double>>> read_blocks;
  std::vector<std::shared_ptr<const std::vector<double>>> read;
  InBlocks(reader, read_blocks, read);
  ASSERT_TRUE(reader.done());
  ASSERT_EQ(read.size(), 2000U);
  EXPECT_EQ(*read[1999], *one);
  EXPECT_EQ(read[0], read[200]);
}

TEST(Later, IsOfTheMomentWhenItWasNotedAndKeepsWhatWasShared) {
  std::vector<SharedSequence<double>> sequences(3);
  for (int i = 0; i < 5000; ++i) sequences[0].Append(i);
  sequences[1] = sequences[0];
  sequences[1].Append(-1.0);
  sequences[2] = sequences[0];
  const std::vector<double> first = sequences[0].values();
  StateWriter writer;
  Later noted{sequences};
  writer(noted);
  sequences[0].Mutable(0) = 99.0;
  sequences[0].Append(1.0);
  const std::string bytes = writer.Bytes();
  EXPECT_LT(bytes.size(), 2 * 5000 * sizeof(double));  // Three would need three times 40,000 bytes.
  StateReader reader(bytes);
  std::vector<SharedSequence<double>> read;
  Later into{read};
  reader(into);
  ASSERT_TRUE(reader.done());
  ASSERT_EQ(read.size(), 3U);
  EXPECT_EQ(read[0].values(), first);
  EXPECT_EQ(read[2].values(), first);
  EXPECT_EQ(read[1].size(), 5001U);
}

Trail TrailOf(std::size_t keyframes) {
  Trail trail(MotionNoise{});
  auto scan = std::make_shared<Scan>();
  scan->range_max_m = 10.0;
  scan->angle_step_rad = 0.1;
  scan->ranges_m.assign(10, 1.0F);
  for (std::size_t k = 0; k < keyframes; ++k) {
    const Pose2 pose{0.1 * static_cast<double>(k), 0.0, 0.0};
    std::optional<RevisitObservation> revisit;
    if (k % 100 == 99) revisit = RevisitObservation{k - 50, {0.5, 0.0, 0.0}, Eigen::Matrix3d::Identity()};
    trail.Append({scan, pose}, pose, {}, Eigen::Matrix3d::Zero(), revisit);
    trail.MarkLast(k % 3 != 0, true);
    trail.AddScan(static_cast<Stamp>(k), {});
  }
  return trail;
}

std::string BytesOfTrail(const Trail& trail) {
  StateWriter writer;
  writer(trail);
  return writer.Bytes();
}

TEST(TrailInBlocks, LoopsDistancesAndTrustComeBack) {
  Trail trail = TrailOf(1300);
  static_cast<void>(BytesOfTrail(trail));  // The blocks of the tentative keyframes.
  trail.ConfirmTentative();
  const std::string bytes = BytesOfTrail(trail);
  StateReader reader(bytes);
  Trail read(MotionNoise{});
  reader(read);
  ASSERT_TRUE(reader.done());
  ASSERT_EQ(read.size(), 1300U);
  EXPECT_TRUE(std::ranges::all_of(read.keyframes(), [](const Keyframe& keyframe) { return keyframe.localized; }));
  EXPECT_TRUE(std::ranges::equal(read.distances_m(), trail.distances_m()));
  EXPECT_EQ(read.relations().size(), trail.relations().size());
  EXPECT_TRUE(BytesOfTrail(read) == bytes);
}

}  // namespace
}  // namespace cairn::slam
