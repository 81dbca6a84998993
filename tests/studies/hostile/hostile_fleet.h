// The fleet that cairn-study hostile attacks: a cairnd, robots, and a viewer of both. One thread.
#pragma once

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <future>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "client/lib/map_client.h"
#include "client/lib/pose_client.h"
#include "client/lib/query_client.h"
#include "tests/child_process.h"
#include "tests/eventually.h"
#include "tests/must.h"
#include "tests/studies/fleet/live_server.h"
#include "tests/studies/table.h"
#include "tests/temp_directory.h"
#include "tests/test_domain.h"

namespace cairn::studies {

using Clock = std::chrono::steady_clock;

constexpr int kRobots = 2;

inline double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Where each member of the fleet has its identity; nowhere without DDS Security.
class Members {
 public:
  Members() = default;
  // Makes the identities in this directory.
  explicit Members(std::filesystem::path directory) : directory_(std::move(directory)) {
    std::string robots;
    for (int i = 1; i <= kRobots; ++i) robots += (i > 1 ? ",r" : "r") + std::to_string(i) + "-1";
    ChildProcess make({CAIRN_MAKE_FLEET, directory_.string(), "--robots", robots, "--viewers", "page"});
    if (const auto made = make.Wait(std::chrono::seconds(60)); made.exit_code != 0)
      throw std::runtime_error(made.output);
  }
  [[nodiscard]] std::vector<std::string> ArgumentsOf(const std::string& member) const {
    if (directory_.empty()) return {};
    return {"--set", "wire.security=" + (directory_ / member).string()};
  }
  [[nodiscard]] wire::WireOptions OptionsOfPage() const {
    wire::WireOptions options;
    options.domain = test::TestDomain();
    if (!directory_.empty()) options.security = (directory_ / kPage).string();
    return options;
  }
  static constexpr const char* kPage = "viewers/page";

 private:
  std::filesystem::path directory_;
};

// A cairnd and robots, each a process that is started again where it dies.
class HostileFleet {
 public:
  explicit HostileFleet(const Members& members) : members_(members) {
    StartServer();
    for (int i = 0; i < kRobots; ++i) robots_.push_back(StartRobot(i));
  }

  // What the server says of each robot: scans and odometry received, and whether it is stale. Nothing where it does not
  // answer. Each answer comes to a process of its own, because the senders must not receive what these processes send.
  struct RobotFlow {
    std::uint64_t scans = 0;
    std::uint64_t odometry = 0;
    bool stale = false;
  };
  using Flow = std::map<std::string, RobotFlow>;
  [[nodiscard]] Flow Look() const {
    ChildProcess status(
        With({ProgramPath("cairn"), "status", "--timeout", "2", "--json", "--domain", DomainText()}, Members::kPage));
    const auto outcome = status.Wait(std::chrono::seconds(20));
    Flow flow;
    const auto object = nlohmann::json::parse(outcome.output, nullptr, false);
    if (outcome.exit_code != 0 || !object.is_object()) return flow;
    for (const auto& robot : object["robots"]) {
      RobotFlow& one = flow[robot["robot"]];
      one.stale = robot["stale"];
      for (const auto& ledger : robot["ledgers"]) {
        one.scans = ledger["received"];
        one.odometry = ledger["odometry_received"];
      }
    }
    return flow;
  }

  [[nodiscard]] const Members& members() const { return members_; }

  // Starts again who has died; returns who.
  std::vector<std::string> Bury() {
    std::vector<std::string> dead;
    if (!server_->RunningAfter(std::chrono::milliseconds(0))) {
      dead.push_back("cairnd: " + LastWords(*server_));
      StartServer();
    }
    for (int i = 0; i < kRobots; ++i) {
      auto& robot = robots_[static_cast<std::size_t>(i)];
      if (robot->RunningAfter(std::chrono::milliseconds(0))) continue;
      dead.push_back("robot " + std::to_string(i + 1) + ": " + LastWords(*robot));
      robot = StartRobot(i);
    }
    return dead;
  }

  // Seconds until scans and odometry of all robots arrive again; what it took to ask is included.
  [[nodiscard]] double AwaitFlow(double patience_s) const {
    const auto start = Clock::now();
    Flow before;
    while (SecondsSince(start) < patience_s) {
      const Flow now = Look();
      if (before.size() < kRobots) {
        before = now;
        continue;
      }
      const bool flows = std::all_of(before.begin(), before.end(), [&](const auto& entry) {
        const auto found = now.find(entry.first);
        return found != now.end() && found->second.scans > entry.second.scans &&
               found->second.odometry > entry.second.odometry;
      });
      if (flows) return SecondsSince(start);
    }
    return patience_s;
  }

