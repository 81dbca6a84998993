// `cairn cloud export` as whole command lines that need no server: a simulated robot that nods, its log, its true path.
#include "client/cli/cloud_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "client/cli/program.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;

struct Outcome {
  ExitCode code;
  std::string out;
  std::string err;
};

class CloudExport : public ::testing::Test {
 protected:
  static Outcome Cairn(const std::vector<std::string>& arguments) {
    std::ostringstream out, err;
    const ExitCode code = RunCairn(arguments, out, err);
    return {code, out.str(), err.str()};
  }
  void Simulate() {
    const Outcome outcome = Cairn({"sim",
                                   "--no-stream",
                                   "--world",
                                   "hall3d",
                                   "--robots",
                                   "1",
                                   "--seconds",
                                   "14",
                                   "--hz",
                                   "5",
                                   "--laser-model",
                                   "thesis",
                                   "--nod=-60,40,20",
                                   "--nod-every",
                                   "30",
                                   "--first-stamp",
                                   "1000",
                                   "--log-dir",
                                   File(""),
                                   "--truth-dir",
                                   File("")});
    ASSERT_EQ(outcome.code, ExitCode::kOk) << outcome.err;
  }
  Outcome Export(const std::string& file, std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"cloud", "export", File("robot1.log"), "--trajectory", File("robot1.tum"), "--height",
                               "0.4", "-o", File(file)});
    return Cairn(more);
  }
  [[nodiscard]] std::string File(const std::string& name) const { return (directory_ / name).string(); }

  TempDirectory directory_;
};

TEST_F(CloudExport, EveryFormatHoldsTheSameCloudAndItLiesOnTheWalls) {
  ASSERT_NO_FATAL_FAILURE(Simulate());
  const Outcome ply = Export("a.ply", {"--truth-world", "hall3d", "--json"});
  ASSERT_EQ(ply.code, ExitCode::kOk) << ply.err;
  const auto report = nlohmann::json::parse(ply.out);
  EXPECT_GE(report["scans_tilted"], 20);
  EXPECT_GT(report["points"], 8000);
  EXPECT_EQ(report["scans_invalid"], 0);
  EXPECT_LT(report["wall_error_m"]["mean"], 0.015);  // The laser's sigma of 15 mm, seen across the surfaces.
  ASSERT_EQ(Export("b.ply", {"--text"}).code, ExitCode::kOk);
  ASSERT_EQ(Export("c.pcd").code, ExitCode::kOk);
  ASSERT_EQ(Export("d.pcd", {"--text"}).code, ExitCode::kOk);
  const auto cloud = ReadCloud(File("a.ply"));
  ASSERT_TRUE(cloud);
  EXPECT_EQ(cloud->size(), report["points"]);
  for (const char* other : {"b.ply", "c.pcd", "d.pcd"}) {
    const auto same = ReadCloud(File(other));
    ASSERT_TRUE(same) << same.error().message;
    EXPECT_EQ(*same, *cloud) << other;
  }
}

TEST_F(CloudExport, OptionsThinAndChoose) {
  ASSERT_NO_FATAL_FAILURE(Simulate());
  const auto points = [&](const std::vector<std::string>& more) {
    auto arguments = more;
    arguments.push_back("--json");
    return nlohmann::json::parse(Export("a.ply", arguments).out)["points"].get<int>();
  };
  const int all = points({});
  EXPECT_LT(points({"--voxel", "0.1"}), all / 2);
  EXPECT_LT(points({"--tilted-only"}), all);
  EXPECT_LT(points({"--max-range", "2"}), all);
  EXPECT_THAT(Export("a.ply").out, HasSubstr("tilted)"));
}

TEST_F(CloudExport, NonsenseIsAUsageErrorAndBadFilesFail) {
  ASSERT_NO_FATAL_FAILURE(Simulate());
  const std::string log = File("robot1.log"), tum = File("robot1.tum");
  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
           {"cloud"},
           {"cloud", "export", log},
           {"cloud", "export", log, "-o", File("a.ply")},
           {"cloud", "export", log, "-o", File("a.ply"), "--robot", "r", "--trajectory", tum},
           {"cloud", "export", log, "-o", File("a.xyz"), "--trajectory", tum},
           {"cloud", "export", log, "-o", File("a.ply"), "--trajectory", tum, "--voxel", "-1"},
           {"sim", "--no-stream", "--world", "hall3d", "--nod=-60,40"},
           {"sim", "--no-stream", "--world", "hall3d", "--nod=-95,40,10"},
           {"sim", "--no-stream", "--world", "hall3d", "--nod=-60,40,1.5"},
           {"sim", "--no-stream", "--nod-every", "5"},
           {"sim", "--no-stream", "--laser-model", "lms9000"},
           {"sim", "--no-stream", "--laser-model", "lms200", "--beams", "10"},
           {"sim", "--no-stream", "--error", "guess"}})
    EXPECT_EQ(Cairn(wrong).code, ExitCode::kUsage) << ::testing::PrintToString(wrong);
  for (const auto& [arguments, message] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"cloud", "export", File("absent.log"), "-o", File("a.ply"), "--trajectory", tum}, "no such file"},
           {{"cloud", "export", log, "-o", File("a.ply"), "--trajectory", File("absent.tum")}, "absent.tum"},
           {{"cloud", "export", log, "-o", File("no/a.ply"), "--trajectory", tum}, "no/a.ply"},
           {{"cloud", "export", log, "-o", File("a.ply"), "--trajectory", tum, "--truth-world", "mars"}, "mars"},
           {{"cloud", "export", log, "-o", File("a.ply"), "--trajectory",
             directory_.Write("far.tum", "5 0 0 0 0 0 0 1\n").string()},
            "no scan could be placed"},
           {{"sim", "--no-stream", "--world", "hall3d", "--nod=-60,40,10", "--nod-every", "3"}, "level scans"},
           {{"sim", "--no-stream", "--world", directory_.Write("bad.yaml", "cairn-world3: 7\n").string()},
            "bad.yaml"}}) {
    const Outcome outcome = Cairn(arguments);
    EXPECT_EQ(outcome.code, ExitCode::kFailed) << ::testing::PrintToString(arguments);
    EXPECT_THAT(outcome.err, HasSubstr(message));
  }
}

}  // namespace
}  // namespace cairn::client
