// `cairn site` against cairnd as a process and against its state directory: what operators do with whole sites.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <sstream>

#include "client/cli/program.h"
#include "common/map/occupancy_image.h"
#include "tests/child_process.h"
#include "tests/eventually.h"
#include "tests/loopback.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;

struct SiteOutcome {
  ExitCode code;
  std::string out;
  std::string err;
};

class CairnSite : public ::testing::Test {
 protected:
  void StartServer(const std::string& state) {
    server_.emplace(std::vector<std::string>{CAIRND_PATH, "--domain", std::to_string(test::TestDomain()), "--state",
                                             File(state), "--set", "slam.particles=20", "--log-level", "warn"});
    ASSERT_EQ(Cairn({"ping"}).code, ExitCode::kOk) << "cairnd does not answer";
  }
  void StopServer() {
    server_->Signal(SIGTERM);
    EXPECT_EQ(server_->Wait().exit_code, 0);
    server_.reset();
  }
  static SiteOutcome Cairn(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"--domain", std::to_string(test::TestDomain()), "--timeout", "20s"});
    std::ostringstream out, err;
    const ExitCode code = RunCairn(arguments, out, err);
    return {code, out.str(), err.str()};
  }
  static nlohmann::json MustJson(std::vector<std::string> arguments) {
    arguments.push_back("--json");
    const SiteOutcome outcome = Cairn(std::move(arguments));
    EXPECT_EQ(outcome.code, ExitCode::kOk) << outcome.err;
    return outcome.out.empty() ? nlohmann::json() : nlohmann::json::parse(outcome.out);
  }
  // Two robots, 8 s each.
  void Stream(const std::string& site, const std::string& prefix) {
    MustJson({"sim", "--robots", "2", "--prefix", prefix, "--seconds", "8", "--fast", "--beams", "121", "--site", site,
              "--first-stamp", "1000", "--end"});
  }
  std::string PathOf(const std::string& robot) {
    MustJson({"path", robot, "-o", File("path.tum")});
    return directory_.Read("path.tum");
  }
  // The sites of a state directory and the robots that have sessions in each.
  static std::map<std::string, std::set<std::string>> SitesIn(const std::string& state) {
    std::map<std::string, std::set<std::string>> sites;
    const nlohmann::json listed = MustJson({"site", "list", "--state", state});
    for (const auto& site : listed["sites"]) {
      std::set<std::string>& robots = sites[site["site"].get<std::string>()];
      for (const auto& session : site["sessions"]) robots.insert(session["robot"].get<std::string>());
    }
    return sites;
  }
  // Runs `cairn site COMMAND... --state DIR` on copies of a state directory. The system kills it at its first write
  // beyond a file size, which is small at first and grows until the command ends before: within the write-ahead log
  // and, after that, while the log is copied into the database. Calls `check` with the directory that is left. Returns
  // how often it was killed.
  int KillAtEachSize(const std::string& state, std::vector<std::string> command,
                     const std::function<void(const std::string& state)>& check) {
    constexpr double kFirst_bytes = 2048.0, kGrowth = 1.4, kLast_bytes = 1e9;
    command.insert(command.begin(), {"/usr/bin/prlimit", "--core=0", "", CAIRN_PATH, "site"});
    command.insert(command.end(), {"--state", ""});
    int kills = 0;
    for (double bytes = kFirst_bytes; bytes < kLast_bytes; bytes *= kGrowth) {
      const TempDirectory place;
      command.back() = (place / state).string();
      std::filesystem::copy(File(state), command.back(), std::filesystem::copy_options::recursive);
      command[2] = "--fsize=" + std::to_string(static_cast<std::uint64_t>(bytes));
      const auto outcome = ChildProcess(command).Wait();
      EXPECT_THAT(outcome.exit_code, ::testing::AnyOf(0, -1)) << outcome.output;
      check(command.back());
      if (outcome.exit_code >= 0) break;
      ++kills;
    }
    return kills;
  }
  [[nodiscard]] std::string File(const std::string& name) const { return (directory_ / name).string(); }

  TempDirectory directory_;
  std::optional<ChildProcess> server_;
};

