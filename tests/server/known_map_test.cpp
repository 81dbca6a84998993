#include "server/known_map.h"

#include <gtest/gtest.h>

#include "tests/temp_directory.h"

namespace cairn::server {
namespace {

slam::MapperOptions LineMatch(const std::string& file) {
  slam::MapperOptions options;
  options.filter.kind = slam::FilterKind::kLineMatch;
  options.filter.line_match.file = file;
  return options;
}

TEST(KnownMap, IsReadWhereTheFilterWantsOne) {
  const TempDirectory directory;
  auto options = LineMatch(directory.Write("lines", "cairn-map-lines 1\nwall 0 0 1 0\n"));
  ASSERT_TRUE(LoadKnownMap(options));
  ASSERT_TRUE(options.filter.line_match.map);
  EXPECT_EQ(options.filter.line_match.map->size(), 2U);
}

TEST(KnownMap, OtherFiltersNeedNone) {
  slam::MapperOptions options;
  options.filter.line_match.file = "/nowhere";
  EXPECT_TRUE(LoadKnownMap(options));
}

TEST(KnownMap, ErrorsNameTheKey) {
  const auto complaint = [](slam::MapperOptions options) { return LoadKnownMap(options).error().message; };
  EXPECT_EQ(complaint(LineMatch("")),
            "slam.line_match.map is empty; slam.filter line_match needs the name of the map file there");
  EXPECT_NE(complaint(LineMatch("/nowhere")).find("slam.line_match.map: /nowhere"), std::string::npos);
}

}  // namespace
}  // namespace cairn::server
