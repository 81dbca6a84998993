// Edits of maps that earlier versions have stored hang on keyframes once a server has read them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string_view>

#include "server/store/site_contents.h"
#include "tests/server/support/stored_server.h"
#include "tests/temp_directory.h"

namespace cairn::server::testing {
namespace {

Request OfSavedSite(RequestKind kind) {
  Request request = About(kind, "");
  request.saved = "golden";
  return request;
}

class GoldenEdits : public ::testing::TestWithParam<const char*> {};

TEST_P(GoldenEdits, AreReadAndHangOnKeyframes) {
  const char* const source = std::getenv("CAIRN_SOURCE_DIR");
  ASSERT_NE(source, nullptr);
  const TempDirectory directory;
  const auto saved = directory / "0" / "saved";
  std::filesystem::create_directories(saved);
  std::filesystem::copy_file(std::filesystem::path(source) / "tests" / "golden" / GetParam(), saved / "golden.site");
  {
    StoredServer server(directory / "0");
    const Reply loaded = server->Ask(OfSavedSite(RequestKind::kSiteLoad));
    ASSERT_TRUE(loaded.status.ok()) << loaded.status.message;
    const Reply reply = server->Ask(OfSavedSite(RequestKind::kMapEdits));
    ASSERT_EQ(reply.edits.size(), 2U);
    EXPECT_EQ(reply.edits[0].kind, MapEditKind::kKeepOut);
    EXPECT_EQ(reply.edits[0].note, "stairs");
    EXPECT_LT((reply.edits[0].points_map[2] - Eigen::Vector2d(2.0, 1.0)).norm(), 0.05);
    EXPECT_EQ(reply.edits[1].width_m, 0.1);
  }
  const auto store = *OpenStore(directory / "0");
  const auto site = ReadSite(*store, "lab");
  ASSERT_TRUE(site);
  ASSERT_EQ(site->site.anchors.size(), 2U);
  for (const auto& [edit, anchors] : site->site.anchors) {
    EXPECT_FALSE(anchors.keyframes.empty()) << edit;
    for (const EditAnchor& one : anchors.keyframes) EXPECT_TRUE(site->sessions.contains(one.session)) << edit;
  }
}

INSTANTIATE_TEST_SUITE_P(EveryVersion, GoldenEdits,
                         ::testing::Values("site-v2-edits.site", "site-v2-anchored-edits.site"),
                         [](const ::testing::TestParamInfo<const char*>& file) {
                           return std::string_view(file.param).find("anchored") != std::string_view::npos
                                      ? "Anchored"
                                      : "OfAnOlderServer";
                         });

}  // namespace
}  // namespace cairn::server::testing
