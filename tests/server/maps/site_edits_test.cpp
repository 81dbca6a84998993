// What people say about a site's map.
#include <gtest/gtest.h>

#include <cmath>
#include <future>
#include <set>
#include <string>

#include "tests/server/maps/site_sessions.h"

namespace cairn::server {
namespace {

class SiteEdits : public testing::SiteTest {
 protected:
  Result<std::uint64_t> AddEdit(MapEdit edit) {
    std::promise<Result<std::uint64_t>> done;
    site_->AddEdit(std::move(edit), [&](Result<std::uint64_t> result) { done.set_value(std::move(result)); });
    return done.get_future().get();
  }
  Result<std::uint64_t> RemoveEdit(std::uint64_t id) {
    std::promise<Result<std::uint64_t>> done;
    site_->RemoveEdit(id, [&](Result<std::uint64_t> result) { done.set_value(std::move(result)); });
    return done.get_future().get();
  }
};

// What a person says stays over what robots draw, also in another version of the map.
TEST_F(SiteEdits, AnEditIsPublishedAndStaysWhenTheMapIsSwitched) {
  MapEdit edit;
  edit.points_map = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  EXPECT_EQ(AddEdit(edit).error().code, StatusCode::kFailedPrecondition) << "nothing is drawn yet";
  EXPECT_FALSE(site_->begun());
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(300)}}});
  TakeTiles();
  const auto cell = [this] {
    const auto tile = site_->snapshot()->tiles.Find({0, 0, 0});
    return (*DecodeCells(tile->bytes, tile->encoding))[0];
  };
  EXPECT_GT(cell(), 90);
  const std::uint64_t version = site_->snapshot()->info.version;
  EXPECT_EQ(AddEdit(edit), 1U);
  EXPECT_EQ(cell(), 0);
  EXPECT_GT(site_->snapshot()->info.version, version);
  EXPECT_EQ(site_->snapshot()->info.edits_version, 1U);
  ASSERT_EQ(site_->snapshot()->edits->size(), 1U);
  EXPECT_EQ(TakeTiles().size(), 4U);

  auto enabled = Enable(AddVersion({{1, {{{{0, 0}, UniformChunk(200)}}, 3}}}));
  corrections_.at(0).second.done({.session = 1,
                                  .displaced = {{{{0, 0}, UniformChunk(300)}}, 5},
                                  .change = {.session = 1, .chunks = {{{0, 0}, UniformChunk(200)}}}});
  ASSERT_TRUE(enabled.get());
  TakeTiles();
  EXPECT_EQ(cell(), 0);

  EXPECT_EQ(RemoveEdit(2).error().code, StatusCode::kNotFound);
  EXPECT_EQ(RemoveEdit(1), 2U);
  EXPECT_GT(cell(), 80);
  EXPECT_TRUE(site_->snapshot()->edits->empty());
}

// A robot that does not say where it is begins the map, also where an edit is all that is left.
TEST_F(SiteEdits, EditsAloneAreNoMap) {
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(300)}}});
  TakeTiles();
  MapEdit edit;
  edit.points_map = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  EXPECT_EQ(AddEdit(edit), 1U);
  EXPECT_TRUE(site_->begun());
  site_->Hide(1);
  TakeTiles();
  EXPECT_EQ(site_->snapshot()->info.tile_count, 1U);
  EXPECT_FALSE(site_->begun());
}

MapEdit Box(double x_m, double y_m, double side_m) {
  MapEdit edit;
  edit.points_map = {{x_m, y_m}, {x_m + side_m, y_m}, {x_m + side_m, y_m + side_m}, {x_m, y_m + side_m}};
  return edit;
}

// A tile far away would make the whole map too large for everybody.
TEST_F(SiteEdits, OneFarFromTheMapIsRefused) {
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(300)}, {{2, 1}, UniformChunk(300)}}});
  TakeTiles();
  const auto far = AddEdit(Box(1500, 0, 1));
  ASSERT_FALSE(far);
  EXPECT_EQ(far.error().code, StatusCode::kFailedPrecondition);
  EXPECT_NE(far.error().message.find("from 0.0,0.0 to 19.2,12.8 m"), std::string::npos) << far.error().message;
  EXPECT_FALSE(AddEdit(Box(-21, 0, 1)));
  EXPECT_EQ(AddEdit(Box(std::nan(""), 0, 1)).error().code, StatusCode::kInvalidArgument);
  EXPECT_TRUE(AddEdit(Box(-19, 0, 1)));
}

TEST_F(SiteEdits, WhatAnEditAloneHasMadeIsDeletedWithIt) {
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(300)}}});
  TakeTiles();
  EXPECT_EQ(AddEdit(Box(-3, 1, 1)), 1U);
  std::set<TileKey> made;
  for (const TileSample& sample : TakeTiles()) made.insert(sample.tile.key);
  EXPECT_TRUE(made.contains({0, -1, 0}));
  EXPECT_TRUE(RemoveEdit(1));
  std::set<TileKey> deleted;
  for (const TileSample& sample : TakeTiles())
    if (sample.deleted) deleted.insert(sample.tile.key);
  EXPECT_TRUE(deleted.contains({0, -1, 0}));
  EXPECT_TRUE(deleted.contains({1, -1, 0})) << "also of coarser levels";
  EXPECT_FALSE(deleted.contains({0, 0, 0}));
}

TEST_F(SiteEdits, ADeletedSiteTakesNone) {
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(300)}}});
  TakeTiles();
  EXPECT_EQ(AddEdit(Box(0, 0, 1)), 1U);
  std::promise<void> retired;
  site_->Retire([&](const auto&...) { retired.set_value(); });
  retired.get_future().wait();
  EXPECT_EQ(AddEdit(Box(0, 0, 1)).error().code, StatusCode::kNotFound);
  EXPECT_EQ(RemoveEdit(1).error().code, StatusCode::kNotFound);
}

// They say something of places in a map that is gone.
TEST_F(SiteEdits, AreForgottenWhenARobotBeginsTheMapAnew) {
  site_->Change({.session = 1, .chunks = {{{0, 0}, UniformChunk(300)}}});
  TakeTiles();
  EXPECT_EQ(AddEdit(Box(0, 0, 1)), 1U);
  site_->ForgetEditsOfLostMap();
  Settle();
  EXPECT_EQ(site_->snapshot()->edits->size(), 1U) << "it is drawn";
  site_->Hide(1);
  TakeTiles();
  EXPECT_EQ(site_->snapshot()->edits->size(), 1U);
  site_->ForgetEditsOfLostMap();
  Settle();
  EXPECT_TRUE(site_->snapshot()->edits->empty());
  EXPECT_EQ(site_->snapshot()->info.edits_version, 2U);
  EXPECT_EQ(site_->snapshot()->info.tile_count, 0U);
}

}  // namespace
}  // namespace cairn::server
