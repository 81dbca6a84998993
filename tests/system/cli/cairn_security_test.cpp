// cairnd with DDS Security as a process, and `cairn` with the identities of its fleet: what operators see.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <optional>
#include <sstream>
#include <thread>

#include "client/cli/program.h"
#include "tests/integration/security/fleet_files.h"

namespace cairn::client {
namespace {

using test::Fleet;
using ::testing::HasSubstr;
using ::testing::Not;

struct SecureOutcome {
  ExitCode code = ExitCode::kFailed;
  std::string out;
  std::string err;
};

std::vector<std::string> ServerWith(const std::filesystem::path& security, const std::string& state) {
  return {CAIRND_PATH,
          "--domain",
          std::to_string(test::TestDomain()),
          "--state",
          state,
          "--set",
          "wire.security=" + security.string(),
          "--set",
          "slam.particles=20"};
}

class SecureServer : public ::testing::Test {
 protected:
  void SetUp() override {
    server_.emplace(ServerWith(Fleet() / "server", (directory_ / "state").string()));
    ASSERT_TRUE(server_->Says("ready"));
  }
  static SecureOutcome Cairn(const std::string& member, const std::vector<std::string>& arguments,
                             const std::string& timeout = "20s") {
    std::vector<std::string> all = {"--domain", std::to_string(test::TestDomain()), "--timeout", timeout};
    if (!member.empty()) all.insert(all.end(), {"--set", "wire.security=" + (Fleet() / member).string()});
    all.insert(all.end(), arguments.begin(), arguments.end());
    std::ostringstream out, err;
    const ExitCode code = RunCairn(all, out, err);
    return {code, out.str(), err.str()};
  }
  static void Works(const std::string& member, std::vector<std::string> arguments) {
    const std::string what = arguments[0];
    const SecureOutcome outcome = Cairn(member, std::move(arguments));
    EXPECT_EQ(outcome.code, ExitCode::kOk) << member << " " << what << ": " << outcome.err;
  }
  static void IsDenied(const std::string& member, std::vector<std::string> arguments) {
    const std::string what = arguments[0];
    const SecureOutcome outcome = Cairn(member, std::move(arguments));
    EXPECT_EQ(outcome.code, ExitCode::kFailed) << member << " " << what;
    EXPECT_THAT(outcome.err, HasSubstr("PERMISSION_DENIED")) << member << " " << what;
  }
  static nlohmann::json Refused() {
    const SecureOutcome outcome = Cairn("viewers/v", {"status", "--json"});
    return outcome.out.empty() ? nlohmann::json() : nlohmann::json::parse(outcome.out)["refused"];
  }

  // A viewer may write questions, and this is a command in the place of one.
  static void CommandAmongQuestionsIsDenied() {
    test::Inbox<Reply> replies;
    Request submit;
    submit.client = 5;
    submit.kind = RequestKind::kJobSubmit;
    submit.site = "hall";
    // On a very slow machine a handshake may get stuck; a client then joins as a new participant.
    for (int attempt = 0; attempt < 5 && replies.values().empty(); ++attempt) {
      const auto viewer = test::MakeBus("viewer", test::SecureOptions(Fleet() / "viewers" / "v"));
      const auto subscription = test::Must(viewer->SubscribeReplies(5, replies.Sink()));
      const auto requests = test::Must(viewer->Advertise<Request>());
      static_cast<void>(test::Eventually(
          [&] {
            test::Must(requests->Publish(submit));
            return !replies.values().empty();
          },
          std::chrono::seconds(5)));
    }
    ASSERT_FALSE(replies.values().empty());
    EXPECT_EQ(replies.values().front().status.code, StatusCode::kPermissionDenied);
    EXPECT_TRUE(test::Eventually([] { return Refused()["commands"] >= 1; }));
  }

