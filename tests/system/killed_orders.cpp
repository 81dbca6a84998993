#include "tests/system/killed_orders.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "tests/eventually.h"
#include "tests/must.h"
#include "tests/test_domain.h"

namespace cairn::test {
namespace {

constexpr std::size_t kMostWaitingJobs = 2;
// What is remembered. The server keeps more (killed_fleet.cpp), among them what orders have made that were not
// answered.
constexpr std::size_t kVersions = 32, kJobs = 32;

std::size_t NotEnded(const std::map<std::uint64_t, Job>& jobs) {
  return static_cast<std::size_t>(
      std::count_if(jobs.begin(), jobs.end(), [](const auto& job) { return !IsFinal(job.second.state); }));
}

}  // namespace

KilledOrders::KilledOrders(std::string site, std::uint64_t seed) : site_(std::move(site)), random_(seed) {
  wire::WireOptions options;
  options.domain = TestDomain();
  bus_ = Must(wire::Bus::Create(options, "orders"));
  queries_ = Must(client::QueryClient::Create(*bus_, {.timeout_s = 1.0}));
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

KilledOrders::~KilledOrders() = default;

void KilledOrders::Break(const std::string& what) {
  if (std::ranges::find(outcome_.broken, what) == outcome_.broken.end()) outcome_.broken.push_back(what);
}

void KilledOrders::PromiseHeld(std::set<std::uint32_t>&& heard) {
  versions_.merge(heard);
  while (versions_.size() > kVersions) versions_.erase(versions_.begin());
}

void KilledOrders::SubmitJob() {
  if (NotEnded(jobs_) >= kMostWaitingJobs) return;
  auto heard = heard_;
  const auto job = queries_->SubmitJob(site_, JobKind::kSmooth, false);
  if (!job) return;
  if (job->generation == generation_) PromiseHeld(std::move(heard));
  jobs_[job->id] = *job;
  ++outcome_.jobs;
}

void KilledOrders::SwitchMap() {
  std::vector<std::uint32_t> choice(versions_.begin(), versions_.end());
  choice.push_back(1);
  if (may_be_enabled_.size() == 1) std::erase(choice, *may_be_enabled_.begin());
  if (choice.empty()) return;
  const std::uint32_t wanted = choice[std::uniform_int_distribution<std::size_t>(0, choice.size() - 1)(random_)];
  const bool switches = !may_be_enabled_.contains(wanted);
  // Until the answer has come, the order may be carried out or not.
  may_be_enabled_.insert(wanted);
  auto heard = heard_;
  const auto map = queries_->EnableMap(site_, wanted);
  if (!map) return;
  if (map->generation == generation_) PromiseHeld(std::move(heard));
  may_be_enabled_ = {wanted};
  outcome_.switches += switches ? 1 : 0;
}

bool KilledOrders::Check() {
  const auto map = queries_->Map(site_);
  if (!map || map->tile_count == 0) return false;  // Before the first scan there is nothing to smooth.
  // What the server before has said, and perhaps not stored, is heard again below if it is there.
  if (std::exchange(generation_, map->generation) != map->generation) heard_.clear();
  if (!may_be_enabled_.contains(map->enabled_version))
    Break(fmt::format("version {} is enabled instead of {}", map->enabled_version, fmt::join(may_be_enabled_, " or ")));
  for (const std::uint32_t version : versions_) {
    if (std::ranges::none_of(map->versions, [version](const auto& one) { return one.version == version; }))
      Break(fmt::format("version {} is gone", version));
  }
  if (!CheckJobs()) return false;
  ++outcome_.checks;
  return true;
}

bool KilledOrders::CheckJobs() {
  for (auto& [id, known] : jobs_) {
    const auto job = queries_->GetJob(id);
    if (!job && job.error().code != StatusCode::kNotFound) return false;
    if (!job) {
      Break(fmt::format("job {} is not known", id));
      continue;
    }
    if (job->submitted != known.submitted) Break(fmt::format("job {} is another one", id));
    // A job during which eight servers have died is given up by the ninth, because it may be the cause.
    const bool given_up = job->message.find("times while this job ran") != std::string::npos;
    if (given_up && !IsFinal(known.state)) ++outcome_.given_up;
    if (IsFinal(job->state) && job->state != JobState::kSucceeded && !given_up)
      Break(fmt::format("job {} is {}: {}", id, JobStateName(job->state), job->message));
    if (job->state == JobState::kSucceeded) heard_.insert(job->map_version);
    known = *job;
  }
  while (jobs_.size() > kJobs && IsFinal(jobs_.begin()->second.state)) {
    ++outcome_.ended;
    jobs_.erase(jobs_.begin());
  }
  return true;
}

void KilledOrders::Run(const std::stop_token& stop) {
  std::uniform_real_distribution<double> pause_s(0.0, 0.2);
  std::bernoulli_distribution submits(0.5);
  while (!stop.stop_requested()) {
    // The moment of an order is random.
    std::this_thread::sleep_for(std::chrono::duration<double>(pause_s(random_)));
    if (!Check()) continue;
    if (submits(random_)) {
      SubmitJob();
    } else {
      SwitchMap();
    }
  }
}

KilledOrders::Outcome KilledOrders::Finish() {
  thread_.request_stop();
  thread_.join();
  bool answered = false;
  const bool ended = Eventually(
      [&] {
        answered = Check();
        return answered && NotEnded(jobs_) == 0;
      },
      std::chrono::seconds(300));  // Jobs run at a low priority.
  if (!answered) Break("the server does not answer");
  if (answered && !ended) Break(fmt::format("{} jobs have not ended", NotEnded(jobs_)));
  // Also what the last jobs have made.
  PromiseHeld(std::exchange(heard_, {}));
  if (ended && !Check()) Break("the server does not answer");
  outcome_.ended += static_cast<int>(jobs_.size() - NotEnded(jobs_));
  return outcome_;
}

}  // namespace cairn::test
