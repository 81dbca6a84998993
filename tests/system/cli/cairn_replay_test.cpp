// `cairn replay`: a log streamed to a server, which may be killed, stopped or asked again meanwhile.
#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/system/cli/cairn_program.h"

namespace cairn::client {
namespace {

using ::testing::HasSubstr;

TEST_F(CairnProgram, AReplayAsFastAsTheServerTakesItLosesNothing) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  WriteLog("30");
  const auto account =
      MustJson({"replay", File("robot1.log"), "--site", "hall", "--robot", "r1", "--fast", "--start", "1.2,8.2,0deg"});
  EXPECT_EQ(account["sent"], 300);
  EXPECT_EQ(account["used"], 300);
  EXPECT_EQ(account["dropped_total"], 0);
  EXPECT_EQ(account["unexplained"], 0);
  EXPECT_EQ(MustJson({"robot", "relocalise", "r1", "--here", "1.2,8.2,90deg"})["accepted"], true);
}

TEST_F(CairnProgram, AReplayUsesItsSpillFileAndNeverOneThatIsThere) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  WriteLog("5");
  const std::string taken = File("taken"), fresh = File("fresh");
  std::ofstream(taken) << "somebody's";
  std::vector<std::string> replay = {"replay", File("robot1.log"), "--site",  "hall", "--robot",
                                     "r1",     "--fast",           "--spill", taken};
  const Outcome refused = Cairn(replay);
  EXPECT_EQ(refused.code, ExitCode::kFailed) << refused.out;
  EXPECT_THAT(refused.err, HasSubstr(taken));
  std::ostringstream content;
  content << std::ifstream(taken).rdbuf();
  EXPECT_EQ(content.str(), "somebody's");
  replay.back() = fresh;
  EXPECT_EQ(MustJson(replay)["used"], 50);
  EXPECT_FALSE(std::filesystem::exists(fresh)) << "its name is removed as soon as it is open";
}

TEST_F(CairnProgram, AnEndedSessionCanBeReplayedAgainAndAResumedOneTakesTheClockAsSetBack) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  WriteLog("5");
  const std::vector<std::string> replay = {"replay", File("robot1.log"), "--site", "hall", "--robot", "r1", "--fast"};
  auto and_end = replay;
  and_end.push_back("--end");
  EXPECT_EQ(MustJson(and_end)["used"], 50);
  EXPECT_EQ(MustJson(replay)["used"], 50) << "a new session";
  const auto again = MustJson(replay);
  // The same stamps in the same session look like a clock that was set back: the first ones are dropped, and the others
  // are used. How many are dropped depends on how the two streams interleave.
  EXPECT_GE(again["dropped_total"], 4);
  EXPECT_GE(again["used"], 5);
  EXPECT_EQ(again["used"].get<int>() + again["dropped_total"].get<int>(), 50);
  EXPECT_EQ(again["unexplained"], 0);
  MustJson({"session", "end", "r1"});
  EXPECT_EQ(MustJson({"status", "r1"})["robots"][0]["phase"], "ended");
}

TEST_F(CairnProgram, AServerThatDiesWhileStreamingIsAClearError) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  WriteLog("200");
  std::optional<Outcome> replayed;
  std::thread replay([&] {
    replayed = Cairn({"replay", File("robot1.log"), "--site", "hall", "--robot", "r1", "--rate", "20"}, "3s");
  });
  ASSERT_TRUE(test::Eventually([] { return Cairn({"pose", "r1"}, "1s").code == ExitCode::kOk; }));
  server_->Signal(SIGKILL);
  server_->Wait();
  replay.join();
  EXPECT_EQ(replayed->code, ExitCode::kFailed) << replayed->out;
  EXPECT_THAT(replayed->err, HasSubstr("UNAVAILABLE"));
}

// It went on streaming to nobody, at the log's own pace.
TEST_F(CairnProgram, AServerThatIsStoppedEndsAReplayAtOnceWithAReason) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  WriteLog("200");
  std::optional<Outcome> replayed;
  std::thread replay([&] {
    replayed = Cairn({"replay", File("robot1.log"), "--site", "hall", "--robot", "r1", "--rate", "2"}, "3s");
  });
  ASSERT_TRUE(test::Eventually([] { return Cairn({"pose", "r1"}, "1s").code == ExitCode::kOk; }));
  const auto stopped = std::chrono::steady_clock::now();
  server_->Signal(SIGTERM);
  server_->Wait();
  replay.join();
  EXPECT_EQ(replayed->code, ExitCode::kFailed) << replayed->out;
  EXPECT_THAT(replayed->err, HasSubstr("the server is stopping"));
  // The log has 100 s to go.
  EXPECT_LT(std::chrono::steady_clock::now() - stopped, std::chrono::seconds(30));
}

}  // namespace
}  // namespace cairn::client