TEST_F(CairnSite, IsSavedDeletedLoadedAndMovedToAnotherServer) {
  ASSERT_NO_FATAL_FAILURE(StartServer("a"));
  Stream("hall", "robot");
  const std::string path = PathOf("robot2");
  EXPECT_EQ(MustJson({"site", "save", "hall", "monday"})["site"], "hall");
  MustJson({"site", "delete", "hall"});
  EXPECT_TRUE(MustJson({"site", "list"})["sites"].empty());
  MustJson({"site", "load", "monday"});
  const auto listed = MustJson({"site", "list"});
  EXPECT_EQ(listed["sites"][0]["site"], "hall");
  EXPECT_EQ(listed["saved"][0]["name"], "monday");
  EXPECT_EQ(PathOf("robot2"), path);
  const SiteOutcome again = Cairn({"site", "load", "monday"});
  EXPECT_EQ(again.code, ExitCode::kFailed);
  EXPECT_THAT(again.err, HasSubstr("ALREADY_EXISTS"));
  // A directory that is in use is not touched.
  const SiteOutcome in_use = Cairn({"site", "export", "hall", "--state", File("a"), "-o", File("no.site")});
  EXPECT_EQ(in_use.code, ExitCode::kFailed);
  EXPECT_THAT(in_use.err, HasSubstr("another server uses"));
  StopServer();

  MustJson({"site", "export", "hall", "--state", File("a"), "-o", File("hall.site")});
  const auto imported = MustJson({"site", "import", File("hall.site"), "--state", File("b"), "--as", "annex"});
  EXPECT_EQ(imported["site"], "annex");
  EXPECT_EQ(imported["sessions"].size(), 2u);
  ASSERT_NO_FATAL_FAILURE(StartServer("b"));
  EXPECT_EQ(PathOf("robot2"), path);
  const auto job = MustJson({"job", "smooth", "--site", "annex", "--wait"});
  EXPECT_EQ(job["state"], "succeeded");
  StopServer();
}

// Cell by cell, in the frame of the map that was exported.
TEST_F(CairnSite, AMapOfNav2IsASiteAgain) {
  ASSERT_NO_FATAL_FAILURE(StartServer("a"));
  Stream("hall", "robot");
  const std::vector<std::string> to_file = {"map", "export",          "--site", "hall",
                                            "-o",  File("hall.yaml"), "--mode", "raw"};
  ASSERT_TRUE(test::Eventually([&] { return Cairn(to_file).code == ExitCode::kOk; }));  // At first there is no tile.
  StopServer();
  const auto imported = MustJson({"map", "import", File("hall.yaml"), "--site", "copy", "-o", File("copy.site")});
  EXPECT_EQ(imported["site"], "copy");
  EXPECT_GT(imported["tiles"], 0);
  MustJson({"site", "import", File("copy.site"), "--state", File("b")});
  ASSERT_NO_FATAL_FAILURE(StartServer("b"));
  const std::vector<std::string> again_to_file = {"map", "export",           "--site", "copy",
                                                  "-o",  File("again.yaml"), "--mode", "raw"};
  ASSERT_TRUE(test::Eventually([&] { return Cairn(again_to_file).code == ExitCode::kOk; }));
  StopServer();
  auto hall = LoadMapYaml(File("hall.yaml"));
  const auto again = LoadMapYaml(File("again.yaml"));
  ASSERT_TRUE(hall && again);
  for (std::uint8_t& cell : hall->cells) {
    // An imported cell is as sure as one that a single robot has drawn.
    if (cell != kUnknownCell) cell = std::clamp<std::uint8_t>(cell, 2, 98);
  }
  EXPECT_TRUE(again->cells == hall->cells);
  EXPECT_EQ(again->width, hall->width);
  EXPECT_EQ(again->T_map_origin, hall->T_map_origin);

  // What cannot be read makes no file.
  const std::string image = directory_.Read("hall.png");
  static_cast<void>(directory_.Write("hall.png", image.substr(0, image.size() / 2)));
  const SiteOutcome damaged = Cairn({"map", "import", File("hall.yaml"), "-o", File("damaged.site")});
  EXPECT_EQ(damaged.code, ExitCode::kFailed);
  EXPECT_THAT(damaged.err, HasSubstr("hall.png"));
  const SiteOutcome missing = Cairn({"map", "import", File("nowhere.yaml"), "-o", File("damaged.site")});
  EXPECT_EQ(missing.code, ExitCode::kFailed);
  EXPECT_THAT(missing.err, HasSubstr("nowhere.yaml"));
  EXPECT_EQ(Cairn({"map", "import", File("hall.yaml"), "--site", "a/b", "-o", File("damaged.site")}).code,
            ExitCode::kFailed);
  EXPECT_FALSE(std::filesystem::exists(File("damaged.site")));
}

