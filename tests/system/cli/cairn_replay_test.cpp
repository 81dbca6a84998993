// `cairn replay`: a log streamed to a server, which may be killed, stopped or asked again meanwhile.
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <thread>
#include <utility>

#include "client/cli/recording_file.h"
#include "common/sensor/log_reader.h"
#include "tests/must.h"
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
  // Without a pose a job looks for it, and the command waits for the job.
  const auto job = MustJson({"robot", "relocalise", "r1"});
  EXPECT_EQ(job["kind"], "relocalise");
  EXPECT_EQ(job["robot"], "r1");
  EXPECT_EQ(job["state"], "succeeded") << job["message"];
  EXPECT_LE(job["places"].size(), 8U);
  EXPECT_LE(job["ambiguity"], 1.0);
}

// Here the second lidar measures 20 ms before the first, and not at the very beginning, where there is no odometry yet.
TEST_F(CairnProgram, AReplayOfSeveralLidarsSendsEachAsASensorOfTheRobot) {
  ASSERT_NO_FATAL_FAILURE(StartServer());
  WriteLog("5");
  const auto file = test::Must(RecordingFile::Create(File("two.mcap"), false));
  std::int64_t time = 1;
  bool began = false;
  const auto add = [&](LogRecord&& record) {
    ++time;
    if (const auto* const odometry = std::get_if<Odometry>(&record)) {
      test::Must(file->Add("r7", 1, *odometry, time));
      return true;
    }
    Scan scan = std::get<Scan>(std::move(record));
    test::Must(file->Add("r7", "front", 1, scan, time));
    scan.stamp -= 20'000'000;
    if (std::exchange(began, true)) test::Must(file->Add("r7", "rear", 1, scan, time));
    return true;
  };
  ASSERT_EQ(test::Must(ReadLog(File("robot1.log"), {}, add)).scans, 50);
  test::Must(file->Finish());
  const std::vector<std::string> replay = {"replay", File("two.mcap"), "--site", "hall", "--robot", "r1", "--fast"};
  const auto account = MustJson(replay);
  EXPECT_EQ(account["sent"], 99);
  // On a busy machine one lidar may be late by more than the 0.2 s for which the other one waits.
  EXPECT_EQ(account["used"].get<int>() + account["dropped_total"].get<int>(), 99) << account;
  EXPECT_GT(account["used"].get<int>(), 60) << account;
  EXPECT_EQ(account["unexplained"], 0);
  std::map<std::string, int> received;
  const auto status = MustJson({"status", "r1"});
  for (const auto& ledger : status["robots"][0]["ledgers"])
    received[ledger.value("sensor", "")] = ledger.value("received", 0);
  EXPECT_EQ(received["front"], 50);
  EXPECT_EQ(received["rear"], 49);
  auto named = replay;
  named.insert(named.end(), {"--sensor", "laser"});
  EXPECT_THAT(Cairn(named).err, HasSubstr("--sensor names one lidar"));
  const Outcome checked = Cairn({"check-log", File("two.mcap")});
  EXPECT_THAT(checked.out, HasSubstr("/robots/r7/scan/front\nscans     50 "));
  EXPECT_THAT(checked.out, HasSubstr("/robots/r7/scan/rear\nscans     49 "));
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
