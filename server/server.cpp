#include "server/server.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <string>
#include <utility>
#include <variant>

#include "common/wall_clock.h"
#include "server/slam/site_options_of.h"

namespace cairn::server {
namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kHousekeepingPeriod = std::chrono::milliseconds(100);

std::size_t ThreadCount(std::int64_t wanted) {
  return wanted > 0 ? static_cast<std::size_t>(wanted) : std::max(1U, std::thread::hardware_concurrency());
}

}  // namespace

Server::Server(const ServerOptions& options, Inbound& inbound, Outbound& outbound, Generation generation,
               Journal* journal, const std::filesystem::path& saved)
    : options_(options),
      inbound_(inbound),
      outbound_(outbound),
      journal_(journal),
      robots_pool_(ThreadCount(options.server.threads)),
      maps_pool_(1),
      atlas_(options.maps, options.slam.grid.resolution_m, options.server.create_sites, maps_pool_, outbound, journal,
             generation),
      roster_(options.robots, options.slam, robots_pool_, outbound, atlas_, journal),
      jobs_(options.jobs, outbound, WallClock, journal),
      smooth_(options.jobs, SiteOptionsOf(options.slam), roster_, atlas_, journal, &jobs_),
      relocalise_(options.jobs, SiteOptionsOf(options.slam), roster_, atlas_, smooth_),
      worker_(options.jobs, jobs_,
              [this](const Job& job, bool enable, const JobControl& control) {
                if (job.kind == JobKind::kRelocalise) return relocalise_.Run(job, control);
                return smooth_.Run(job, enable, control);
              }),
      joiner_(options.jobs, roster_, atlas_, jobs_, worker_),
      start_check_(options.jobs, roster_, atlas_),
      lost_robots_(options.jobs, roster_, jobs_, worker_),
      saved_sites_(saved, BytesOf(options.store.max_saved_gib), journal, {outbound, roster_, atlas_, jobs_, worker_}),
      desk_(static_cast<std::size_t>(options.server.query_queue), outbound, roster_, atlas_, jobs_, worker_,
            saved_sites_, generation, journal),
      heartbeat_(
          std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.server.stall_limit_s))) {}

Server::~Server() {
  Stop();
}

Result<void> Server::Restore(StartControl& control) {
  if (auto sites = atlas_.Restore(control); !sites) return sites;
  // Before the sessions: of one that was stored just before a kill, the site may not be stored yet.
  for (const std::string& name : options_.server.site_names()) {
    if (atlas_.IsSetAside(name)) continue;
    if (const auto site = atlas_.Create(name); !site) return tl::unexpected(site.error());
  }
  if (auto sessions = roster_.Restore(control); !sessions) return sessions;
  const auto unfinished = jobs_.Restore();
  if (!unfinished) return tl::unexpected(unfinished.error());
  for (const StoredJob& job : *unfinished) worker_.Requeue(job.job.id, job.enable);
  return {};
}

Result<void> Server::Start(StartControl& control) {
  if (auto restored = Restore(control); !restored) return restored;
  looked_at_ = Clock::now().time_since_epoch();
  saved_sites_.Start();
  desk_.Start();
  worker_.Start();
  dispatcher_ = std::jthread([this](const std::stop_token& stop) { Dispatch(stop); });
  housekeeping_ = std::jthread([this](const std::stop_token& stop) { KeepHouse(stop); });
  return {};
}

void Server::Dispatch(const std::stop_token& stop) {
  while (auto value = inbound_.Pop(stop)) {
    try {
      std::visit(
          [this](auto&& alternative) {
            using Value = std::decay_t<decltype(alternative)>;
            if constexpr (std::is_same_v<Value, Request>) {
              desk_.Take(std::move(alternative));
            } else {
              roster_.Take(std::move(alternative));
            }
          },
          std::move(*value));
    } catch (const std::exception& error) {
      spdlog::error("a value that was received failed with an exception and was dropped: {}", error.what());
    }
  }
}

