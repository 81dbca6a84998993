#include "client/cli/edit_warning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cairn::client {
namespace {

TEST(EditWarning, IsForEditsThatLieOutsideOfTheMap) {
  MapInfo map;
  map.tile_count = 4;
  map.x_min_m = -10.0;
  map.x_max_m = 20.0;
  map.y_min_m = 0.0;
  map.y_max_m = 15.0;
  MapEdit edit;
  edit.kind = MapEditKind::kKeepOut;
  edit.points_map = {{1, 1}, {2, 1}, {2, 3}};
  EXPECT_EQ(EditWarning(edit, map), "");
  edit.points_map = {{1, -1}, {2, -1}, {2, -3}};  // The wrong sign.
  EXPECT_THAT(EditWarning(edit, map), ::testing::HasSubstr("from -10.0,0.0 to 20.0,15.0 m"));
  edit.points_map.emplace_back(2, 1);
  EXPECT_EQ(EditWarning(edit, map), "") << "a part of it is inside";
  edit.points_map = {{-30, -30}, {40, -30}, {40, 40}, {-30, 40}};
  EXPECT_EQ(EditWarning(edit, map), "") << "all of the map is inside";
  edit.points_map = {{30, 1}, {31, 1}};
  EXPECT_NE(EditWarning(edit, map), "");
  map.tile_count = 0;  // The server says so itself.
  EXPECT_EQ(EditWarning(edit, map), "");
}

}  // namespace
}  // namespace cairn::client