  // The server's log after it was asked to stop.
  [[nodiscard]] std::string StopServer() {
    server_->Signal(SIGTERM);
    return server_->Wait().output;
  }

 private:
  static std::string DomainText() { return std::to_string(test::TestDomain()); }

  static std::string LastWords(ChildProcess& process) {
    const auto outcome = process.Wait();
    return (outcome.exit_code < 0 ? "by a signal: " : "exit code " + std::to_string(outcome.exit_code) + ": ") +
           outcome.output.substr(outcome.output.size() - std::min<std::size_t>(outcome.output.size(), 600));
  }

  [[nodiscard]] std::vector<std::string> With(std::vector<std::string> arguments, const std::string& member) const {
    for (std::string& argument : members_.ArgumentsOf(member)) arguments.push_back(std::move(argument));
    return arguments;
  }
  void StartServer() {
    server_ = std::make_unique<ChildProcess>(
        With({ProgramPath("cairnd"), "--domain", DomainText(), "--state", (directory_ / "state").string()}, "server"));
    if (!server_->Says(" ready")) throw std::runtime_error("cairnd does not start");
  }
  [[nodiscard]] std::unique_ptr<ChildProcess> StartRobot(int i) const {
    const std::string prefix = "r" + std::to_string(i + 1) + "-";
    return std::make_unique<ChildProcess>(With({ProgramPath("cairn"),
                                                "sim",
                                                "--site",
                                                "hostile",
                                                "--robots",
                                                "1",
                                                "--prefix",
                                                prefix,
                                                "--beams",
                                                "180",
                                                "--hz",
                                                "10",
                                                "--world",
                                                "building",
                                                "--seconds",
                                                "100000",
                                                "--timeout",
                                                "600",
                                                "--domain",
                                                DomainText(),
                                                "--json"},
                                               "robots/" + prefix + "1"));
  }

  const Members members_;
  const TempDirectory directory_;
  std::unique_ptr<ChildProcess> server_;
  std::vector<std::unique_ptr<ChildProcess>> robots_;
};

// Who watches the fleet, as a page does: the poses of its robots, and the map. It lives in the study's process: should
// a datagram end it, the study ends with it.
class Viewer {
 public:
  explicit Viewer(const Members& members) {
    bus_ = test::Must(wire::Bus::Create(members.OptionsOfPage(), "viewer"));
    for (int i = 1; i <= kRobots; ++i)
      poses_.push_back(test::Must(client::PoseClient::Create(*bus_, "r" + std::to_string(i) + "-1")));
    map_ = test::Must(client::MapClient::Create(*bus_, "hostile"));
    queries_ = test::Must(client::QueryClient::Create(*bus_));
  }

  // Seconds until a new pose of each robot has come, a question was answered, and the map is the server's.
  struct News {
    double poses_s = 0.0, answer_s = 0.0, map_s = 0.0;
    [[nodiscard]] double all_s() const { return std::max({poses_s, answer_s, map_s}); }
  };
  [[nodiscard]] News AwaitNews(double patience_s) {
    const auto start = Clock::now();
    for (const auto& robot : poses_) {
      while (robot->Next(0.0)) {  // What came before.
      }
    }
    News news{.answer_s = patience_s, .map_s = patience_s};
    auto poses = std::async(std::launch::async, [&] {
      for (const auto& robot : poses_) {
        if (!robot->Next(patience_s)) return patience_s;
      }
      return SecondsSince(start);
    });
    while (SecondsSince(start) < patience_s) {
      const auto now = queries_->Map("hostile");
      if (!now) continue;
      news.answer_s = std::min(news.answer_s, SecondsSince(start));
      const auto shown = [&] { return map_->epoch() == now->epoch && map_->version() >= now->version; };
      if (!test::Eventually(shown, std::chrono::milliseconds(500))) continue;
      news.map_s = SecondsSince(start);
      break;
    }
    news.poses_s = poses.get();
    return news;
  }
  // How often its parts have joined the domain anew.
  [[nodiscard]] std::string Renewals() const {
    int poses = 0;
    for (const auto& robot : poses_) poses += robot->renewed();
    return Count(poses) + " times for poses, " + Count(map_->renewed()) + " times for the map, " +
           Count(queries_->renewed()) + " times for questions";
  }

 private:
  std::unique_ptr<wire::Bus> bus_;
  std::vector<std::unique_ptr<client::PoseClient>> poses_;
  std::unique_ptr<client::MapClient> map_;
  std::unique_ptr<client::QueryClient> queries_;
};

}  // namespace cairn::studies
