#include "server/server.h"

#include <spdlog/spdlog.h>

#include <asio/post.hpp>
#include <chrono>
#include <future>
#include <string>
#include <utility>
#include <variant>

#include "server/jobs/smooth_job.h"

namespace cairn::server {
namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kHousekeepingPeriod = std::chrono::milliseconds(100);

std::size_t ThreadCount(std::int64_t wanted) {
  return wanted > 0 ? static_cast<std::size_t>(wanted) : std::max(1U, std::thread::hardware_concurrency());
}

Stamp ServerClock() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

Server::Server(const ServerOptions& options, Inbound& inbound, Outbound& outbound)
    : options_(options),
      inbound_(inbound),
      outbound_(outbound),
      robots_pool_(ThreadCount(options.server.threads)),
      maps_pool_(1),
      atlas_(options.maps, options.slam.grid.resolution_m, options.server.create_sites, maps_pool_, MakeSitePorts()),
      roster_(options.robots, options.slam, robots_pool_, MakeRosterPorts()),
      jobs_(
          options.jobs, [this](OutboundValue value) { return outbound_.Send(std::move(value)); }, ServerClock),
      worker_(options.jobs, jobs_, MakeJobWorks()),
      desk_(static_cast<std::size_t>(options.server.query_queue), outbound, MakeDeskPorts()),
      heartbeat_(
          std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.server.stall_limit_s))) {}

Server::~Server() {
  Stop();
}

RosterPorts Server::MakeRosterPorts() {
  return {.send = [this](OutboundValue value) { return outbound_.Send(std::move(value)); },
          .enter_site = [this](const std::string& name) -> Result<std::uint32_t> {
            const auto site = atlas_.Enter(name);
            if (!site) return tl::unexpected(site.error());
            return (*site)->snapshot()->info.epoch;
          },
          .grid_changed =
              [this](const std::string& name, GridChange&& change) {
                if (const auto site = atlas_.Find(name)) site->Change(std::move(change));
              },
          .robots_changed =
              [this](const std::string& name) {
                const auto site = atlas_.Find(name);
                if (site) site->SetRobots(static_cast<std::uint32_t>(roster_.InSite(name).size()));
              }};
}

SitePorts Server::MakeSitePorts() {
  return {.send = [this](OutboundValue value) { return outbound_.Send(std::move(value)); },
          .correct =
              [this](const std::string& site, SessionId id, Correction&& correction) {
                for (const auto& session : roster_.InSite(site)) {
                  if (session->id() != id) continue;
                  session->Adopt(std::move(correction));
                  return true;
                }
                return false;
              }};
}

DeskPorts Server::MakeDeskPorts() {
  Views views;
  views.session = [this](const std::string& robot) -> std::optional<SessionSnapshot> {
    const auto session = roster_.Find(robot);
    if (session == nullptr) return std::nullopt;
    return session->record().snapshot();
  };
  views.sessions = [this] {
    std::vector<SessionSnapshot> snapshots;
    for (const auto& session : roster_.All()) snapshots.push_back(session->record().snapshot());
    return snapshots;
  };
  views.map = [this](const std::string& name) -> std::shared_ptr<const MapSnapshot> {
    const auto site = atlas_.Find(name);
    return site ? site->snapshot() : nullptr;
  };
  views.maps = [this] {
    std::vector<std::shared_ptr<const MapSnapshot>> maps;
    for (const auto& site : atlas_.All()) maps.push_back(site->snapshot());
    return maps;
  };
  views.job = [this](std::uint64_t id) { return jobs_.Find(id); };
  views.jobs = [this](const std::string& site) { return jobs_.OfSite(site); };
  return {.views = std::move(views),
          .submit_job = [this](const std::string& site, JobKind kind, bool enable) -> Result<Job> {
            if (atlas_.Find(site) == nullptr) return Fail(StatusCode::kNotFound, "no site '" + site + "'");
            return worker_.Submit(site, kind, enable);
          },
          .cancel_job = [this](std::uint64_t id) { return jobs_.Cancel(id); },
          .end_session = [this](const std::string& robot) { return roster_.End(robot); },
          .enable_map =
              [this](const std::string& name, std::uint32_t version, Site::Done done) {
                const auto site = atlas_.Find(name);
                if (site == nullptr) return done(Fail(StatusCode::kNotFound, "no site '" + name + "'"));
                site->Enable(version, std::move(done));
              }};
}

std::map<JobKind, JobWork> Server::MakeJobWorks() {
  const auto smooth = std::make_shared<const SmoothJob>(SmoothPorts{
      .collect = [this](const std::string& site, const JobControl& control) { return CollectMaterial(site, control); },
      .add_version =
          [this](const std::string& name, MapVersion&& version) {
            return AwaitMap(name, [&version](Site& site, Site::Done done) {
              site.AddVersion(std::move(version), std::move(done));
            });
          },
      .enable =
          [this](const std::string& name, std::uint32_t version) {
            return AwaitMap(name, [version](Site& site, Site::Done done) { site.Enable(version, std::move(done)); });
          }});
  return {{JobKind::kSmooth, [smooth](const Job& job, bool enable, const JobControl& control) {
             spdlog::info("job {}: smoothing site {}", job.id, job.site);
             auto outcome = smooth->Run(job, enable, control);
             if (outcome) {
               spdlog::info("job {}: map version {}, disagreement {:.6f} -> {:.6f} m^2 ({})", job.id,
                            outcome->map_version, outcome->cost_before, outcome->cost_after, outcome->message);
             } else {
               spdlog::info("job {}: {}", job.id, outcome.error().message);
             }
             return outcome;
           }}};
}

