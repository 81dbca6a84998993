// How an edit moves with the keyframes on which it hangs.
#include "server/maps/edit_anchors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

namespace cairn::server {
namespace {

DrawnPath PathWith(std::vector<Pose2> poses, std::vector<std::uint64_t> numbers) {
  return {std::make_shared<const std::vector<Pose2>>(std::move(poses)),
          std::make_shared<const std::vector<std::uint64_t>>(std::move(numbers))};
}

MapEdit Line(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  return {.kind = MapEditKind::kOccupied, .points_map = {from, to}, .width_m = 0.1, .note = {}};
}

double Away(const Pose2& a, const Pose2& b) {
  return (a.vector() - b.vector()).norm();
}

// Keyframes of these sessions; nobody sees through the line x = `wall_x_m`.
AnchorChoice Of(std::vector<SessionId> sessions, double wall_x_m = 100.0) {
  return {[sessions = std::move(sessions)](const auto&) { return sessions; },
          [wall_x_m](const auto& from, const auto& point) { return (from.x() < wall_x_m) == (point.x() < wall_x_m); }};
}

TEST(EditAnchors, EachPointHangsOnTheNearestKeyframeOfTheSessionsThatCount) {
  const DrawnPaths paths = {{1, PathWith({{0, 0, 0}, {4, 0, 0}, {8, 0, 0}}, {0, 5, 9})},
                            {2, PathWith({{4, 1, 0}}, {3})}};
  const MapEdit edit = Line({3.5, 1.0}, {7.0, 1.0});
  const EditAnchors both = AnchorsOf(edit, paths, Of({1, 2}));
  ASSERT_EQ(both.keyframes.size(), 2U);
  EXPECT_EQ(both.keyframes[0].session, 2U);
  EXPECT_EQ(both.keyframes[0].keyframe, 3U);
  EXPECT_EQ(both.keyframes[1].session, 1U);
  EXPECT_EQ(both.keyframes[1].keyframe, 9U);
  EXPECT_EQ(AnchorsOf(edit, paths, Of({1, 7})).keyframes[0].keyframe, 5U);
  EXPECT_EQ(AnchorsOf(Line({3.5, 1.0}, {3.8, 1.0}), paths, Of({1})).keyframes.size(), 1U);
  EXPECT_TRUE(AnchorsOf(edit, paths, Of({})).keyframes.empty());
}

TEST(EditAnchors, AKeyframeBehindAWallCountsOnlyWhereNoOtherIsNear) {
  const DrawnPaths paths = {{1, PathWith({{0, 0, 0}, {3, 0, 0}}, {0, 1})}};
  EXPECT_EQ(AnchorsOf(Line({2.0, 0.0}, {2.2, 0.0}), paths, Of({1}, 2.5)).keyframes.at(0).keyframe, 0U);
  EXPECT_EQ(AnchorsOf(Line({2.0, 30.0}, {2.2, 30.0}), paths, Of({1}, 2.5)).keyframes.at(0).keyframe, 1U);
  EXPECT_EQ(AnchorsOf(Line({-2.0, 0.0}, {-2.2, 0.0}), paths, Of({1}, -1.0)).keyframes.at(0).keyframe, 0U);
}

TEST(EditAnchors, AllKeyframesThatMoveTogetherTakeTheEditWithThem) {
  EditAnchors anchors{.points_then = {{10, 4}, {30, 4}},
                      .keyframes = {{1, 0, {10, 0, 1}, {10, 0, 1}}, {1, 9, {30, 0, 2}, {30, 0, 2}}}};
  EXPECT_EQ(MotionOf(anchors), Pose2{}) << "exactly";
  const Pose2 motion{-3.0, 2.0, 0.4};
  for (EditAnchor& one : anchors.keyframes) one.T_map_now = motion * one.T_map_then;
  EXPECT_LT(Away(MotionOf(anchors), motion), 1e-9);
}

TEST(EditAnchors, ThePlacesOfKeyframesFarApartTurnAnEditAndThoseOfNearOnesHardlyDo) {
  // The far end of a corridor of 40 m has moved aside by 2 m: a wall along it turns by 0.05.
  const EditAnchors corridor{.points_then = {{0, 1}, {40, 1}},
                             .keyframes = {{1, 0, {0, 0, 0}, {0, 0, 0}}, {1, 9, {40, 0, 0}, {40, 2, 0.1}}}};
  EXPECT_NEAR(MotionOf(corridor).theta, 0.05, 0.01);
  EXPECT_NEAR((MotionOf(corridor) * Eigen::Vector2d(40, 1)).y(), 3.0, 0.1);
  // Both ends of a wall of 20 cm lie beside keyframes of their own, of which one has moved by 5 cm.
  const EditAnchors piece{.points_then = {{0, 0.5}, {0.2, 0.5}},
                          .keyframes = {{1, 0, {0, 0, 0}, {0, 0, 0}}, {2, 9, {0.2, 0, 0}, {0.2, 0.05, 0}}}};
  EXPECT_LT(std::abs(MotionOf(piece).theta), 0.01);
  EXPECT_NEAR((MotionOf(piece) * Eigen::Vector2d(0.1, 0.5)).y(), 0.525, 1e-3);
}

TEST(EditAnchors, OfPosesBeforeThoseStayThatThereAreAfterwards) {
  const DrawnPath before = PathWith({{1, 0, 0}, {2, 0, 0}, {3, 0, 0}}, {4, 6, 7});
  const DrawnPath after = PathWith({{10, 0, 0}, {30, 0, 0}, {40, 0, 0}}, {4, 7, 8});
  const DrawnPath kept = PosesBefore(before, after);
  EXPECT_EQ(*kept.numbers, (std::vector<std::uint64_t>{4, 7}));
  EXPECT_EQ(kept.Find(7)->x, 3.0);
  EXPECT_EQ(kept.Find(6), nullptr);
  const DrawnPath all{std::make_shared<const std::vector<Pose2>>(std::vector<Pose2>(3)), nullptr};
  EXPECT_NE(all.Find(2), nullptr);
  EXPECT_EQ(all.Find(3), nullptr);
  EXPECT_EQ(DrawnPath{}.Find(0), nullptr);
}

}  // namespace
}  // namespace cairn::server
