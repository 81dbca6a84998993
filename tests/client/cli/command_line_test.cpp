// Whole command lines that need no server, and what wrong ones answer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include "client/cli/program.h"
#include "common/map/occupancy_image.h"
#include "common/sensor/trajectory.h"
#include "tests/temp_directory.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;

struct CommandOutcome {
  ExitCode code;
  std::string out;
  std::string err;
};

CommandOutcome RunLine(const std::vector<std::string>& arguments) {
  std::ostringstream out, err;
  const ExitCode code = RunCairn(arguments, out, err);
  return {code, out.str(), err.str()};
}

class CommandLine : public ::testing::Test {
 protected:
  [[nodiscard]] std::string File(const std::string& name) const { return (directory_ / name).string(); }

  TempDirectory directory_;
};

TEST_F(CommandLine, NonsenseIsAUsageError) {
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"fly"},
      {"pose"},
      {"pose", "r1", "--at", "yesterday"},
      {"pose", "r1", "--at", "1.5", "--follow"},
      {"pose", "r1", "--count", "3"},
      {"pose", "r1", "--follow", "--count", "0"},
      {"record"},
      {"record", "x.mcap", "--seconds", "soon"},
      {"record", "x.mcap", "--map-every", "0"},
      {"replay", "x.log", "--site", "s"},
      {"replay", "x.log", "--site", "s", "--robot", "r", "--start", "1,2"},
      {"replay", "x.log", "--site", "s", "--robot", "r", "--fast", "--rate", "2"},
      {"sim"},
      {"sim", "--site", "s", "--beams", "0"},
      {"sim", "--site", "s", "--first-stamp", "inf"},
      {"sim", "--site", "s", "--robots", "many"},
      {"site"},
      {"site", "save"},
      {"site", "merge", "a.site", "b.site"},
      {"site", "merge", "a.site", "-o", "c.site"},
      {"site", "merge", "a", "b", "--state", "d", "-o", "c.site"},
      {"site", "merge", "a", "b", "--state", "d", "--transform", "1,2"},
      {"site", "split", "a", "--to", "b", "--state", "d"},
      {"site", "export", "a", "-o", "a.site"},
      {"map"},
      {"map", "export", "--site", "s"},
      {"map", "draw", "-o", "x.png"},
      {"map", "draw", "--site", "s", "--map", "m.yaml", "-o", "x.png"},
      {"map", "animate", "-o", "x.png"},
      {"map", "animate", "--site", "s", "-o", "x.png", "--every", "0"},
      {"map", "animate", "--site", "s", "-o", "x.png", "--frames", "1"},
      {"tiles", "--site", "s", "--area", "5,5,1,1"},
      {"tiles", "--site", "s", "--level", "9"},
      {"job", "show", "0"},
      {"ping", "--timeout", "soon"},
      {"ping", "--domain", "233"},
      {"ping", "--set", "wire.colour=red"},
      {"ping", "--set", "wire.interfaces=eth0"},
      {"ping", "--set", "wire.liveliness_lease_s=-1"}};
  for (const auto& arguments : wrong) {
    const CommandOutcome outcome = RunLine(arguments);
    EXPECT_EQ(outcome.code, ExitCode::kUsage) << ::testing::PrintToString(arguments);
    EXPECT_NE(outcome.err, "") << ::testing::PrintToString(arguments);
    EXPECT_EQ(outcome.out, "") << ::testing::PrintToString(arguments);
  }
}

TEST_F(CommandLine, ADomainOfTheMachineThatIsNoneIsAUsageErrorThatNamesIt) {
  setenv("CAIRN_DOMAIN", "much", 1);
  const CommandOutcome outcome = RunLine({"ping"});
  unsetenv("CAIRN_DOMAIN");
  EXPECT_EQ(outcome.code, ExitCode::kUsage);
  EXPECT_THAT(outcome.err, HasSubstr("CAIRN_DOMAIN: wire.domain: 'much'"));
}

// And not only that a command or a positional is missing.
TEST_F(CommandLine, AWordThatNobodyKnowsIsNamed) {
  for (const std::vector<std::string>& line :
       {std::vector<std::string>{"mpa"}, {"map", "mpa"}, {"pose", "--mpa"}, {"--domain", "7", "mpa"}}) {
    const CommandOutcome outcome = RunLine(line);
    EXPECT_EQ(outcome.code, ExitCode::kUsage);
    EXPECT_THAT(outcome.err, HasSubstr("was not expected: "));
    EXPECT_THAT(outcome.err, HasSubstr("mpa\n"));
  }
}

