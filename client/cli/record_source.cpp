#include "client/cli/record_source.h"

#include <type_traits>
#include <utility>

#include "common/wall_clock.h"

namespace cairn::client {

RecordSource::RecordSource(wire::Bus& bus, RecordQueue& queue, const RecordSourceOptions& options)
    : bus_(bus),
      queue_(queue),
      options_(options),
      watch_(
          bus, [this](QueryClient& queries) { return Behind(queries); }, [this] { Renew(); }) {}

RecordSource::~RecordSource() {
  watch_.Stop();  // It would change the wire.
}

Result<std::unique_ptr<RecordSource>> RecordSource::Create(wire::Bus& bus, RecordQueue& queue,
                                                           const RecordSourceOptions& options) {
  std::unique_ptr<RecordSource> source(new RecordSource(bus, queue, options));
  auto wire = source->Connect(bus, 0);
  if (!wire) return tl::unexpected(wire.error());
  const MutexLock lock(source->mutex_);
  source->wire_ = *std::move(wire);
  return source;
}

Result<std::unique_ptr<RecordSource::Wire>> RecordSource::Connect(wire::Bus& bus, int number) {
  auto wire = std::make_unique<Wire>();
  Result<void> done = Subscribe<SessionState>(bus, number, *wire);
  if (done) done = Subscribe<Ledger>(bus, number, *wire);
  if (done) done = Subscribe<PoseReport>(bus, number, *wire);
  if (done) done = Subscribe<Job>(bus, number, *wire);
  if (done) done = Subscribe<MapInfo>(bus, number, *wire);
  if (done && options_.samples) done = Subscribe<OdometrySample>(bus, number, *wire);
  if (done && options_.samples) done = Subscribe<ScanSample>(bus, number, *wire);
  if (!done) return tl::unexpected(done.error());
  if (options_.samples) wire->scans = wire->subscriptions.back().get();
  return wire;
}

template <typename Value>
Result<void> RecordSource::Subscribe(wire::Bus& bus, int number, Wire& wire) {
  auto made =
      bus.template Subscribe<Value>([this, number](Value&& value) { OnValue<Value>(number, std::move(value)); });
  if (!made) return tl::unexpected(made.error());
  wire.subscriptions.push_back(*std::move(made));
  return {};
}

template <typename Value>
void RecordSource::OnValue(int number, Value&& value) {
  RecordEvent event;
  event.time = WallClock();
  if constexpr (std::is_same_v<Value, ScanSample> || std::is_same_v<Value, OdometrySample>) {
    if (!options_.robots.empty() && options_.robots.count(value.stream.robot_id) == 0) return;
  }
  {
    const MutexLock lock(mutex_);
    if (number != number_) return;
    if constexpr (std::is_same_v<Value, PoseReport>) {
      constexpr std::size_t kMostRobots = 4096;
      if (arrived_.size() < kMostRobots || arrived_.count(value.robot_id) > 0)
        arrived_[value.robot_id] = {value.generation, value.stamp};
    }
  }
  if constexpr (std::is_same_v<Value, PoseReport>) watch_.Arrived();
  event.value = std::forward<Value>(value);
  queue_.Push(std::move(event));
}

// Whether the server has another pose of a robot than the last one that arrived, and another one than at the last
// question.
bool RecordSource::Behind(QueryClient& queries) {
  const auto robots = queries.Robots();
  if (!robots) return false;
  NewestPoses answer;
  for (const RobotStatus& robot : *robots)
    if (robot.pose.reason != PoseReason::kWaiting)
      answer[robot.pose.robot_id] = {robot.pose.generation, robot.pose.stamp};
  const NewestPoses before = std::exchange(answered_, answer);
  const MutexLock lock(mutex_);
  for (const auto& [robot, pose] : answer) {
    const auto told = before.find(robot);
    const auto here = arrived_.find(robot);
    const bool is_new = told != before.end() && told->second != pose;
    if (is_new && (here == arrived_.end() || here->second != pose)) return true;
  }
  return false;
}

// What was received before may have been forged.
void RecordSource::Renew() {
  auto bus = wire::Bus::Create(bus_.options(), "recorder");
  if (!bus) return;
  int number = 0;
  {
    const MutexLock lock(mutex_);
    number = ++number_;
    arrived_.clear();
  }
  auto wire = Connect(**bus, number);
  if (!wire) return;
  (*wire)->own = *std::move(bus);
  std::unique_ptr<Wire> before;  // Its callbacks take the mutex: it goes when the lock is released.
  {
    const MutexLock lock(mutex_);
    before = std::exchange(wire_, *std::move(wire));
  }
}

int RecordSource::scan_writers() const {
  const MutexLock lock(mutex_);
  return wire_ != nullptr && wire_->scans != nullptr ? wire_->scans->matched() : 0;
}

int RecordSource::renewed() const {
  const MutexLock lock(mutex_);
  return number_;
}

}  // namespace cairn::client