  const TempDirectory directory_;
  std::optional<ChildProcess> server_;
};

std::vector<std::string> Drive(const std::string& prefix, int robots) {
  return {
      "sim",    "--robots", std::to_string(robots), "--prefix", prefix, "--seconds", "5", "--fast", "--beams", "121",
      "--site", "hall",     "--first-stamp",        "1000"};
}

TEST_F(SecureServer, GivesEachRoleItsRightsAndSaysWhoWasRefused) {
  Works("robots/r1", Drive("r", 1));
  Works("robots/sim", Drive("s", 2));
  IsDenied("robots/r2", Drive("r", 1));
  IsDenied("viewers/v", Drive("r", 1));
  for (const char* member : {"viewers/v", "operators/o"}) {
    Works(member, {"pose", "r1"});
    Works(member, {"status"});
  }
  const std::vector<std::vector<std::string>> commands = {{"job", "smooth", "--site", "hall", "--wait"},
                                                          {"map", "enable", "--site", "hall", "--version", "1"},
                                                          {"site", "save", "hall", "monday"},
                                                          {"robot", "relocalise", "r1"},
                                                          {"session", "end", "r1"}};
  for (const auto& command : commands) {
    IsDenied("viewers/v", command);
    IsDenied("robots/r1", command);
    Works("operators/o", command);
  }
  EXPECT_EQ(Refused()["peers"], 0);
  CommandAmongQuestionsIsDenied();

  const SecureOutcome plain = Cairn("", {"ping"}, "2s");
  EXPECT_EQ(plain.code, ExitCode::kFailed);
  EXPECT_THAT(plain.err, HasSubstr("no server answers"));
  const TempDirectory of_former;
  const auto expired = test::CopyOf(Fleet() / "operators" / "o", of_former);
  test::Expire(expired, Fleet());
  ChildProcess former({CAIRN_HOSTILE_PEER, std::to_string(test::TestDomain()), expired.string(), "ask"});
  ChildProcess hostile(
      {CAIRN_HOSTILE_PEER, std::to_string(test::TestDomain()), (Fleet() / "viewers/v").string(), "command"});
  ChildProcess impostor(
      {CAIRN_HOSTILE_PEER, std::to_string(test::TestDomain()), (Fleet() / "robots/r2").string(), "scan", "r1", "r2"});
  // Each look at it starts a program that joins the domain with its identity, which takes seconds under a sanitizer.
  const auto all_refused = [] {
    const auto refused = Refused();
    return refused.is_object() && refused["peers"] >= 2 && refused["endpoints"] >= 1 && refused["samples"] >= 1;
  };
  ASSERT_TRUE(test::Eventually(all_refused, std::chrono::seconds(90))) << Refused().dump();
  EXPECT_THAT(Cairn("viewers/v", {"status"}).out, HasSubstr("DDS Security on; refused since the start: "));

  EXPECT_TRUE(server_->Says("its identity is not valid: certificate has expired", std::chrono::seconds(90)));
  server_->Signal(SIGTERM);
  const auto outcome = server_->Wait();
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.output, HasSubstr("at 127.0.0.1 is refused: it has no identity: it runs without DDS Security"));
  EXPECT_THAT(outcome.output, HasSubstr("is refused: cairn/v1/command topic not found in allow rule"));
  EXPECT_THAT(outcome.output, HasSubstr("it writes in the name of another robot than 'r2'"));
  // The second line of the file is the first of the key itself.
  std::ifstream file(Fleet() / "server" / "key.pem");
  std::string key;
  std::getline(file, key);
  std::getline(file, key);
  ASSERT_GT(key.size(), 20u);
  EXPECT_THAT(outcome.output, Not(HasSubstr(key)));
}

TEST_F(SecureServer, ARecorderReadsWhatRobotsSendAndAViewerOnlyTheRest) {
  const auto record = [&](const std::string& member, const std::string& name, const std::string& seconds) {
    std::vector<std::string> arguments = {
        "record", (directory_ / name).string(), "--force", "--seconds", seconds, "--no-scans", "--json"};
    if (member != "viewers/v") std::erase(arguments, "--no-scans");
    const SecureOutcome outcome = Cairn(member, arguments, "60s");
    EXPECT_EQ(outcome.code, ExitCode::kOk) << member << ": " << outcome.err;
    return outcome.out.empty() ? nlohmann::json() : nlohmann::json::parse(outcome.out);
  };
  IsDenied("viewers/v", {"record", (directory_ / "denied.mcap").string(), "--seconds", "1"});
  EXPECT_FALSE(std::filesystem::exists(directory_ / "denied.mcap"));
  IsDenied("recorders/c", Drive("r", 1));
  IsDenied("recorders/c", {"job", "smooth", "--site", "hall", "--wait"});
  nlohmann::json of_recorder, of_viewer;
  SecureOutcome of_robot;
  {
    std::jthread robot([&] {
      of_robot =
          Cairn("robots/r1",
                {"sim", "--robots", "1", "--prefix", "r", "--seconds", "16", "--beams", "91", "--site", "hall"}, "60s");
    });
    std::jthread recorder([&] { of_recorder = record("recorders/c", "all.mcap", "10"); });
    of_viewer = record("viewers/v", "poses.mcap", "10");
  }
  EXPECT_EQ(of_robot.code, ExitCode::kOk) << of_robot.out << of_robot.err;
  EXPECT_GT(of_recorder["scans"], 0);
  EXPECT_GT(of_recorder["odometry"], 0);
  EXPECT_EQ(of_recorder["robots"], nlohmann::json({"r1"}));
  EXPECT_GT(of_viewer["poses"], 0);
  EXPECT_EQ(of_viewer["scans"], 0);
  EXPECT_EQ(of_viewer["sites"], nlohmann::json({"hall"}));
}

TEST(SecureServerFiles, AreCheckedAtTheStart) {
  const TempDirectory directory;
  const auto expired = test::CopyOf(Fleet() / "server", directory);
  test::Expire(expired, Fleet());
  const auto outcome = ChildProcess(ServerWith(expired, "none")).Wait();
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.output, HasSubstr("cannot start: wire.security: " + expired.string() +
                                        "/cert.pem is not valid: certificate has expired"));
}

}  // namespace
}  // namespace cairn::client
