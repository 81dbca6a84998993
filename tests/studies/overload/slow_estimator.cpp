// Twelve robots stream to a server that has one thread and a filter that takes many times the time there is. The
// service manager must hear of it all the time, questions must be answered, and each scan must be accounted for.
#include "tests/studies/overload/slow_estimator.h"

#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "tests/studies/fleet/live_server.h"
#include "tests/studies/stopwatch.h"

namespace cairn::studies {
namespace {

using namespace std::chrono_literals;

constexpr int kSlowRobots = 12;
constexpr double kLongestAnswer_s = 5.0;

double SecondsBetween(std::chrono::steady_clock::time_point from, std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

// What the service manager of the system hears from a service (sd_notify(3)).
class NotifySocket {
 public:
  explicit NotifySocket(double watchdog_s)
      : watchdog_s_(watchdog_s),
        name_("cairn-study-" + std::to_string(getpid())),
        socket_(socket(AF_UNIX, SOCK_DGRAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name_.copy(address.sun_path + 1, sizeof(address.sun_path) - 2);  // The name of no file (unix(7)).
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name_.size());
    const timeval patience{.tv_sec = 0, .tv_usec = 100'000};
    if (socket_ < 0 || bind(socket_, reinterpret_cast<const sockaddr*>(&address), length) != 0 ||
        setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience)) != 0)
      throw std::runtime_error("no socket of a service manager");
    listener_ = std::jthread([this](const std::stop_token& stop) { Listen(stop); });
  }
  ~NotifySocket() {
    listener_ = {};
    close(socket_);
  }

  [[nodiscard]] std::vector<std::string> Environment() const {
    return {"NOTIFY_SOCKET=@" + name_, "WATCHDOG_USEC=" + std::to_string(std::llround(1e6 * watchdog_s_))};
  }
  // From now on.
  void Restart() {
    const std::lock_guard lock(mutex_);
    last_ = std::chrono::steady_clock::now();
    longest_s_ = 0.0;
    heard_ = 0;
  }
  struct Heard {
    int times = 0;           // That the service said it is alive.
    double longest_s = 0.0;  // Between two of them.
  };
  [[nodiscard]] Heard heard() {
    const std::lock_guard lock(mutex_);
    return {heard_, std::max(longest_s_, SecondsBetween(last_, std::chrono::steady_clock::now()))};
  }

 private:
  void Listen(const std::stop_token& stop) {
    std::array<char, 256> text{};
    while (!stop.stop_requested()) {
      const ssize_t length = recv(socket_, text.data(), text.size(), 0);
      if (length <= 0 || std::string_view(text.data(), static_cast<std::size_t>(length)) != "WATCHDOG=1") continue;
      const std::lock_guard lock(mutex_);
      const auto now = std::chrono::steady_clock::now();
      longest_s_ = std::max(longest_s_, SecondsBetween(last_, now));
      last_ = now;
      ++heard_;
    }
  }

  const double watchdog_s_;
  const std::string name_;
  const int socket_;
  std::mutex mutex_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  double longest_s_ = 0.0;
  int heard_ = 0;
  std::jthread listener_;
};

}  // namespace

void StudySlowEstimator(StudyContext& context) {
  Report& report = context.report;
  const int seconds = context.seconds > 0.0 ? static_cast<int>(context.seconds) : context.Pick(300, 10);
  const double watchdog_s = context.Pick(10.0, 5.0);  // WatchdogSec of deploy/systemd/cairnd.service.in is 10 s.
  // A short drive must be too much as well: more scans, of which few may wait.
  const std::string hz = context.quick ? "20" : "5";
  const int queue = context.Pick(0, 8);
  report.Heading("Twelve robots at " + hz + " Hz, 360 beams; the filter dpslam on one thread");
  NotifySocket socket(watchdog_s);
  std::vector<std::string> settings = {"--set", "slam.filter=dpslam", "--set", "server.threads=1"};
  if (queue > 0) settings.insert(settings.end(), {"--set", "robots.queue_scans=" + std::to_string(queue)});
  LiveServer server(settings, socket.Environment());
  const auto robots =
      server.Start({"sim", "--site", "slow", "--robots", std::to_string(kSlowRobots), "--beams", "360", "--hz", hz,
                    "--world", "building", "--seconds", std::to_string(seconds), "--timeout",
                    "300"});  // The server works on what waits when the robots have stopped.
  socket.Restart();
  std::vector<double> answers_s;
  int unanswered = 0;
  double most_mib = 0.0;
  while (robots->RunningAfter(250ms)) {
    const auto asked = std::chrono::steady_clock::now();
    if (server.queries().Robots()) {
      answers_s.push_back(SecondsBetween(asked, std::chrono::steady_clock::now()));
    } else {
      ++unanswered;
    }
    most_mib = std::max(most_mib, ResidentMibOf(std::stoi(server.pid())));
  }
  const auto heard = socket.heard();
  const nlohmann::json sim = PrintedBy(robots->Wait(LiveServer::kDeadline));
  long long sent = 0, used = 0, dropped = 0, waiting = 0, unexplained = 0;
  std::map<std::string, long long> reasons;
  for (const auto& robot : sim.at("robots")) {
    sent += robot.at("sent").get<long long>();
    used += robot.at("used").get<long long>();
    dropped += robot.at("dropped_total").get<long long>();
    waiting += robot.at("waiting").get<long long>();
    unexplained += robot.at("unexplained").get<long long>();
    for (const auto& [reason, count] : robot.at("dropped").items()) reasons[reason] += count.get<long long>();
  }
  std::string why;
  for (const auto& [reason, count] : reasons) why += (why.empty() ? "" : ", ") + reason + " " + Count(count);
  const Distribution answers = DistributionOf(answers_s);
  Table table({"seconds", "scans", "used", "dropped", "waiting", "unexplained", "alive, times", "longest silence (s)",
               "answers", "unanswered", "answer p50 (s)", "longest (s)", "memory, most (MiB)"});
  table.Add({Count(seconds), Count(sent), Count(used), Count(dropped), Count(waiting), Count(unexplained),
             Count(heard.times), Number(heard.longest_s, 1), Count(static_cast<long long>(answers_s.size())),
             Count(unanswered), Number(answers.median, 3), Number(answers.max, 3), Number(most_mib, 0)});
  report.Add(table, "slow");
  report.Text("Dropped: " + (why.empty() ? "nothing" : why) + ".");
  report.Expect(heard.longest_s < watchdog_s, "the service manager would have killed the server");
  report.Expect(unexplained == 0 && sent == used + dropped + waiting, "scans are not accounted for");
  report.Expect(unanswered == 0 && !answers_s.empty() && answers.max <= kLongestAnswer_s, "questions waited too long");
  report.Expect(dropped > 0, "the estimators were not too slow");
  if (const auto alive = server.queries().Ping(); !alive) report.Fault("afterwards: " + alive.error().message);
}

}  // namespace cairn::studies
