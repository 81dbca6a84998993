#include "common/map/map_edit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <set>

namespace cairn {
namespace {

using Cell = std::pair<int, int>;
constexpr double kCell_m = 0.05;

MapEdit Box(double x_m, double y_m, double width_m, double height_m) {
  MapEdit edit;
  edit.points_map = {{x_m, y_m}, {x_m + width_m, y_m}, {x_m + width_m, y_m + height_m}, {x_m, y_m + height_m}};
  return edit;
}

MapEdit Line(std::vector<Eigen::Vector2d> points, double width_m) {
  MapEdit edit;
  edit.kind = MapEditKind::kOccupied;
  edit.points_map = std::move(points);
  edit.width_m = width_m;
  return edit;
}

std::set<Cell> Cells(const MapEdit& edit) {
  EXPECT_TRUE(ValidateMapEdit(edit));
  std::set<Cell> cells;
  for (const CellRun& run : CellsOf(edit, kCell_m))
    for (int x = run.x_first; x <= run.x_last; ++x) cells.emplace(x, run.y);
  return cells;
}

TEST(MapEdit, ABoxHasTheCellsWhoseCentresAreInIt) {
  const std::set<Cell> cells = Cells(Box(-0.1, 0.0, 0.2, 0.1));
  const std::set<Cell> expected{{-2, 0}, {-1, 0}, {0, 0}, {1, 0}, {-2, 1}, {-1, 1}, {0, 1}, {1, 1}};
  EXPECT_EQ(cells, expected);
  EXPECT_TRUE(Cells(Box(0.03, 0.03, 0.015, 0.015)).empty()) << "no centre is in it";
}

// Neighbouring areas share no cell and leave none out, wherever their common edge is.
TEST(MapEdit, AreasThatShareAnEdgeShareNoCell) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> place_m(-2.0, 2.0);
  for (int round = 0; round < 50; ++round) {
    const Eigen::Vector2d a(place_m(random), -3.0), b(place_m(random), 3.0);
    MapEdit left, right, both = Box(-3.0, -3.0, 6.0, 6.0);
    left.points_map = {{-3.0, -3.0}, a, b, {-3.0, 3.0}};
    right.points_map = {a, {3.0, -3.0}, {3.0, 3.0}, b};
    EXPECT_EQ(Cells(left).size() + Cells(right).size(), Cells(both).size());
  }
}

// The plain definition of "inside": an odd number of edges to the right of the point.
TEST(MapEdit, AnAreaAgreesWithEveryCellTriedInTurn) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> place_m(-1.5, 1.5);
  for (int round = 0; round < 100; ++round) {
    MapEdit edit;
    for (int i = 0; i < 3 + round % 7; ++i) edit.points_map.emplace_back(place_m(random), place_m(random));
    if (!ValidateMapEdit(edit)) continue;
    const std::set<Cell> cells = Cells(edit);
    for (int y = -32; y < 32; ++y) {
      for (int x = -32; x < 32; ++x) {
        const Eigen::Vector2d centre((x + 0.5) * kCell_m, (y + 0.5) * kCell_m);
        bool inside = false;
        for (std::size_t i = 0; i < edit.points_map.size(); ++i) {
          const Eigen::Vector2d& a = edit.points_map[i];
          const Eigen::Vector2d& b = edit.points_map[(i + 1) % edit.points_map.size()];
          if ((a.y() > centre.y()) == (b.y() > centre.y())) continue;
          if (centre.x() < a.x() + (centre.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x())) inside = !inside;
        }
        ASSERT_EQ(cells.contains({x, y}), inside) << "round " << round << ", cell " << x << ", " << y;
      }
    }
  }
}

TEST(MapEdit, AThinLineHasNoGapsAndAWideOneItsWidth) {
  const std::set<Cell> thin = Cells(Line({{0.0, 0.0}, {2.0, 1.3}, {2.0, -1.0}}, 0.01));
  // From its beginning to its end by steps to one of the four neighbours.
  std::set<Cell> reached;
  std::function<void(Cell)> walk = [&](Cell cell) {
    if (!thin.contains(cell) || !reached.insert(cell).second) return;
    for (const Cell& step : {Cell{1, 0}, Cell{-1, 0}, Cell{0, 1}, Cell{0, -1}})
      walk({cell.first + step.first, cell.second + step.second});
  };
  walk({0, 0});
  EXPECT_EQ(reached, thin);
  EXPECT_TRUE(thin.contains({40, -20}) || thin.contains({39, -20}));
  const std::set<Cell> wide = Cells(Line({{0.0, 0.0}, {4.0, 0.0}}, 1.0));
  EXPECT_TRUE(wide.contains({40, 9}));
  EXPECT_TRUE(wide.contains({40, -10}));
  EXPECT_FALSE(wide.contains({40, 10}));
  EXPECT_FALSE(wide.contains({40, -11}));
}