Result<void> Server::Start() {
  for (const std::string& name : options_.server.site_names()) {
    if (const auto site = atlas_.Create(name); !site) return tl::unexpected(site.error());
  }
  desk_.Start();
  worker_.Start();
  dispatcher_ = std::jthread([this](const std::stop_token& stop) { Dispatch(stop); });
  housekeeping_ = std::jthread([this](const std::stop_token& stop) { KeepHouse(stop); });
  return {};
}

void Server::Dispatch(const std::stop_token& stop) {
  while (auto value = inbound_.Pop(stop)) {
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
    roster_.Tick();
    jobs_.Tick();
    if (Clock::now() >= next_publish) {
      PublishMaps();
      next_publish = std::max(next_publish + publish_period, Clock::now());
    }
    CheckHealth();
    next = std::max(next + kHousekeepingPeriod, Clock::now());
    const MutexLock lock(mutex);
    while (!stop.stop_requested() && tick.WaitUntil(mutex, std::min(next, next_publish))) {
    }
  }
}

void Server::PublishMaps() {
  for (const auto& site : atlas_.All()) site->Publish();
}

void Server::CheckHealth() {
  std::map<std::string, Heartbeat::Ask> strands;
  for (const auto& session : roster_.All()) {
    strands.emplace("robot " + session->record().state().robot,
                    [session](std::function<void()> answer) { return session->Post(Probe{std::move(answer)}); });
  }
  for (const auto& site : atlas_.All()) {
    strands.emplace("site " + site->snapshot()->info.site, [site](std::function<void()> answer) {
      site->Probe(std::move(answer));
      return true;
    });
  }
  const std::vector<std::string> stalled = heartbeat_.Check(strands, Clock::now());
  const bool was_healthy = healthy_.exchange(stalled.empty());
  if (was_healthy && !stalled.empty()) spdlog::error("{} does not move; the watchdog is not fed", stalled.front());
}

Result<std::vector<SessionMaterial>> Server::CollectMaterial(const std::string& site, const JobControl& control) {
  const auto sessions = roster_.InSite(site);
  const auto answers = std::make_shared<BoundedChannel<SessionMaterial>>(std::max<std::size_t>(1, sessions.size()));
  for (const auto& session : sessions) {
    // A session that cannot take it now does not answer either, and the deadline names it.
    static_cast<void>(session->Post(SnapshotWanted{
        [answers](SessionMaterial&& material) { static_cast<void>(answers->TryPush(std::move(material))); }}));
  }
  const auto deadline = Clock::now() + std::chrono::duration<double>(options_.jobs.snapshot_timeout_s);
  std::map<SessionId, SessionMaterial> material;  // By id: the job's result does not depend on who answers first.
  while (material.size() < sessions.size()) {
    if (control.cancelled()) return Fail(StatusCode::kCancelled, "cancelled");
    if (Clock::now() > deadline) {
      return Fail(StatusCode::kDeadlineExceeded, std::to_string(sessions.size() - material.size()) +
                                                     " robots did not show their state (jobs.snapshot_timeout_s)");
    }
    if (auto answer = answers->PopFor(std::chrono::milliseconds(50))) material.emplace(answer->session, *answer);
  }
  std::vector<SessionMaterial> all;
  all.reserve(material.size());
  for (auto& [id, one] : material) all.push_back(std::move(one));
  return all;
}

Result<std::uint32_t> Server::AwaitMap(const std::string& name, const std::function<void(Site&, Site::Done)>& ask) {
  const auto site = atlas_.Find(name);
  if (site == nullptr) return Fail(StatusCode::kNotFound, "no site '" + name + "'");
  const auto promise = std::make_shared<std::promise<Result<std::uint32_t>>>();
  auto answer = promise->get_future();
  ask(*site, [promise](Result<std::uint32_t> result) { promise->set_value(std::move(result)); });
  const auto deadline = Clock::now() + std::chrono::duration<double>(options_.jobs.snapshot_timeout_s);
  while (answer.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
    if (stopping_) return Fail(StatusCode::kCancelled, "the server is stopping");
    if (Clock::now() > deadline) {
      return Fail(StatusCode::kDeadlineExceeded, "the map did not switch in time (jobs.snapshot_timeout_s)");
    }
  }
  return answer.get();
}

void Server::Stop() {
  if (stopping_.exchange(true)) return;
  inbound_.Close();
  // Answers may be large and their readers slow; a goodbye does not wait for them.
  outbound_.lane(Outbound::Lane::kReplies).Close();
  if (dispatcher_.joinable()) dispatcher_.join();  // Routes what the channel still holds.
  housekeeping_ = {};
  worker_.Stop();
  FinishSessions();
  PublishMaps();
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
  spdlog::warn("{} robots still had scans to finish when the time was up; they are dropped", sessions.size() - done);
  for (const auto& session : sessions) session->Abandon();
  while (done < sessions.size() && finished->PopFor(std::chrono::milliseconds(300))) ++done;
}

}  // namespace cairn::server
