// `cairn site` against cairnd as a process and against its state directory: what operators do with whole sites.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include "client/cli/program.h"
#include "tests/child_process.h"
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
  // Runs `cairn site COMMAND... --state DIR` on copies of a state directory. Kills it when it has changed the files
  // there for the first time, for the second time, and so on until it ends before. Calls `check` with the directory
  // that is left. Returns how often it was killed.
  int KillAtEachChange(const std::string& state, std::vector<std::string> command,
                       const std::function<void(const std::string& state)>& check) {
    constexpr int kMost = 100;
    command.insert(command.begin(), {CAIRN_PATH, "site"});
    command.insert(command.end(), {"--state", ""});
    for (int kills = 0; kills < kMost; ++kills) {
      const TempDirectory place;
      const std::string copy = (place / state).string();
      std::filesystem::copy(File(state), copy, std::filesystem::copy_options::recursive);
      command.back() = copy;
      ChildProcess killed(command);
      std::uintmax_t bytes = BytesIn(copy);
      int changes = 0;
      bool running = true;
      while (running && changes <= kills) {
        running = killed.RunningAfter(std::chrono::microseconds(0));
        if (const std::uintmax_t now = BytesIn(copy); std::exchange(bytes, now) != now) ++changes;
      }
      killed.Signal(SIGKILL);
      static_cast<void>(killed.Wait());
      check(copy);
      if (!running) return kills;
    }
    return kMost;
  }
  // Of all files. Files that come and go meanwhile do not matter.
  static std::uintmax_t BytesIn(const std::string& directory) {
    std::uintmax_t bytes = 0;
    for (const auto& file : std::filesystem::directory_iterator(directory)) {
      std::error_code gone;
      if (const std::uintmax_t size = file.file_size(gone); !gone) bytes += size;
    }
    return bytes;
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
  const int imports = KillAtEachChange("annex", {"import", File("hall.site")}, [&](const std::string& state) {
    const Sites sites = SitesIn(state);
    EXPECT_THAT(sites, ::testing::AnyOf(one, both));
    is_whole(state, sites);
    if (sites == one) MustJson({"site", "import", File("hall.site"), "--state", state});
    EXPECT_EQ(SitesIn(state), both);
  });
  MustJson({"site", "import", File("hall.site"), "--state", File("annex")});
  const int merges =
      KillAtEachChange("annex", {"merge", "annex", "hall", "--transform", "30,0,90deg"}, [&](const std::string& state) {
        const Sites sites = SitesIn(state);
        EXPECT_THAT(sites, ::testing::AnyOf(both, merged));
        is_whole(state, sites);
      });
  const int splits = KillAtEachChange("annex", {"split", "annex", "a1", "--to", "half"}, [&](const std::string& state) {
    const Sites sites = SitesIn(state);
    EXPECT_THAT(sites, ::testing::AnyOf(both, Sites{{"annex", {"a2"}}, {"half", {"a1"}}, {"hall", {"h1", "h2"}}}));
    is_whole(state, sites);
  });
  const int deletions = KillAtEachChange("annex", {"delete-session", "annex", "a1"}, [&](const std::string& state) {
    const Sites sites = SitesIn(state);
    EXPECT_THAT(sites, ::testing::AnyOf(both, Sites{{"annex", {"a2"}}, {"hall", {"h1", "h2"}}}));
    is_whole(state, sites);
  });
  EXPECT_GT(imports, 0);
  EXPECT_GT(merges, 0);
  EXPECT_GT(splits, 0);
  EXPECT_GT(deletions, 0);
}

// The same of a running server that loads a saved site.
TEST_F(CairnSite, AServerThatIsKilledWhileItLoadsASiteHasAllOfItOrNothing) {
  constexpr int kMostKills = 5;
  ASSERT_NO_FATAL_FAILURE(StartServer("saved"));
  Stream("hall", "robot");
  const std::vector<std::string> paths = {PathOf("robot1"), PathOf("robot2")};
  MustJson({"site", "save", "hall", "monday"});
  MustJson({"site", "delete", "hall"});
  StopServer();
  int kills = 0;
  for (bool killed = true; killed && kills < kMostKills; ++kills) {
    const std::string state = "copy" + std::to_string(kills);
    std::filesystem::copy(File("saved"), File(state), std::filesystem::copy_options::recursive);
    ASSERT_NO_FATAL_FAILURE(StartServer(state));
    std::uintmax_t bytes = BytesIn(File(state));
    ChildProcess load({CAIRN_PATH, "--domain", std::to_string(test::TestDomain()), "site", "load", "monday"});
    int changes = 0;
    for (bool running = true; running && changes <= kills;) {
      running = load.RunningAfter(std::chrono::microseconds(0));
      if (const std::uintmax_t now = BytesIn(File(state)); std::exchange(bytes, now) != now) ++changes;
    }
    killed = changes > kills;
    server_->Signal(SIGKILL);
    static_cast<void>(server_->Wait());
    load.Signal(SIGKILL);
    static_cast<void>(load.Wait());
    ASSERT_NO_FATAL_FAILURE(StartServer(state));
    if (MustJson({"site", "list"})["sites"].empty()) MustJson({"site", "load", "monday"});
    EXPECT_EQ((std::vector<std::string>{PathOf("robot1"), PathOf("robot2")}), paths);
    StopServer();
  }
  EXPECT_GT(kills, 1);
}

}  // namespace
}  // namespace cairn::client