TEST(MapEdit, AnOriginIsTwoPointsApart) {
  MapEdit origin;
  origin.kind = MapEditKind::kOrigin;
  origin.points_map = {{1, 2}, {1.5, 2}};
  EXPECT_TRUE(ValidateMapEdit(origin).has_value());
  for (const auto& points :
       std::vector<std::vector<Eigen::Vector2d>>{{{1, 2}}, {{1, 2}, {1, 2}}, {{1, 2}, {2, 2}, {2, 3}}}) {
    MapEdit bad = origin;
    bad.points_map = points;
    EXPECT_FALSE(ValidateMapEdit(bad).has_value()) << points.size();
  }
  origin.width_m = 0.1;
  EXPECT_FALSE(ValidateMapEdit(origin).has_value());
}

TEST(MapEdit, WhatNobodyCanMeanIsRefusedWithTheReason) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  MapEdit kind = Box(0, 0, 1, 1);
  kind.kind = static_cast<MapEditKind>(9);
  MapEdit note = Box(0, 0, 1, 1);
  note.note = std::string(kMostEditNoteBytes + 1, 'n');
  MapEdit two;
  two.points_map = {{0, 0}, {1, 1}};
  MapEdit flat;
  flat.points_map = {{0, 0}, {1, 1}, {2, 2}};
  const std::vector<MapEdit> bad = {kind,
                                    note,
                                    two,
                                    flat,
                                    MapEdit{},
                                    Box(nan, 0, 1, 1),
                                    Box(0, 0, std::numeric_limits<double>::infinity(), 1),
                                    Box(20000, 0, 1, 1),
                                    Box(0, 0, 101, 1),
                                    Line({{0, 0}}, 0.1),
                                    Line({{0, 0}, {1, 0}}, 0.001),
                                    Line({{0, 0}, {1, 0}}, 11.0),
                                    Line({{0, 0}, {1, 0}}, nan),
                                    Line({{0, 0}, {1, 0}}, -0.1),
                                    Line(std::vector<Eigen::Vector2d>(kMostEditPoints + 1), 0.1)};
  for (std::size_t i = 0; i < bad.size(); ++i) {
    const auto valid = ValidateMapEdit(bad[i]);
    ASSERT_FALSE(valid) << i;
    EXPECT_EQ(valid.error().code, StatusCode::kInvalidArgument);
    EXPECT_GT(valid.error().message.size(), 10U);
  }
  EXPECT_TRUE(ValidateMapEdit(Box(0, 0, 70, 70)));
}

// It is shown in the terminals of others, and stored in a format that keeps no other texts.
TEST(MapEdit, ANoteIsTextThatCanBePrinted) {
  const auto is_valid = [](const std::string& note) {
    MapEdit edit = Box(0, 0, 1, 1);
    edit.note = note;
    return ValidateMapEdit(edit).has_value();
  };
  for (const char* good : {"", "a pallet", "T\u00fcr", "\u51fa\u53e3", "\U0001F6AA", "\u00a0", "\ud7ff", "\U0010ffff"})
    EXPECT_TRUE(is_valid(good)) << good;
  using namespace std::string_literals;
  for (const std::string& bad :
       {"T\xfcr"s, "\x1b[2J"s, "a\nb"s, "\0"s, "\x7f"s, "\xc2\x9b"s, "\xc0\xaf"s, "\xe0\x80\xaf"s, "\xed\xa0\x80"s,
        "\xf4\x90\x80\x80"s, "\xf8\x88\x80\x80\x80"s, "\xe5\x87"s, "\xe5\x87z"s, "\x80"s, "\xff"s})
    EXPECT_FALSE(is_valid(bad)) << bad;
}

TEST(MapEdit, OneThatIsAsLargeAsItMayBeStaysValidWhereItIsMoved) {
  const MapEdit edit = Line({{0.0, 0.0}, {kFarthestInEdit_m, 0.0}}, 0.1);
  ASSERT_TRUE(ValidateMapEdit(edit));
  for (int i = 0; i < 100; ++i) {
    const MapEdit moved = Moved(edit, {13.7 * i, -0.3 * i, 0.1 * i});
    EXPECT_TRUE(ValidateMapEdit(moved)) << i;
    EXPECT_NEAR((moved.points_map[1] - moved.points_map[0]).norm(), kFarthestInEdit_m, 1e-9);
  }
}

}  // namespace
}  // namespace cairn