void Server::KeepHouse(const std::stop_token& stop) {
  const auto publish_period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / options_.maps.publish_rate_hz));
  Mutex mutex;
  CondVar tick;
  const std::stop_callback wake(stop, [&] {
    const MutexLock lock(mutex);
    tick.NotifyAll();
  });
  auto next = Clock::now();
  auto next_publish = next;
  while (!stop.stop_requested()) {
    try {
      roster_.Tick();
      jobs_.Tick();
      joiner_.Tick();
      start_check_.Tick();
      lost_robots_.Tick();
      if (Clock::now() >= next_publish) {
        next_publish = std::max(next_publish + publish_period, Clock::now());
        atlas_.Publish();
      }
      CheckHealth();
      CheckJournal();
    } catch (const std::exception& error) {
      spdlog::error("a turn of the housekeeping failed with an exception: {}", error.what());
    }
    next = std::max(next + kHousekeepingPeriod, Clock::now());
    const MutexLock lock(mutex);
    while (!stop.stop_requested() && tick.WaitUntil(mutex, std::min(next, next_publish))) {
    }
  }
}

bool Server::healthy() const {
  const std::chrono::duration<double> limit(options_.server.stall_limit_s);
  return healthy_ && Clock::now().time_since_epoch() - looked_at_.load() < limit;
}

void Server::CheckHealth() {
  std::map<std::string, Pulse> pulses;
  Pulse& robots = pulses["robots"];  // The sum of all sessions: one session may wait while others make progress.
  for (const auto& session : roster_.All()) {
    const Pulse pulse = session->pulse();
    robots.finished += pulse.finished;
    robots.busy |= session->has_work();
    pulses.emplace("robot " + session->record().state().robot, pulse);
  }
  for (const auto& site : atlas_.All()) pulses.emplace("site " + site->snapshot()->info.site, site->pulse());
  pulses.emplace("dispatcher", Pulse{inbound_.taken(), inbound_.size() > 0});
  pulses.emplace("desk", desk_.pulse());
  for (int lane = 0; lane < Outbound::kLanes; ++lane) {
    const auto& values = outbound_.lane(static_cast<Outbound::Lane>(lane));
    pulses.emplace("outbound lane " + std::to_string(lane), Pulse{values.taken(), values.size() > 0});
  }
  std::vector<std::string> stalled = heartbeat_.Check(pulses, Clock::now());
  if (static_cast<double>(receiving_ns_) * 1e-9 > options_.server.stall_limit_s)
    stalled.emplace_back("the middleware, which received a datagram,");
  const bool was_healthy = healthy_.exchange(stalled.empty());
  looked_at_ = Clock::now().time_since_epoch();
  if (was_healthy && !stalled.empty())
    spdlog::error("{} makes no progress; the systemd watchdog is no longer notified", stalled.front());
}

void Server::CheckJournal() {
  if (journal_ == nullptr) return;
  const JournalHealth health = journal_->health();
  if (health.over_budget && !std::exchange(over_budget_, health.over_budget))
    spdlog::warn("the store is larger than store.max_gib, and all of it is needed");
  over_budget_ = health.over_budget;
  if (health.degraded == std::exchange(journal_degraded_, health.degraded)) return;
  if (health.degraded) {
    spdlog::error("degraded, new data is not stored: {}", health.reason);
  } else {
    spdlog::info("the store works again; everything is durable");
  }
}

void Server::Stop() {
  if (stopping_.exchange(true)) return;
  inbound_.Close();
  // Large replies to slow readers must not delay the last state of the sessions.
  outbound_.lane(Outbound::Lane::kReplies).Close();
  if (dispatcher_.joinable()) dispatcher_.join();  // It first dispatches what the channel still holds.
  housekeeping_ = {};
  saved_sites_.Stop();
  worker_.Cancel();
  FinishSessions();  // Before the job has ended, because that may take as long as a search in a large map.
  worker_.Stop();
  atlas_.Close();
  robots_pool_.join();
  maps_pool_.join();
  desk_.Stop();
  outbound_.Close();
}

void Server::FinishSessions() {
  const auto sessions = roster_.All();
  const auto finished = std::make_shared<BoundedChannel<int>>(std::max<std::size_t>(1, sessions.size()));
  for (const auto& session : sessions) {
    session->Suspend([finished] { static_cast<void>(finished->TryPush(1)); });
  }
  const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                           std::chrono::duration<double>(options_.server.stop_timeout_s));
  std::size_t done = 0;
  while (done < sessions.size() && Clock::now() < deadline) {
    if (finished->PopFor(deadline - Clock::now())) ++done;
  }
  if (done == sessions.size()) return;
  spdlog::warn("{} robots still had waiting scans after server.stop_timeout_s; these scans are dropped",
               sessions.size() - done);
  for (const auto& session : sessions) session->Abandon();
  while (done < sessions.size() && finished->PopFor(std::chrono::milliseconds(300))) ++done;
}

}  // namespace cairn::server
