#include "client/web/server_watch.h"

#include <algorithm>
#include <utility>

#include "common/wall_clock.h"

namespace cairn::web {
namespace {

std::int64_t NowMs() {
  return WallClock() / kNanosPerMillisecond;
}

bool IsOdometry(const Ledger& ledger) {
  return ledger.sensor == "odometry";
}

}  // namespace

std::set<std::string> ServerView::Sites() const {
  std::set<std::string> sites;
  const auto add = [&](const std::string& site) {
    if (!site.empty() && sites.size() < kMaxSites) sites.insert(site);
  };
  for (const MapInfo& map : maps) add(map.site);
  for (const RobotStatus& robot : status.robots) add(robot.session.site);
  return sites;
}

const MapInfo* ServerView::Map(const std::string& site) const {
  const auto found = std::find_if(maps.begin(), maps.end(), [&](const MapInfo& map) { return map.site == site; });
  return found == maps.end() ? nullptr : &*found;
}

Result<std::unique_ptr<ServerWatch>> ServerWatch::Create(wire::Bus& bus) {
  // One answer late is no reason to call the server gone.
  auto queries = client::QueryClient::Create(bus, {.timeout_s = 1.5});
  if (!queries) return tl::unexpected(queries.error());
  auto strays = StrayStreams::Create(bus);
  if (!strays) return tl::unexpected(strays.error());
  std::unique_ptr<ServerWatch> watch(new ServerWatch(std::move(*queries), std::move(*strays)));
  watch->thread_ = std::thread([self = watch.get()] { self->Run(); });
  return watch;
}

ServerWatch::~ServerWatch() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    changed_.NotifyAll();
  }
  if (thread_.joinable()) thread_.join();
}

std::shared_ptr<const ServerView> ServerWatch::view() const {
  const MutexLock lock(mutex_);
  return view_;
}

std::shared_ptr<const ServerView> ServerWatch::WaitForNewer(std::uint64_t number, std::chrono::milliseconds most) {
  const auto deadline = Clock::now() + most;
  const MutexLock lock(mutex_);
  while (view_->number <= number && !stopping_ && changed_.WaitUntil(mutex_, deadline)) {
  }
  return view_;
}

std::shared_ptr<void> ServerWatch::Look() {
  {
    const MutexLock lock(mutex_);
    if (++looking_ == 1) asked_for_ = true;
    changed_.NotifyAll();
  }
  return {nullptr, [this](void*) {
            const MutexLock lock(mutex_);
            --looking_;
          }};
}

void ServerWatch::AskNow() {
  const MutexLock lock(mutex_);
  asked_for_ = true;
  changed_.NotifyAll();
}

void ServerWatch::Run() {
  // However often somebody comes and goes, the server is not asked more often than this.
  constexpr std::chrono::milliseconds kSoonest{100};
  constexpr std::chrono::milliseconds kWatched{250}, kUnwatched{2000};
  for (;;) {
    const auto began = Clock::now();
    Publish(Ask());
    const MutexLock lock(mutex_);
    for (;;) {
      if (stopping_) return;
      const auto pause = asked_for_ ? kSoonest : looking_ > 0 ? kWatched : kUnwatched;
      if (!changed_.WaitUntil(mutex_, began + pause)) break;
    }
    if (asked_for_) listed_ = {};
    asked_for_ = false;
  }
}

// The view before, with what the server answers now.
ServerView ServerWatch::Ask() {
  constexpr std::chrono::seconds kListPeriod{1};
  ServerView view = *this->view();
  ++view.number;
  auto status = queries_->ServerStatus();
  view.connected = status.has_value();
  if (!status) return view;
  view.status = std::move(*status);
  view.answered_ms = NowMs();
  const bool runs = std::any_of(view.jobs.begin(), view.jobs.end(), [](const Job& job) { return !IsFinal(job.state); });
  if (runs || Clock::now() - listed_ >= kListPeriod) {
    AddLists(view);
  }
  AddFlows(view);
  return view;
}

// What is not asked for as often as the status.
void ServerWatch::AddLists(ServerView& view) {
  listed_ = Clock::now();
  if (auto version = queries_->Ping()) view.version = std::move(*version);
  if (auto maps = queries_->Maps()) view.maps = std::move(*maps);
  if (auto jobs = queries_->Jobs()) view.jobs = std::move(*jobs);
  if (auto ros2 = queries_->Ros2())
    view.ros2 = ros2->door.enabled ? std::make_shared<const Ros2Report>(std::move(*ros2)) : nullptr;
  view.strays = strays_->Shown(listed_);
}

void ServerWatch::AddFlows(ServerView& view) {
  const auto now = Clock::now();
  const double seconds = std::chrono::duration<double>(now - sampled_).count();
  if (seconds < 1.0) return;
  std::map<std::string, Counts> counts;
  std::map<std::string, FlowSample> samples;
  const std::set<std::string> sites = view.Sites();
  for (const RobotStatus& robot : view.status.robots) {
    if (sites.count(robot.session.site) == 0) continue;
    FlowSample& sample = samples[robot.session.site];
    Counts& count = counts[robot.session.site];
    for (const Ledger& ledger : robot.ledgers) {
      if (IsOdometry(ledger)) continue;
      count.used += ledger.used;
      count.dropped += ledger.dropped_total();
      if (robot.session.phase != SessionPhase::kActive) continue;
      sample.latency_p50_ms = std::max(sample.latency_p50_ms, ledger.latency_p50_ms);
      sample.latency_p99_ms = std::max(sample.latency_p99_ms, ledger.latency_p99_ms);
    }
  }
  for (auto& [site, sample] : samples) {
    // A server that was started again counts anew; a robot that has left is no negative flow.
    const auto rate = [&](std::uint64_t count, std::uint64_t before) {
      return count > before ? static_cast<double>(count - before) / seconds : 0.0;
    };
    if (const auto before = counted_.find(site); before != counted_.end()) {
      sample.used_per_s = rate(counts[site].used, before->second.used);
      sample.dropped_per_s = rate(counts[site].dropped, before->second.dropped);
    }
    sample.time_ms = NowMs();
    Flow flow = flows_.count(site) > 0 ? *flows_[site] : Flow();
    if (flow.size() >= kMaxSamples) flow.erase(flow.begin());
    flow.push_back(sample);
    flows_[site] = std::make_shared<const Flow>(std::move(flow));
  }
  std::erase_if(flows_, [&](const auto& flow) { return sites.count(flow.first) == 0; });
  counted_ = std::move(counts);
  sampled_ = now;
  view.flows = flows_;
}

void ServerWatch::Publish(ServerView&& view) {
  auto published = std::make_shared<const ServerView>(std::move(view));
  const MutexLock lock(mutex_);
  view_ = std::move(published);
  changed_.NotifyAll();
}

}  // namespace cairn::web