TEST_F(CairnSite, FilesAreMergedSplitAndShortened) {
  for (const std::string& site : {std::string("hall"), std::string("annex")}) {
    ASSERT_NO_FATAL_FAILURE(StartServer(site));
    Stream(site, site == "hall" ? "h" : "a");
    StopServer();
    MustJson({"site", "export", site, "--state", File(site), "-o", File(site + ".site")});
  }
  const auto merged = MustJson(
      {"site", "merge", File("hall.site"), File("annex.site"), "--transform", "30,0,90deg", "-o", File("both.site")});
  EXPECT_EQ(merged["sessions"].size(), 4u);
  // A split that does not come to its end has lost nothing, although the rest replaces the file.
  const std::string whole = directory_.Read("both.site");
  const auto split = [this](const std::string& output, const std::string& rest) {
    return Cairn({"site", "split", File("both.site"), "a1", "h2", "--to", "half", "-o", output, "--rest", rest}).code;
  };
  EXPECT_EQ(split(File("nowhere/half.site"), File("both.site")), ExitCode::kFailed);
  EXPECT_EQ(split(File("half.site"), File("./half.site")), ExitCode::kUsage) << "one of them would be lost";
  EXPECT_EQ(split(File("both.site"), File("rest.site")), ExitCode::kUsage) << "the rest would be lost for a moment";
  EXPECT_EQ(directory_.Read("both.site"), whole);
  EXPECT_EQ(split(File("half.site"), File("rest.site")), ExitCode::kOk);
  const auto shorter = MustJson({"site", "delete-session", File("half.site"), "h2", "-o", File("shorter.site")});
  EXPECT_EQ(shorter["sessions"].size(), 1u);
  EXPECT_EQ(shorter["sessions"][0]["robot"], "a1");
  // The same in a state directory, and a server on it.
  MustJson({"site", "import", File("half.site"), "--state", File("c")});
  MustJson({"site", "import", File("rest.site"), "--state", File("c")});
  MustJson({"site", "merge", "half", "hall", "--state", File("c")});
  MustJson({"site", "delete-session", "half", "h1", "--state", File("c")});
  MustJson({"site", "split", "half", "a1", "a2", "--to", "moved", "--state", File("c")});
  const auto listed = MustJson({"site", "list", "--state", File("c")});
  ASSERT_EQ(listed["sites"].size(), 2u);
  EXPECT_EQ(listed["sites"][0]["sessions"].size(), 1u);
  EXPECT_EQ(listed["sites"][1]["sessions"].size(), 2u);
  ASSERT_NO_FATAL_FAILURE(StartServer("c"));
  // The annex was moved by 30 m and turned: its robots are there now.
  const double x = MustJson({"pose", "a1"})["pose"]["x"].get<double>();
  StopServer();
  ASSERT_NO_FATAL_FAILURE(StartServer("annex"));
  EXPECT_NEAR(x, 30.0 - MustJson({"pose", "a1"})["pose"]["y"].get<double>(), 0.3);
  StopServer();
  EXPECT_EQ(Cairn({"site", "merge", File("hall.site"), File("annex.site")}).code, ExitCode::kUsage);
  static_cast<void>(directory_.Write("bad.site", directory_.Read("hall.site").substr(0, 5000)));
  const SiteOutcome bad = Cairn({"site", "import", File("bad.site"), "--state", File("d")});
  EXPECT_EQ(bad.code, ExitCode::kFailed);
  EXPECT_THAT(bad.err, HasSubstr("DATA_LOSS"));
}

