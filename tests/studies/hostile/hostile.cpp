// cairn-study hostile sends mutated and generated datagrams, from three senders as fast as they can, to a cairnd, two
// robots that stream and a viewer of both, to their own ports and by multicast. What is mutated is recorded all the
// time, so that it has the numbers and names of now: whether a process dies, what the guard drops, whether streams stop
// and how soon they flow again, and whether a client that joins then is answered in every partition of replies.
// Everything is on loopback in a domain of its own. Recording the traffic needs CAP_NET_RAW.
// --seconds: of the long part (600), and of that with DDS Security (--only secure, 120); --runs: of the short ones
// (100).
#include <algorithm>
#include <array>
#include <atomic>
#include <future>
#include <memory>
#include <thread>

#include "common/wire/partitions.h"
#include "tests/eventually.h"
#include "tests/must.h"
#include "tests/studies/hostile/hostile_fleet.h"
#include "tests/studies/study.h"
#include "tests/system/hostile_traffic.h"
#include "tests/temp_directory.h"
#include "tests/test_domain.h"

namespace cairn::studies {
namespace {

using test::TestDomain;

constexpr int kSenders = 3;
constexpr double kFlowTarget_s = 5.0;
constexpr double kQuickFlow_s = 30.0;

double Share(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

// The partitions of replies in which a client that has just joined gets no answer to a ping.
std::vector<int> SilentPartitions(const Members& members, std::chrono::seconds patience) {
  const auto bus = test::Must(wire::Bus::Create(members.OptionsOfPage(), "partitions"));
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
      const HostileFleet::Flow flow = fleet.Look();
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
  outcome.silent = SilentPartitions(fleet.members(), patience);
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

void StudyFleet(StudyContext& context, const Members& members, const std::vector<std::string>& parts) {
  Report& report = context.report;
  HostileFleet fleet(members);
  if (fleet.AwaitFlow(30.0) >= 30.0) return report.Fault("the robots do not stream");
  Viewer viewer(members);
  if (viewer.AwaitNews(30.0).all_s() >= 30.0) return report.Fault("the viewer sees no robots");
  const auto patience = std::chrono::seconds(context.Pick(4, 30));  // For an answer in each partition of replies.
  for (const std::string& part : parts) {
    const bool in_runs = part == "runs";
    report.Heading(in_runs            ? "Short runs: the time until everything flows again"
                   : part == "secure" ? "Traffic without a pause, with DDS Security"
                                      : "Traffic without a pause");
    const int runs = !in_runs ? 1 : context.runs > 0 ? context.runs : context.Pick(100, 3);
    const double seconds = in_runs               ? 5.0
                           : context.seconds > 0 ? context.seconds
                                                 : context.Pick(part == "secure" ? 120.0 : 600.0, 10.0);
    Outcome outcome;
    for (int run = 0; run < runs; ++run) {
      Attack(fleet, viewer, seconds, context.seed + (in_runs ? 7 + static_cast<std::uint64_t>(run) : 0), patience,
             outcome);
      report.Progress("run " + Count(run + 1) + ": " + LastOf(outcome));
    }
    Print(context, part, outcome);
  }
  report.Text("The viewer has joined anew " + viewer.Renewals() + ".");
  const std::string log = fleet.StopServer();
  const auto refused = log.find("datagrams refused");
  report.Text("cairnd's last participant: " + (refused == std::string::npos
                                                   ? "it did not say what it refused"
                                                   : log.substr(refused, log.find('\n', refused) - refused)));
}

void StudyHostile(StudyContext& context) {
  if (!test::MayRecord()) return context.report.Fault("this user may not record the traffic on loopback (CAP_NET_RAW)");
  std::vector<std::string> open;
  for (const char* part : {"long", "runs"})
    if (context.Wants(part)) open.emplace_back(part);
  if (!open.empty()) StudyFleet(context, {}, open);
  if (!context.Wants("secure")) return;
  const TempDirectory directory;
  StudyFleet(context, Members(directory / "fleet"), {"secure"});
}

const Registration kHostile("hostile", "mutated and forged datagrams at full rate against a server and two robots",
                            StudyHostile);

}  // namespace
}  // namespace cairn::studies
