// Every question on hand-made snapshots: answers are functions of values, so there is nothing else to set up.
#include <gtest/gtest.h>

#include "server/queries/answers.h"

namespace cairn::server {
namespace {

constexpr Generation kGeneration = 5;

Reply Whole(Answer&& answer) {
  Reply reply = std::move(answer.reply);
  for (const auto& tile : answer.tiles) reply.tiles.push_back(*tile);
  while (!answer.path.empty()) reply.path.push_back(answer.path.Take());
  return reply;
}

std::vector<Reply> AllParts(Answer&& answer) {
  ReplyParts rest(std::move(answer));
  std::vector<Reply> parts;
  while (auto part = rest.Next()) parts.push_back(*std::move(part));
  return parts;
}

class Queries : public ::testing::Test {
 protected:
  Queries() {
    session_.status.session = {.robot_id = HashName("r1"),
                               .client = 1,
                               .robot = "r1",
                               .site = "lab",
                               .phase = SessionPhase::kActive,
                               .status = {}};
    session_.landmarks = std::make_shared<const std::vector<LandmarkReport>>();
    map_.info.site = "lab";
    map_.info.levels = kPyramidLevels;
    map_.info.resolution_m = 0.05;
    map_.info.epoch = 3;
    map_.info.version = 10;
    request_.client = 11;
    request_.sequence = 12;
    request_.site = "lab";
    request_.robot = "r1";
  }
  void AddPose(Stamp stamp, double x) {
    const Eigen::Matrix3f covariance = 0.01F * static_cast<float>(x) * Eigen::Matrix3f::Identity();
    history_.Append({stamp, {x, 0, 0}, 0.8F, true, PoseReason::kTracking, covariance, {0.1 * x, 0, 0}});
    session_.path = history_.view();
    session_.status.pose.robot = "r1";
    session_.status.pose.stamp = stamp;
    session_.status.pose.T_map_robot = {x, 0, 0};
    session_.status.pose.scan_sequence = static_cast<std::uint64_t>(stamp);
  }
  void AddTile(TileKey key, std::uint64_t version) {
    auto tile = std::make_shared<Tile>();
    tile->key = key;
    tile->epoch = 3;
    tile->version = version;
    map_.tiles = map_.tiles.With({{key, tile}});
  }
  Sessions Robot() { return request_.robot == "r1" ? Sessions{session_} : Sessions{}; }
  Maps Site() { return request_.site == "lab" ? Maps{std::make_shared<const MapSnapshot>(map_)} : Maps{}; }
  Reply Ask(RequestKind kind) {
    switch (kind) {
      case RequestKind::kPose:
        return AnswerPose(request_, Robot());
      case RequestKind::kPath:
        return Whole(AnswerPath(request_, Robot(), Site()));
      case RequestKind::kTiles:
        return Whole(AnswerTiles(request_, Site(), kGeneration));
      case RequestKind::kLandmarks:
        return AnswerLandmarks(request_, {session_}, Site());
      case RequestKind::kMapInfo:
        return AnswerMapInfo(request_,
                             request_.site.empty() ? Maps{std::make_shared<const MapSnapshot>(map_)} : Site());
      case RequestKind::kMapEdits:
        return AnswerMapEdits(request_, Site());
      case RequestKind::kStatus:
        return AnswerStatus(request_, request_.robot.empty() ? Sessions{session_} : Robot());
      default:
        ADD_FAILURE() << "no answer of a snapshot: " << RequestKindName(kind);
        return {};
    }
  }