// Whatever the moment, a site is there as a whole or not at all, the others are untouched, and the same command works
// afterwards.
TEST_F(CairnSite, AKilledCommandHasChangedEverythingOrNothing) {
  for (const std::string& site : {std::string("hall"), std::string("annex")}) {
    ASSERT_NO_FATAL_FAILURE(StartServer(site));
    Stream(site, site == "hall" ? "h" : "a");
    StopServer();
    MustJson({"site", "export", site, "--state", File(site), "-o", File(site + ".site")});
  }
  using Sites = std::map<std::string, std::set<std::string>>;
  const Sites one = {{"annex", {"a1", "a2"}}};
  const Sites both = {{"annex", {"a1", "a2"}}, {"hall", {"h1", "h2"}}};
  const Sites merged = {{"annex", {"a1", "a2", "h1", "h2"}}};
  // What there is of it can be read to the end: the export reads every record.
  const auto is_whole = [&](const std::string& state, const Sites& sites) {
    for (const auto& [site, robots] : sites)
      EXPECT_EQ(MustJson({"site", "export", site, "--state", state, "-o", File("again.site")})["sessions"].size(),
                robots.size());
  };
  const int imports = KillAtEachSize("annex", {"import", File("hall.site")}, [&](const std::string& state) {
    const Sites sites = SitesIn(state);
    EXPECT_THAT(sites, ::testing::AnyOf(one, both));
    is_whole(state, sites);
    if (sites == one) MustJson({"site", "import", File("hall.site"), "--state", state});
    EXPECT_EQ(SitesIn(state), both);
  });
  MustJson({"site", "import", File("hall.site"), "--state", File("annex")});
  const int merges =
      KillAtEachSize("annex", {"merge", "annex", "hall", "--transform", "30,0,90deg"}, [&](const std::string& state) {
        const Sites sites = SitesIn(state);
        EXPECT_THAT(sites, ::testing::AnyOf(both, merged));
        is_whole(state, sites);
      });
  const int splits = KillAtEachSize("annex", {"split", "annex", "a1", "--to", "half"}, [&](const std::string& state) {
    const Sites sites = SitesIn(state);
    EXPECT_THAT(sites, ::testing::AnyOf(both, Sites{{"annex", {"a2"}}, {"half", {"a1"}}, {"hall", {"h1", "h2"}}}));
    is_whole(state, sites);
  });
  const int deletions = KillAtEachSize("annex", {"delete-session", "annex", "a1"}, [&](const std::string& state) {
    const Sites sites = SitesIn(state);
    EXPECT_THAT(sites, ::testing::AnyOf(both, Sites{{"annex", {"a2"}}, {"hall", {"h1", "h2"}}}));
    is_whole(state, sites);
  });
  EXPECT_GT(imports, 5);
  EXPECT_GT(merges, 5);
  EXPECT_GT(splits, 5);
  EXPECT_GT(deletions, 5);
}

// The same of a running server that loads a saved site.
TEST_F(CairnSite, AServerThatIsKilledWhileItLoadsASiteHasAllOfItOrNothing) {
  constexpr std::uintmax_t kFirst_bytes = 8192, kGrowth = 4, kLast_bytes = 1U << 30U;
  ASSERT_NO_FATAL_FAILURE(StartServer("saved"));
  Stream("hall", "robot");
  const std::vector<std::string> paths = {PathOf("robot1"), PathOf("robot2")};
  MustJson({"site", "save", "hall", "monday"});
  MustJson({"site", "delete", "hall"});
  StopServer();
  int kills = 0;
  bool killed = true;
  for (std::uintmax_t bytes = kFirst_bytes; killed && bytes < kLast_bytes; bytes *= kGrowth) {
    const std::string state = "copy" + std::to_string(bytes);
    std::filesystem::copy(File("saved"), File(state), std::filesystem::copy_options::recursive);
    ASSERT_NO_FATAL_FAILURE(StartServer(state));
    // The system kills the server at its first write beyond this file size.
    const rlimit size = {.rlim_cur = std::filesystem::file_size(directory_ / state / "cairn.db-wal") + bytes,
                         .rlim_max = RLIM_INFINITY};
    ASSERT_EQ(prlimit(server_->pid(), RLIMIT_FSIZE, &size, nullptr), 0);
    ChildProcess load({CAIRN_PATH, "--domain", std::to_string(test::TestDomain()), "site", "load", "monday"});
    constexpr std::chrono::milliseconds kTurn(1);
    while (server_->RunningAfter(kTurn) && load.RunningAfter(kTurn)) continue;
    killed = !server_->RunningAfter(kTurn);
    if (killed) {
      ++kills;
    } else {
      EXPECT_EQ(load.Wait().exit_code, 0);
      server_->Signal(SIGKILL);
    }
    static_cast<void>(server_->Wait());
    ASSERT_NO_FATAL_FAILURE(StartServer(state));
    if (MustJson({"site", "list"})["sites"].empty()) MustJson({"site", "load", "monday"});
    EXPECT_EQ((std::vector<std::string>{PathOf("robot1"), PathOf("robot2")}), paths);
    StopServer();
  }
  EXPECT_GT(kills, 1);
}

}  // namespace
}  // namespace cairn::client
