// cairn-study overload: robots stream to a live server while others ask too much of it: a reader of tiles that takes
// none, one whose process stands still, eight clients that ask up to 1,000 questions a second or 400 at once, 200
// robots that open sessions at once, and more jobs than can be done. Does the time from scan to pose stay within twice
// that of a server without them, is every scan accounted for, is each question answered or refused, and does the
// server's memory stay bounded? Times are wall-clock times. Those who ask would be on other machines, so here they have
// the lowest priority. And, in a part of its own, estimators that are too slow for what the robots send.
// --seconds: how long the robots drive in each part (60; slow: 300); --only
// alone|tiles|stands|questions|flood|sessions|jobs|slow.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <csignal>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

#include "client/lib/query_client.h"
#include "tests/loopback.h"
#include "tests/studies/fleet/live_server.h"
#include "tests/studies/overload/slow_estimator.h"
#include "tests/studies/stopwatch.h"
#include "tests/studies/study.h"
#include "tests/test_domain.h"

namespace cairn::studies {
namespace {

using namespace std::chrono_literals;

constexpr int kRobots = 4;
constexpr double kMostLatency = 2.0;       // Times that of the server alone.
constexpr double kMostMemory_mib = 256.0;  // More than the server alone.
constexpr int kClients = 8;
constexpr int kAsking = 4;
constexpr auto kQuestionEvery = 32ms;  // All of them: 1,000 a second.
constexpr int kFlooding = 50;          // 400 of all.
constexpr int kCrowd = 200;
constexpr int kLowestPriority = 19;
constexpr double kPatience_s = 60.0;

// What those who ask were told.
struct Answers {
  std::atomic<std::uint64_t> ok{0}, busy{0}, other{0};

