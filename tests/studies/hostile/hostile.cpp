// cairn-study hostile sends mutated and generated datagrams, from three senders as fast as they can, to a cairnd, two
// robots that stream and a viewer of both, to their own ports and by multicast. What is mutated is recorded all the
// time, so that it has the numbers and names of now: whether a process dies, what the guard drops, whether streams stop
// and how soon they flow again, and whether a client that joins then is answered in every partition of replies.
// Everything is on loopback in a domain of its own. Recording the traffic needs CAP_NET_RAW.
// --seconds: of the long part (600); --runs: of the short ones (100).
#include <algorithm>
#include <array>
#include <atomic>
#include <future>
#include <map>
#include <memory>
#include <thread>

#include "client/lib/map_client.h"
#include "client/lib/pose_client.h"
#include "client/lib/query_client.h"
#include "common/wire/partitions.h"
#include "tests/eventually.h"
#include "tests/must.h"
#include "tests/studies/fleet/live_server.h"
#include "tests/studies/study.h"
#include "tests/system/hostile_traffic.h"
#include "tests/temp_directory.h"
#include "tests/test_domain.h"

namespace cairn::studies {
namespace {

using Clock = std::chrono::steady_clock;
using test::TestDomain;

constexpr int kRobots = 2;
constexpr int kSenders = 3;
constexpr double kFlowTarget_s = 5.0;
constexpr double kQuickFlow_s = 30.0;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double Share(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

// A cairnd and robots, each a process that is started again where it dies.
class HostileFleet {
 public:
  HostileFleet() {
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
  [[nodiscard]] static Flow Look() {
    ChildProcess status({ProgramPath("cairn"), "status", "--timeout", "2", "--json", "--domain", DomainText()});
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
  static std::string DomainText() { return std::to_string(TestDomain()); }

  static std::string LastWords(ChildProcess& process) {
    const auto outcome = process.Wait();
    return (outcome.exit_code < 0 ? "by a signal: " : "exit code " + std::to_string(outcome.exit_code) + ": ") +
           outcome.output.substr(outcome.output.size() - std::min<std::size_t>(outcome.output.size(), 600));
  }

  void StartServer() {
    server_ = std::make_unique<ChildProcess>(std::vector<std::string>{ProgramPath("cairnd"), "--domain", DomainText(),
                                                                      "--state", (directory_ / "state").string()});
    if (!server_->Says(" ready")) throw std::runtime_error("cairnd does not start");
  }
  [[nodiscard]] static std::unique_ptr<ChildProcess> StartRobot(int i) {
    return std::make_unique<ChildProcess>(std::vector<std::string>{ProgramPath("cairn"),
                                                                   "sim",
                                                                   "--site",
                                                                   "hostile",
                                                                   "--robots",
                                                                   "1",
                                                                   "--prefix",
                                                                   "r" + std::to_string(i + 1) + "-",
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
                                                                   "--json"});
  }

  const TempDirectory directory_;
  std::unique_ptr<ChildProcess> server_;
  std::vector<std::unique_ptr<ChildProcess>> robots_;
};

// Who watches the fleet, as a page does: the poses of its robots, and the map. It lives in the study's process: should
// a datagram end it, the study ends with it.
class Viewer {
 public:
  Viewer() {
    wire::WireOptions options;
    options.domain = TestDomain();
    bus_ = test::Must(wire::Bus::Create(options, "viewer"));
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

// The partitions of replies in which a client that has just joined gets no answer to a ping.
std::vector<int> SilentPartitions(std::chrono::seconds patience) {
  wire::WireOptions options;
  options.domain = TestDomain();
  const auto bus = test::Must(wire::Bus::Create(options, "partitions"));
  std::array<std::atomic<bool>, wire::kReplyPartitions> answered{};
  const auto requests = test::Must(bus->Advertise<Request>());
  std::vector<std::unique_ptr<wire::Subscription>> replies;
  for (std::uint64_t partition = 0; partition < wire::kReplyPartitions; ++partition) {
    replies.push_back(test::Must(bus->SubscribeReplies(wire::kReplyPartitions + partition,
                                                       [&, partition](Reply&&) { answered[partition] = true; }, {})));
  }
  const auto all = [&] {
    for (std::uint64_t partition = 0; partition < wire::kReplyPartitions; ++partition) {
      if (answered[partition]) continue;
      Request ping;
      ping.kind = RequestKind::kPing;
      ping.client = wire::kReplyPartitions + partition;
      ping.sequence = 1;
      static_cast<void>(requests->Publish(ping));
    }
    return test::Eventually(
        [&] { return std::all_of(answered.begin(), answered.end(), [](const auto& it) { return it.load(); }); },
        std::chrono::milliseconds(100));
  };
  std::vector<int> silent;
  if (test::Eventually(all, patience)) return silent;
  for (std::uint64_t partition = 0; partition < wire::kReplyPartitions; ++partition) {
    if (!answered[partition]) silent.push_back(static_cast<int>(partition));
  }
  return silent;
}

struct Outcome {
  std::uint64_t sent = 0;
  int recordings = 0;  // How often the traffic was recorded meanwhile.
  double seconds = 0.0;
  std::vector<std::string> deaths;
  std::vector<double> silence_s;  // From each death until all flows again.
  int looks = 0;                  // How often the server was asked during the traffic,
  int unanswered = 0;             // without an answer,
  int stale = 0;                  // or with a stale robot.
  std::vector<double> flows_s;    // From the end of the traffic until everything flows.
  std::vector<double> shows_s;    // From the end of the traffic until the viewer has new poses and the present map.
  Viewer::News news;              // The same for each of its parts, in the last run.
  std::vector<int> silent;        // The partitions of replies that were silent after the last run.
  int silent_runs = 0;            // After how many runs a partition was silent.
};

// One run: traffic for so long, then the time until everything flows.
void Attack(HostileFleet& fleet, Viewer& viewer, double seconds, std::uint64_t seed, std::chrono::seconds patience,
            Outcome& outcome) {
  auto recorded = test::RecordDatagrams(TestDomain(), std::chrono::seconds(2));
  if (recorded.empty()) throw std::runtime_error("there is no traffic on loopback to record");
  const auto start = Clock::now();
  auto end = start;
  {
    test::HostileSenders senders(TestDomain(), std::move(recorded), kSenders, seed);
    while (SecondsSince(start) < seconds) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      for (std::string& dead : fleet.Bury()) {
        const auto death = Clock::now();
        outcome.deaths.push_back(std::move(dead));
        static_cast<void>(fleet.AwaitFlow(60.0));
        outcome.silence_s.push_back(SecondsSince(death));
      }
      const HostileFleet::Flow flow = HostileFleet::Look();
      ++outcome.looks;
      outcome.unanswered += flow.empty() ? 1 : 0;
      outcome.stale += std::any_of(flow.begin(), flow.end(), [](const auto& one) { return one.second.stale; }) ? 1 : 0;
    }
    end = Clock::now();
    senders.Stop();  // The recorder takes up to half a second.
    outcome.sent += senders.sent();
    outcome.recordings += senders.recordings();
  }
  outcome.seconds += std::chrono::duration<double>(end - start).count();
  const double stopping_s = SecondsSince(end);
  auto shows = std::async(std::launch::async, [&viewer] { return viewer.AwaitNews(120.0); });
  outcome.flows_s.push_back(stopping_s + fleet.AwaitFlow(120.0));
  outcome.news = shows.get();
  outcome.shows_s.push_back(stopping_s + outcome.news.all_s());
  for (std::string& dead : fleet.Bury()) outcome.deaths.push_back(std::move(dead));
  outcome.silent = SilentPartitions(patience);
  outcome.silent_runs += outcome.silent.empty() ? 0 : 1;
}

void Print(StudyContext& context, const std::string& name, const Outcome& outcome) {
  Report& report = context.report;
  // A quick run is a test, and the machine may be busy.
  const double most_s = context.Pick(kFlowTarget_s, kQuickFlow_s);
  const std::string most = " within " + Number(most_s, 0) + " s";
  Table table({"traffic (s)", "datagrams", "recordings", "deaths", "deaths per 10^6", "silence after a death p50 (s)",
               "p99 (s)", "longest (s)", "asked", "no answer", "stale", "flows again p50 (s)", "p99 (s)", "longest (s)",
               "in time", "viewer sees all again p50 (s)", "p99 (s)", "longest (s)", "in time"});
  const auto longest = [](const std::vector<double>& values) {
    return values.empty() ? 0.0 : *std::max_element(values.begin(), values.end());
  };
  const auto within_target = [&](const std::vector<double>& values) {
    return std::count_if(values.begin(), values.end(), [&](double value) { return value <= most_s; });
  };
  const auto within = within_target(outcome.flows_s), shown = within_target(outcome.shows_s);
  const std::string runs = " of " + Count(static_cast<long long>(outcome.flows_s.size()));
  table.Add({Number(outcome.seconds, 0), Count(static_cast<long long>(outcome.sent)), Count(outcome.recordings),
             Count(static_cast<long long>(outcome.deaths.size())),
             Number(1e6 * static_cast<double>(outcome.deaths.size()) / static_cast<double>(outcome.sent), 3),
             Number(Share(outcome.silence_s, 0.5), 2), Number(Share(outcome.silence_s, 0.99), 2),
             Number(longest(outcome.silence_s), 2), Count(outcome.looks), Count(outcome.unanswered),
             Count(outcome.stale), Number(Share(outcome.flows_s, 0.5), 2), Number(Share(outcome.flows_s, 0.99), 2),
             Number(longest(outcome.flows_s), 2), Count(within) + runs, Number(Share(outcome.shows_s, 0.5), 2),
             Number(Share(outcome.shows_s, 0.99), 2), Number(longest(outcome.shows_s), 2), Count(shown) + runs});
  report.Add(table, name);
  for (const std::string& death : outcome.deaths) report.Text("Died: " + death);
  std::string silences;
  for (const double silence : outcome.silence_s) silences += (silences.empty() ? "" : ", ") + Number(silence, 2);
  report.Text("Silences after deaths (s): " + (silences.empty() ? "none" : silences));
  report.Expect(outcome.deaths.empty(), "a process died");
  report.Expect(outcome.recordings > 0, "the traffic was not recorded anew");
  report.Expect(within == static_cast<long>(outcome.flows_s.size()), "a stream did not flow again" + most);
  report.Text("Runs after which a client that had just joined got no answer in a partition of replies: " +
              Count(outcome.silent_runs));
  report.Expect(outcome.silent_runs == 0, "a partition of replies stayed silent");
  report.Expect(shown == static_cast<long>(outcome.shows_s.size()), "a viewer did not see all again" + most);
}

// What came after the last run.
std::string LastOf(const Outcome& outcome) {
  return "flows again after " + Number(outcome.flows_s.back(), 2) + " s, the viewer has poses after " +
         Number(outcome.news.poses_s, 2) + " s, an answer after " + Number(outcome.news.answer_s, 2) +
         " s, the map after " + Number(outcome.news.map_s, 2) + " s, " +
         Count(static_cast<long long>(outcome.silent.size())) + " partitions of replies are silent, " +
         Count(static_cast<long long>(outcome.deaths.size())) + " deaths so far" +
         (outcome.deaths.empty() ? "" : ", the last one " + outcome.deaths.back());
}

void StudyHostile(StudyContext& context) {
  Report& report = context.report;
  if (!test::MayRecord()) return report.Fault("this user may not record the traffic on loopback (CAP_NET_RAW)");
  HostileFleet fleet;
  if (fleet.AwaitFlow(30.0) >= 30.0) return report.Fault("the robots do not stream");
  Viewer viewer;
  if (viewer.AwaitNews(30.0).all_s() >= 30.0) return report.Fault("the viewer sees no robots");
  const auto patience = std::chrono::seconds(context.Pick(4, 30));  // For an answer in each partition of replies.
  if (context.Wants("long")) {
    report.Heading("Traffic without a pause");
    Outcome outcome;
    Attack(fleet, viewer, context.seconds > 0 ? context.seconds : context.Pick(600.0, 10.0), context.seed, patience,
           outcome);
    report.Progress(LastOf(outcome));
    Print(context, "long", outcome);
  }
  if (context.Wants("runs")) {
    report.Heading("Short runs: the time until everything flows again");
    const int runs = context.runs > 0 ? context.runs : context.Pick(100, 3);
    Outcome outcome;
    for (int run = 0; run < runs; ++run) {
      Attack(fleet, viewer, 5.0, context.seed + 7 + static_cast<std::uint64_t>(run), patience, outcome);
      report.Progress("run " + Count(run + 1) + ": " + LastOf(outcome));
    }
    Print(context, "runs", outcome);
  }
  report.Text("The viewer has joined anew " + viewer.Renewals() + ".");
  const std::string log = fleet.StopServer();
  const auto refused = log.find("datagrams refused");
  report.Text("cairnd's last participant: " + (refused == std::string::npos
                                                   ? "it did not say what it refused"
                                                   : log.substr(refused, log.find('\n', refused) - refused)));
}

const Registration kHostile("hostile", "mutated and forged datagrams at full rate against a server and two robots",
                            StudyHostile);

}  // namespace
}  // namespace cairn::studies