TEST_F(CommandLine, HelpIsNoError) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"--help"}, {"replay", "--help"}, {"map", "draw", "--help"}, {"--version"}}) {
    const CommandOutcome outcome = RunLine(arguments);
    EXPECT_EQ(outcome.code, ExitCode::kOk);
    EXPECT_NE(outcome.out, "");
  }
  EXPECT_THAT(RunLine({"replay", "--help"}).out, HasSubstr("EXAMPLES"));
  EXPECT_THAT(RunLine({"--help"}).out, HasSubstr("Exit codes"));
}

// The heading in `cairn --help` below which each command stands.
std::map<std::string, std::string> HeadingsOfCommands() {
  std::map<std::string, std::string> headings;
  std::istringstream help(RunLine({"--help"}).out);
  std::string heading;
  for (std::string line; std::getline(help, line);) {
    if (!line.empty() && line[0] != ' ') heading = line;
    if (line.size() > 2 && line.substr(0, 2) == "  " && std::isalpha(static_cast<unsigned char>(line[2])) != 0)
      headings[line.substr(2, line.find(' ', 2) - 2)] = heading;
  }
  return headings;
}

TEST_F(CommandLine, HelpIsATableOfContents) {
  const auto headings = HeadingsOfCommands();
  const std::map<std::string, std::string> some = {{"top", "Watch:"},
                                                   {"ros2", "Robots:"},
                                                   {"job", "Maps:"},
                                                   {"site", "Sites:"},
                                                   {"record", "Logs and recordings:"},
                                                   {"sim", "Simulation:"}};
  for (const auto& [command, heading] : some) EXPECT_EQ(headings.count(command) ? headings.at(command) : "", heading);
  EXPECT_EQ(headings.size(), 18U) << ::testing::PrintToString(headings);
  EXPECT_THAT(RunLine({"--help"}).out, ::testing::Not(HasSubstr("Subcommands:"))) << "a command without a chapter";
}

TEST_F(CommandLine, SimWritesLogsThatCheckLogFindsGood) {
  const CommandOutcome sim =
      RunLine({"sim", "--no-stream", "--robots", "2", "--seconds", "20", "--beams", "181", "--fov", "180", "--log-dir",
               File("logs"), "--truth-dir", File("truth"), "--first-stamp", "1000", "--json"});
  ASSERT_EQ(sim.code, ExitCode::kOk) << sim.err;
  const auto report = nlohmann::json::parse(sim.out);
  EXPECT_EQ(report["robots"].size(), 2u);
  EXPECT_EQ(report["robots"][1]["robot"], "robot2");
  const CommandOutcome check = RunLine({"check-log", File("logs/robot1.log"), "--json"});
  ASSERT_EQ(check.code, ExitCode::kOk) << check.out << check.err;
  const auto log = nlohmann::json::parse(check.out);
  EXPECT_EQ(log["scans"]["count"], 200);
  EXPECT_EQ(log["beam_counts"]["181"], 200);
  const auto truth = ReadTum(File("truth/robot2.tum"));
  ASSERT_TRUE(truth) << truth.error().message;
  EXPECT_EQ(truth->size(), 200u);
}