  template <typename T>
  void Count(const Result<T>& result) {
    ++(result ? ok : result.error().code == StatusCode::kResourceExhausted ? busy : other);
  }
};

using Crowd = std::function<void(const std::stop_token& stop, Answers& answers)>;

std::unique_ptr<client::QueryClient> MakeQueries(wire::Bus& bus) {
  auto queries = client::QueryClient::Create(bus, {.timeout_s = kPatience_s});
  if (!queries) throw std::runtime_error(queries.error().message);
  return std::move(*queries);
}

void WaitForStop(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any stopped;
  std::unique_lock lock(mutex);
  stopped.wait(lock, stop, [] { return false; });
}

// Takes the first tile and then nothing more until the end.
void ReadTilesSlowly(const std::stop_token& stop, Answers& answers) {
  const auto bus = test::MakeBus("slow");
  const auto tiles = bus->Subscribe<TileSample>(
      [&](TileSample&&) {
        ++answers.ok;
        WaitForStop(stop);
      },
      {});
  if (!tiles) throw std::runtime_error(tiles.error().message);
  WaitForStop(stop);
}

// A process that reads tiles and stands still again and again, each time for less than a participant may be silent:
// what it has not acknowledged stays with the server meanwhile. After each time it must get tiles again.
void StandStill(const std::stop_token& stop, Answers& answers) {
  constexpr auto kStands = 2s;
  ChildProcess reader({TILE_READER_PATH, std::to_string(test::TestDomain())});
  const auto reads = [&](int stops) { return reader.Says("tile after " + std::to_string(stops) + " signals", 10s); };
  if (!reads(0)) throw std::runtime_error("tile_reader reads nothing: " + reader.Wait().output);
  ++answers.ok;
  std::mutex mutex;
  std::condition_variable_any stopped;
  std::unique_lock lock(mutex);
  for (int stops = 1; !stop.stop_requested(); ++stops) {
    reader.Signal(SIGSTOP);
    stopped.wait_for(lock, stop, kStands, [&] { return stop.stop_requested(); });
    reader.Signal(SIGCONT);
    reader.Signal(SIGUSR1);
    if (stop.stop_requested()) return;
    // The robots may have come to their end meanwhile, and the map with them.
    const bool again = reads(stops);
    if (again || !stop.stop_requested()) ++(again ? answers.ok : answers.other);
  }
}

// `at_once`: questions of each client; a thread waits for each answer. `every`: of each thread.
void Ask(int at_once, std::chrono::milliseconds every, const std::stop_token& stop, Answers& answers) {
  std::vector<std::unique_ptr<wire::Bus>> buses;
  std::vector<std::unique_ptr<client::QueryClient>> clients;
  for (int i = 0; i < kClients; ++i) {
    buses.push_back(test::MakeBus("asks" + std::to_string(i)));
    clients.push_back(MakeQueries(*buses.back()));
  }
  std::vector<std::jthread> threads;
  for (int i = 0; i < kClients * at_once; ++i) {
    threads.emplace_back([&, i] {
      client::QueryClient* const queries = clients[static_cast<std::size_t>(i % kClients)].get();
      auto next = std::chrono::steady_clock::now();
      for (int asked = 0; !stop.stop_requested(); ++asked) {
        if (asked % 4 == 0) answers.Count(queries->Robots());
        if (asked % 4 == 1) answers.Count(queries->Maps());
        if (asked % 4 == 2) answers.Count(queries->Pose("robot" + std::to_string(1 + i % kRobots)));
        if (asked % 4 == 3) answers.Count(queries->Tiles({.site = "load", .area = {}, .level = 3}));
        next = std::max(next + every, std::chrono::steady_clock::now() - 1s);  // What is late is made up for.
        std::this_thread::sleep_until(next);
      }
    });
  }
}

void AskALot(const std::stop_token& stop, Answers& answers) {
  Ask(kAsking, kQuestionEvery, stop, answers);
}

void AskMoreThanCanWait(const std::stop_token& stop, Answers& answers) {
  Ask(kFlooding, 0ms, stop, answers);
}

// All robots are in one process. Each has the writers of a robot, but they share what they read: on machines of their
// own, no robot would receive the answers to all others 200 times.
void OpenManySessions(const std::stop_token& stop, Answers& answers) {
  struct Robot {
    std::unique_ptr<wire::Publication<SessionRequest>> session;
    std::unique_ptr<wire::Publication<ScanSample>> scans;
    std::unique_ptr<wire::Publication<OdometrySample>> odometry;
  };
  const auto bus = test::MakeBus("crowd");
  std::vector<Robot> robots(kCrowd);
  std::mutex mutex;
  std::condition_variable_any changed;
  std::set<ClientId> waiting;  // Clients 1..kCrowd, until they are answered.
  const auto answered = [&](ClientId client, const Result<void>& result) {
    const std::lock_guard lock(mutex);
    if (waiting.erase(client) > 0) answers.Count(result);
    changed.notify_all();
  };
  const auto states = bus->Subscribe<SessionState>([&](SessionState&& state) { answered(state.client, {}); }, {});
  const auto refusals = bus->Subscribe<SessionRefusal>(
      [&](SessionRefusal&& refusal) { answered(refusal.state.client, tl::unexpected(refusal.state.status)); }, {});
  if (!states || !refusals) throw std::runtime_error("no subscription");
  {
    const std::lock_guard lock(mutex);
    for (ClientId client = 1; client <= kCrowd; ++client) waiting.insert(client);
  }
  {
    std::vector<std::jthread> openers;
    for (int i = 0; i < kCrowd; ++i) {
      const ClientId client = static_cast<ClientId>(i) + 1;
      openers.emplace_back([&, i, client] {
        const std::string name = "crowd" + std::to_string(i);
        Robot& robot = robots[static_cast<std::size_t>(i)];
        robot.session = test::Must(bus->Advertise<SessionRequest>(name));
        robot.scans = test::Must(bus->Advertise<ScanSample>(name));
        robot.odometry = test::Must(bus->Advertise<OdometrySample>(name));
        SessionRequest request;
        request.robot = name;
        request.site = "crowd";
        request.sensors = {"laser"};
        request.client = request.session = client;
        if (auto sent = robot.session->Publish(request); !sent) answered(client, sent);
      });
    }
  }
  std::unique_lock lock(mutex);
  changed.wait_for(lock, std::chrono::duration<double>(kPatience_s), [&] { return waiting.empty(); });
  answers.other += waiting.size();
  lock.unlock();
  WaitForStop(stop);
}

void SubmitManyJobs(const std::stop_token& stop, Answers& answers) {
  const auto bus = test::MakeBus("jobs");
  const auto queries = MakeQueries(*bus);
  while (!stop.stop_requested()) answers.Count(queries->SubmitJob("load", JobKind::kSmooth));
  const auto jobs = queries->Jobs();
  if (!jobs) throw std::runtime_error(jobs.error().message);
  for (const Job& job : *jobs)
    if (!IsFinal(job.state)) (void)queries->CancelJob(job.id);  // It may have ended meanwhile.
}

struct Outcome {
  nlohmann::json sim;
  double most_mib = 0.0;
  double asked_s = 0.0;  // How long the others asked.
  std::string fault;     // Of those who ask.
};

Outcome Drive(const std::vector<std::string>& settings, int seconds, const Crowd& crowd, int crowd_priority,
              Answers& answers) {
  LiveServer server(settings);
  const auto robots = server.Start({"sim", "--site", "load", "--robots", std::to_string(kRobots), "--beams", "360",
                                    "--hz", "10", "--world", "building", "--seconds", std::to_string(seconds)});
  const auto streaming = [&] {
    const auto known = server.queries().Robots();
    return known && std::count_if(known->begin(), known->end(),
                                  [](const RobotStatus& robot) { return robot.pose.stamp != 0; }) == kRobots;
  };
  while (!streaming() && robots->RunningAfter(50ms)) continue;
  Outcome outcome;
  const auto begin = std::chrono::steady_clock::now();
  std::jthread asks([&](const std::stop_token& stop) {
    try {
      // Threads inherit it (setpriority(2)), also those of the middleware.
      if (crowd_priority != 0) setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), crowd_priority);
      if (crowd) crowd(stop, answers);
    } catch (const std::exception& error) {
      outcome.fault = error.what();
    }
  });
  while (robots->RunningAfter(100ms))
    outcome.most_mib = std::max(outcome.most_mib, ResidentMibOf(std::stoi(server.pid())));
  outcome.asked_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  asks.request_stop();
  asks.join();
  outcome.sim = PrintedBy(robots->Wait(LiveServer::kDeadline));
  if (const auto alive = server.queries().Ping(); !alive)
    outcome.fault = "no answer afterwards: " + alive.error().message;
  return outcome;
}