  PoseHistory history_{1000};
  SessionSnapshot session_;
  MapSnapshot map_;
  Request request_;
};

TEST_F(Queries, PoseSaysNotYetBeforeTheFirstScan) {
  EXPECT_EQ(Ask(RequestKind::kPose).status.code, StatusCode::kUnavailable);
  EXPECT_EQ(Ask(RequestKind::kPose).client, 11U);
  EXPECT_EQ(Ask(RequestKind::kPose).sequence, 12);
}

TEST_F(Queries, PoseAtAStampIsInterpolatedNotYetOrNever) {
  AddPose(100, 1.0);
  AddPose(200, 2.0);
  EXPECT_EQ(Ask(RequestKind::kPose).poses.at(0).T_map_robot.x, 2.0);
  request_.latest = false;
  request_.stamp = 150;
  const PoseReport between = Ask(RequestKind::kPose).poses.at(0);
  EXPECT_DOUBLE_EQ(between.T_map_robot.x, 1.5);
  EXPECT_EQ(between.stamp, 150);
  EXPECT_EQ(between.scan_sequence, 0U);
  EXPECT_NEAR(between.covariance(0, 0), 0.015, 1e-6);  // Between those of its neighbours, not none.
  EXPECT_NEAR(between.T_map_odom.x, 0.15, 1e-9);
  request_.stamp = 200;
  EXPECT_EQ(Ask(RequestKind::kPose).poses.at(0).scan_sequence, 200U);
  request_.stamp = 99;
  EXPECT_EQ(Ask(RequestKind::kPose).status.code, StatusCode::kOutOfRange);
  request_.stamp = 201;
  EXPECT_EQ(Ask(RequestKind::kPose).status.code, StatusCode::kUnavailable);
  session_.status.session.phase = SessionPhase::kEnded;
  EXPECT_EQ(Ask(RequestKind::kPose).status.code, StatusCode::kOutOfRange);
  request_.robot = "r2";
  EXPECT_EQ(Ask(RequestKind::kPose).status.code, StatusCode::kNotFound);
}

TEST_F(Queries, TheNewestPoseComesWithItsHypotheses) {
  AddPose(100, 1.0);
  AddPose(200, 2.0);
  session_.hypotheses = {{200, {2.0, 0.0, 0.0}, 0.75}, {200, {9.0, 0.0, 0.0}, 0.25}};
  EXPECT_EQ(Ask(RequestKind::kPose).hypotheses.size(), 2U) << "where it may be, also if it is lost";
  session_.status.pose.localized = true;
  EXPECT_EQ(Ask(RequestKind::kPose).hypotheses.size(), 2U);
  EXPECT_EQ(Ask(RequestKind::kPose).hypotheses.at(1).weight, 0.25);
  session_.hypotheses.clear();  // As after a restart.
  EXPECT_EQ(Ask(RequestKind::kPose).hypotheses.at(0).T_map_robot.x, 2.0);
  EXPECT_EQ(Ask(RequestKind::kPose).hypotheses.at(0).weight, 1.0);
  session_.status.pose.localized = false;
  EXPECT_TRUE(Ask(RequestKind::kPose).hypotheses.empty()) << "nobody knows where it may be";
  request_.latest = false;
  request_.stamp = 150;
  EXPECT_TRUE(Ask(RequestKind::kPose).hypotheses.empty());
}

TEST_F(Queries, PathIsOnlineOrSmoothed) {
  AddPose(100, 1.0);
  AddPose(200, 2.0);
  EXPECT_EQ(Ask(RequestKind::kPath).path.size(), 2U);
  request_.smoothed = true;
  EXPECT_EQ(Ask(RequestKind::kPath).status.code, StatusCode::kFailedPrecondition);
  map_.smoothed["r1"] = {session_.id, std::make_shared<const Trajectory>(Trajectory{{100, {7, 0, 0}}})};
  const Reply smoothed = Ask(RequestKind::kPath);
  ASSERT_EQ(smoothed.path.size(), 1U);
  EXPECT_EQ(smoothed.path[0].T_map_robot.x, 7.0);
}

// The map was corrected since the poses were published.
TEST_F(Queries, PastPosesLieInThePresentMap) {
  AddPose(100, 1.0);
  AddPose(200, 2.0);
  const std::vector<StampedPose> now = {{100, {1.0, 4.0, 0.0}}, {200, {2.0, 4.0, 0.0}}};
  history_.MoveOnto(now, true, {});
  session_.path = history_.view();
  EXPECT_NEAR(Ask(RequestKind::kPath).path.at(0).T_map_robot.y, 4.0, 1e-9);
  request_.latest = false;
  for (const Stamp stamp : {100, 150}) {
    request_.stamp = stamp;
    EXPECT_NEAR(Ask(RequestKind::kPose).poses.at(0).T_map_robot.y, 4.0, 1e-9) << stamp;
  }
}

// The robot has begun again since: its old path says nothing of where it is.
TEST_F(Queries, TheSmoothedPathOfAnEarlierSessionIsNotThatOfThisOne) {
  AddPose(100, 1.0);
  request_.smoothed = true;
  map_.smoothed["r1"] = {session_.id + 1, std::make_shared<const Trajectory>(Trajectory{{100, {7, 0, 0}}})};
  const Reply reply = Ask(RequestKind::kPath);
  EXPECT_EQ(reply.status.code, StatusCode::kFailedPrecondition);
  EXPECT_TRUE(reply.path.empty());
}

TEST_F(Queries, TilesByAreaLevelAndVersion) {
  AddTile({0, 0, 0}, 5);
  AddTile({0, 1, 0}, 8);
  AddTile({0, -1, -1}, 10);
  AddTile({2, 0, 0}, 10);
  EXPECT_EQ(Ask(RequestKind::kTiles).tiles.size(), 3U);
  request_.area = {7.0, 1.0, 8.0, 2.0};
  EXPECT_EQ(Ask(RequestKind::kTiles).tiles.at(0).key, (TileKey{0, 1, 0}));
  EXPECT_EQ(Ask(RequestKind::kTiles).tiles.size(), 1U);
  request_.area = {};
  request_.since_generation = kGeneration;
  request_.since_epoch = 3;
  request_.since_version = 8;
  EXPECT_EQ(Ask(RequestKind::kTiles).tiles.size(), 1U);
  request_.since_epoch = 2;  // Another epoch: what the asker has is void.
  EXPECT_EQ(Ask(RequestKind::kTiles).tiles.size(), 3U);
  request_.since_epoch = 3;
  request_.since_generation = kGeneration - 1;  // As is what it has of another start of the server.
  EXPECT_EQ(Ask(RequestKind::kTiles).tiles.size(), 3U);
  request_.level = 2;
  EXPECT_EQ(Ask(RequestKind::kTiles).tiles.size(), 1U);
  EXPECT_EQ(Ask(RequestKind::kTiles).map_epoch, 3U);
  EXPECT_EQ(Ask(RequestKind::kTiles).map_version, 10U);
}

TEST_F(Queries, TilesOfTheLayerOfDisagreement) {
  AddTile({0, 0, 0}, 5);
  AddTile({0, 1, 0}, 8);
  request_.disagreement = true;
  EXPECT_TRUE(Ask(RequestKind::kTiles).tiles.empty());
  auto tile = std::make_shared<Tile>();
  tile->key = {0, 7, 7};
  map_.disagreement = map_.disagreement.With({{tile->key, tile}});
  EXPECT_EQ(Ask(RequestKind::kTiles).tiles.at(0).key, (TileKey{0, 7, 7}));
  EXPECT_EQ(Ask(RequestKind::kTiles).tiles.size(), 1U);
}

TEST_F(Queries, TilesOfImpossibleLevelsAndAreasAreRefused) {
  request_.level = 4;
  EXPECT_EQ(Ask(RequestKind::kTiles).status.code, StatusCode::kInvalidArgument);
  request_.level = 0;
  request_.area = {1, 1, 0, 0};
  EXPECT_EQ(Ask(RequestKind::kTiles).status.code, StatusCode::kInvalidArgument);
  request_.area = {0, 0, std::nan(""), 1};
  EXPECT_EQ(Ask(RequestKind::kTiles).status.code, StatusCode::kInvalidArgument);
  request_.site = "moon";
  EXPECT_EQ(Ask(RequestKind::kTiles).status.code, StatusCode::kNotFound);
  EXPECT_EQ(Ask(RequestKind::kLandmarks).status.code, StatusCode::kNotFound);
}

TEST_F(Queries, LandmarksOfTheSiteInTheArea) {
  LandmarkReport near, far;
  near.p_map = {1, 1};
  far.p_map = {50, 50};
  session_.landmarks = std::make_shared<const std::vector<LandmarkReport>>(std::vector<LandmarkReport>{near, far});
  EXPECT_EQ(Ask(RequestKind::kLandmarks).landmarks.size(), 2U);
  request_.area = {0, 0, 2, 2};
  EXPECT_EQ(Ask(RequestKind::kLandmarks).landmarks.size(), 1U);
  session_.status.session.site = "hall";
  EXPECT_TRUE(Ask(RequestKind::kLandmarks).landmarks.empty());
}

TEST_F(Queries, MapInfoOfOneSiteOrAll) {
  EXPECT_EQ(Ask(RequestKind::kMapInfo).maps.at(0).epoch, 3U);
  request_.site = "";
  EXPECT_EQ(Ask(RequestKind::kMapInfo).maps.size(), 1U);
  request_.site = "moon";
  EXPECT_EQ(Ask(RequestKind::kMapInfo).status.code, StatusCode::kNotFound);
}

TEST_F(Queries, TheEditsOfASiteHoweverMany) {
  auto edits = std::make_shared<std::vector<MapEdit>>(4096);
  for (std::size_t i = 0; i < edits->size(); ++i) {
    (*edits)[i].id = i + 1;
    (*edits)[i].points_map.assign(kMostEditPoints, {1.5, -2.5});
  }
  map_.edits = edits;
  std::vector<MapEdit> sent;
  for (const Reply& part : AllParts(AnswerMapEdits(request_, Site()))) {
    EXPECT_LT(part.edits.size(), 50U) << "a part holds less than 64 KB";
    sent.insert(sent.end(), part.edits.begin(), part.edits.end());
  }
  EXPECT_TRUE(sent == *edits);
  request_.site = "moon";
  EXPECT_EQ(Ask(RequestKind::kMapEdits).status.code, StatusCode::kNotFound);
}

TEST_F(Queries, StatusOfOneRobotOrAll) {
  EXPECT_EQ(Ask(RequestKind::kStatus).robots.at(0).session.robot, "r1");
  request_.robot = "";
  EXPECT_EQ(Ask(RequestKind::kStatus).robots.size(), 1U);
  request_.site = "hall";
  EXPECT_TRUE(Ask(RequestKind::kStatus).robots.empty());
  request_.robot = "r2";
  EXPECT_EQ(Ask(RequestKind::kStatus).status.code, StatusCode::kNotFound);
}

TEST(ReplyParts, AnEmptyAnswerIsOnePart) {
  Reply reply;
  reply.status = {StatusCode::kNotFound, "nothing"};
  const auto parts = AllParts(std::move(reply));
  ASSERT_EQ(parts.size(), 1U);
  EXPECT_TRUE(parts[0].last);
  EXPECT_EQ(parts[0].status.code, StatusCode::kNotFound);
}

TEST_F(Queries, ALongPathComesWholeAndInOrder) {
  for (Stamp stamp = 1; stamp <= 700; ++stamp) AddPose(stamp, 0.0);
  const Trajectory path = Ask(RequestKind::kPath).path;
  ASSERT_EQ(path.size(), 700U);
  for (std::size_t i = 0; i < path.size(); ++i) EXPECT_EQ(path[i].stamp, static_cast<Stamp>(i) + 1);
}

TEST(ReplyParts, LargeAnswersKeepOrderAndStaySmall) {
  Reply reply;
  reply.client = 3;
  reply.map_version = 9;
  const auto path = std::make_shared<Trajectory>();
  for (int i = 0; i < 10000; ++i) path->push_back({i, {}});
  std::vector<std::shared_ptr<const Tile>> tiles;
  for (int i = 0; i < 40; ++i) {
    auto tile = std::make_shared<Tile>();
    tile->key = {0, i, 0};
    tile->bytes.resize(16384);
    tiles.push_back(std::move(tile));
  }
  Answer answer(std::move(reply), std::move(tiles));
  answer.path = PathItems(std::shared_ptr<const Trajectory>(path));
  const auto parts = AllParts(std::move(answer));
  Stamp next_stamp = 0;
  int next_tile = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    EXPECT_EQ(parts[i].part, i);
    EXPECT_EQ(parts[i].last, i + 1 == parts.size());
    EXPECT_EQ(parts[i].client, 3U);
    EXPECT_EQ(parts[i].map_version, 9U);
    std::size_t bytes = parts[i].path.size() * 32;
    for (const StampedPose& pose : parts[i].path) EXPECT_EQ(pose.stamp, next_stamp++);
    for (const Tile& tile : parts[i].tiles) {
      EXPECT_EQ(tile.key.x, next_tile++);
      bytes += tile.bytes.size();
    }
    EXPECT_LE(bytes, kPartBudgetBytes);
  }
  EXPECT_EQ(next_stamp, 10000);
  EXPECT_EQ(next_tile, 40);
}

}  // namespace
}  // namespace cairn::server
