// The rooms of a server with a small estimator, without DDS, and what its doors would do with the results.
#pragma once

#include <spdlog/spdlog.h>

#include <functional>
#include <memory>
#include <utility>

#include "server/queries/desk.h"
#include "tests/fuzz/fuzz_target.h"

namespace cairn::fuzz {

constexpr double kResolution_m = 0.25;       // The whole room is one chunk of the map,
constexpr Pose2 kStart = {16.0, 16.0, 0.0};  // where the robot starts here.

inline slam::MapperOptions TinyEstimator() {
  slam::MapperOptions options;
  options.filter.particles = 4;
  options.max_chunks = 256;
  options.max_keyframes = 64;
  options.retire.from_keyframes = 4;
  options.retire.recent_keyframes = 2;
  options.grid.resolution_m = kResolution_m;
  return options;
}

class Rooms {
 public:
  // What the server sends goes to `door`, in the thread of whoever asks for it.
  using Door = std::function<void(server::OutboundValue&&)>;

  explicit Rooms(Door door, server::Journal* journal = nullptr)
      : door_(std::move(door)),
        atlas_({}, kResolution_m, true, pool_, outbound_, journal, kGeneration),
        roster_({}, TinyEstimator(), pool_, outbound_, atlas_, journal),
        jobs_(
            {}, outbound_, [] { return Stamp{0}; }, journal),
        worker_({}, jobs_,
                [](const Job&, bool, const server::JobControl&) {
                  return Result<server::JobOutcome>(server::JobOutcome{});
                }),
        saved_sites_({}, 0, nullptr, {outbound_, roster_, atlas_, jobs_, worker_}),
        desk_(64, outbound_, roster_, atlas_, jobs_, worker_, saved_sites_, kGeneration) {
    spdlog::set_level(spdlog::level::off);  // Every damaged record is an error in the log.
    saved_sites_.Start();
    desk_.Start();
  }
  ~Rooms() {
    desk_.Stop();
    saved_sites_.Stop();
    worker_.Stop();
    pool_.join();
  }
  Rooms(const Rooms&) = delete;
  Rooms& operator=(const Rooms&) = delete;

  server::Atlas& atlas() { return atlas_; }
  server::Roster& roster() { return roster_; }
  server::JobList& jobs() { return jobs_; }

  // Everything that came is handled, and what it made is at the door. Nothing comes any more.
  void Finish() {
    for (const auto& session : roster_.All()) session->Suspend([] {});
    roster_.Tick();
    jobs_.Tick();
    for (const auto& site : atlas_.All()) site->Publish();
    pool_.join();
    Empty(server::Outbound::Lane::kLive);
    Empty(server::Outbound::Lane::kMap);
  }
  // The whole answer, which has its end.
  void Ask(Request request) {
    request.client = 42;
    desk_.Take(std::move(request));
    for (bool last = false; !last;) {
      auto value = outbound_.lane(server::Outbound::Lane::kReplies).PopFor(std::chrono::seconds(10));
      Must(value.has_value(), "every request is answered");
      last = std::get<Reply>(*value).last;
      door_(std::move(*value));
    }
  }

 private:
  static constexpr Generation kGeneration = 7;

  void Empty(server::Outbound::Lane lane) {
    while (auto value = outbound_.lane(lane).TryPop()) door_(std::move(*value));
  }

  const Door door_;
  asio::thread_pool pool_{1};
  server::Outbound outbound_{4096};
  server::Atlas atlas_;
  server::Roster roster_;
  server::JobList jobs_;
  server::JobWorker worker_;
  server::SavedSites saved_sites_;
  server::Desk desk_;
};

}  // namespace cairn::fuzz