void StudyCrowds(StudyContext& context) {
  struct Part {
    const char* name;
    const char* what;
    Crowd crowd;
    std::vector<std::string> settings;  // Of the server.
    double least_rate;                  // Answers and refusals a second, with full settings and without.
    double least_quick_rate;
    bool too_much;  // Some of it must be refused.
  };
  const std::vector<Part> parts = {
      {"alone", "nobody", nullptr, {}, 0.0, 0.0, false},
      {"tiles", "a reader of tiles that takes none", ReadTilesSlowly, {}, 0.0, 0.0, false},
      {"stands", "a reader of tiles whose process stands still", StandStill, {}, 0.0, 0.0, false},
      {"questions", "eight clients, up to 1,000 questions a second", AskALot, {}, 800.0, 100.0, false},
      {"flood",
       "eight clients, 400 questions at once, where 64 may wait",
       AskMoreThanCanWait,
       {"--set", "server.query_queue=64"},
       800.0,
       100.0,
       true},
      {"sessions",
       "200 robots that open sessions at once, where 128 may be",
       OpenManySessions,
       {"--set", "robots.max_robots=128"},
       0.0,
       0.0,
       true},
      {"jobs", "a client that submits jobs without pause", SubmitManyJobs, {}, 5.0, 0.5, true},
  };
  if (std::ranges::none_of(parts, [&](const Part& part) { return context.Wants(part.name); })) return;
  Report& report = context.report;
  const int seconds = context.seconds > 0.0 ? static_cast<int>(context.seconds) : context.Pick(60, 3);
  // A quick run is a test beside other tests. These would leave no time to those with the lowest priority, and measured
  // times would tell how busy the machine is.
  const int priority = context.quick ? 0 : kLowestPriority;
  report.Heading("Four robots at 10 Hz, 360 beams, and beside them");
  Table table({"beside them", "scans", "used", "unexplained", "scan to pose p50 (ms)", "p99 (ms)", "times alone",
               "memory, most (MiB)", "answered", "refused as too much", "other errors",
               "answers and refusals a second"});
  std::optional<double> alone_ms, alone_mib;
  for (const Part& part : parts) {
    if (part.crowd && !context.Wants(part.name)) continue;  // All others are compared with the first.
    Answers answers;
    const Outcome outcome = Drive(part.settings, seconds, part.crowd, priority, answers);
    std::uint64_t sent = 0, used = 0;
    std::int64_t unexplained = 0;
    for (const auto& robot : outcome.sim.at("robots")) {
      sent += robot.at("sent").get<std::uint64_t>();
      used += robot.at("used").get<std::uint64_t>();
      unexplained += robot.at("unexplained").get<std::int64_t>();
    }
    const double p99_ms = outcome.sim.at("pose_latency_p99_ms");
    if (!part.crowd) alone_ms = p99_ms, alone_mib = outcome.most_mib;
    const double times = p99_ms / *alone_ms;
    const double rate = static_cast<double>(answers.ok + answers.busy) / outcome.asked_s;
    const auto count = [](std::uint64_t value) { return Count(static_cast<long long>(value)); };
    table.Add({part.what, count(sent), count(used), Count(unexplained),
               Number(outcome.sim.at("pose_latency_p50_ms"), 1), Number(p99_ms, 1), Number(times, 2),
               Number(outcome.most_mib, 0), count(answers.ok), count(answers.busy), count(answers.other),
               Number(rate, 0)});
    context.report.Progress(std::string(part.what) + ": p99 " + Number(p99_ms, 1) + " ms");
    const std::string who = std::string(part.what) + ": ";
    report.Expect(outcome.fault.empty(), who + outcome.fault);
    report.Expect(unexplained == 0 && sent == used, who + "scans were not used");
    report.Expect(answers.other == 0, who + "errors other than RESOURCE_EXHAUSTED");
    const double least_rate = context.quick ? part.least_quick_rate : part.least_rate;
    report.Expect(rate >= least_rate,
                  who + Number(rate, 1) + " answers and refusals a second are less than " + Number(least_rate, 1));
    if (part.too_much) report.Expect(answers.busy > 0, who + "nothing was refused, so it was not too much");
    report.Expect(!part.crowd || answers.ok > 0, who + "nothing was answered");
    report.Expect(outcome.most_mib <= *alone_mib + kMostMemory_mib, who + "the server took too much memory");
    report.Expect(context.quick || times <= kMostLatency, who + "p99 is " + Number(times, 2) + " times that alone");
  }
  report.Add(table, "overload");
}

void RunOverload(StudyContext& context) {
  StudyCrowds(context);
  if (context.Wants("slow")) StudySlowEstimator(context);
}

const Registration kOverload("overload", "a live server while others ask too much of it", RunOverload);

}  // namespace
}  // namespace cairn::studies