TEST_F(CommandLine, TheSameSeedWritesTheSameLog) {
  const auto content = [this](const std::string& directory, const std::string& seed) {
    EXPECT_EQ(RunLine({"sim", "--no-stream", "--robots", "1", "--seconds", "5", "--seed", seed, "--first-stamp", "1000",
                       "--log-dir", File(directory)})
                  .code,
              ExitCode::kOk);
    std::ifstream file(File(directory + "/robot1.log"));
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  const std::string one = content("a", "7");
  EXPECT_GT(one.size(), 1000u);
  EXPECT_EQ(one, content("b", "7"));
  EXPECT_NE(one, content("c", "8"));
}

TEST_F(CommandLine, EvalSaysHowFarFromTheTruth) {
  ASSERT_TRUE(WriteTum({{0, {0, 0, 0}}, {kNanosPerSecond / 10, {1, 0, 0}}}, File("truth.tum")));
  ASSERT_TRUE(WriteTum({{0, {0, 0.5, 0}}, {kNanosPerSecond / 10, {1, 0.5, 0}}}, File("estimate.tum")));
  const CommandOutcome plain = RunLine({"eval", File("estimate.tum"), File("truth.tum"), "--json"});
  ASSERT_EQ(plain.code, ExitCode::kOk) << plain.err;
  EXPECT_NEAR(nlohmann::json::parse(plain.out)["ate_rmse_m"].get<double>(), 0.5, 1e-9);
  EXPECT_EQ(RunLine({"eval", File("estimate.tum"), File("truth.tum"), "--max-rmse", "0.4"}).code, ExitCode::kFailed);
  EXPECT_EQ(RunLine({"eval", File("estimate.tum"), File("truth.tum"), "--align", "se2", "--max-rmse", "0.01"}).code,
            ExitCode::kOk);
}

TEST_F(CommandLine, FilesThatAreNotThereFailWithOneLine) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"check-log", File("none.log")},
                                                    {"eval", File("none.tum"), File("none.tum")},
                                                    {"replay", File("none.log"), "--site", "s", "--robot", "r"},
                                                    {"sim", "--no-stream", "--world", File("none.world")},
                                                    {"map", "draw", "--map", File("none.yaml"), "-o", File("x.png")}}) {
    const CommandOutcome outcome = RunLine(arguments);
    EXPECT_EQ(outcome.code, ExitCode::kFailed) << arguments[0];
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("none."));
  }
}

// A picture of the same name took the place of the image that a robot navigates with.
TEST_F(CommandLine, APictureDoesNotReplaceTheImageOfAMap) {
  const OccupancyImage map{.resolution_m = 0.05, .T_map_origin = {}, .width = 2, .height = 2, .cells = {0, 0, 100, 0}};
  ASSERT_TRUE(SaveMapYaml(map, File("lab.yaml"), ".png", {}));
  for (const std::vector<std::string>& line :
       {std::vector<std::string>{"map", "draw", "--map", File("lab.yaml"), "-o", File("lab.png")},
        {"map", "animate", "--site", "lab", "-o", File("lab.png")}}) {
    const CommandOutcome refused = RunLine(line);
    EXPECT_EQ(refused.code, ExitCode::kFailed);
    EXPECT_THAT(refused.err, HasSubstr("lab.png' is the image of the map"));
  }
  EXPECT_EQ(LoadMapYaml(File("lab.yaml"))->cells, map.cells);
  for (int again = 0; again < 2; ++again)
    EXPECT_EQ(RunLine({"map", "draw", "--map", File("lab.yaml"), "-o", File("picture.png")}).code, ExitCode::kOk);
}

TEST_F(CommandLine, AnErrorIsAnObjectForMachines) {
  const CommandOutcome outcome = RunLine({"--json", "check-log", File("none.log")});
  EXPECT_EQ(outcome.code, ExitCode::kFailed);
  EXPECT_THAT(nlohmann::json::parse(outcome.out)["error"]["message"].get<std::string>(), HasSubstr("none.log"));
}

TEST_F(CommandLine, SitesOfAStoppedServerAreFoundOrMissingAndNoDirectoryIsMadeByASlip) {
  const CommandOutcome listed = RunLine({"site", "list", "--state", File("nothing")});
  EXPECT_EQ(listed.code, ExitCode::kFailed);
  EXPECT_THAT(listed.err, HasSubstr("NOT_FOUND"));
  EXPECT_FALSE(std::filesystem::exists(File("nothing")));
  EXPECT_EQ(RunLine({"site", "import", File("none.site"), "--state", File("made")}).code, ExitCode::kFailed);
  std::ofstream(File("text.site")) << "no site";
  const CommandOutcome text = RunLine({"site", "merge", File("text.site"), File("text.site"), "-o", File("o.site")});
  EXPECT_EQ(text.code, ExitCode::kFailed);
  EXPECT_THAT(text.err, HasSubstr("is not a saved site"));
  EXPECT_FALSE(std::filesystem::exists(File("o.site")));
}

}  // namespace
}  // namespace cairn::client
