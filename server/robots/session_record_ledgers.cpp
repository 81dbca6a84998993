// When the ledgers of a session are sent to its client.
#include "server/robots/session_record.h"

namespace cairn::server {

Ledger SessionRecord::LedgerOf(const Stream& stream) const {
  Ledger ledger = stream.account.ledger();
  const Ledger odometry = odometry_.account.ledger();
  const auto count = [&odometry](DropReason reason) { return odometry.dropped[static_cast<std::size_t>(reason)]; };
  ledger.session = status_.session.session;
  ledger.odometry_received = odometry.received;
  ledger.odometry_merged = count(DropReason::kQueueFull);
  ledger.odometry_dropped = odometry.dropped_total() - ledger.odometry_merged - count(DropReason::kLostOnWire);
  return ledger;
}

bool SessionRecord::IsDue(const Stream& stream, Clock::time_point now, Urgency urgency, Clock::duration period) {
  const std::uint64_t settled = stream.account.settled_count();
  const bool burst = settled - stream.settled_when_taken >= kSettledBurst;
  const bool drained = urgency == Urgency::kDrained && settled != stream.settled_when_taken;
  return urgency == Urgency::kNow || (stream.changed && (burst || drained || now - stream.taken >= period));
}

Ledger SessionRecord::TakeLedger(Stream& stream, Clock::time_point now) const {
  stream.changed = false;
  stream.settled_when_taken = stream.account.settled_count();
  stream.taken = now;
  return LedgerOf(stream);
}

std::vector<Ledger> SessionRecord::TakeDueLedgers(Clock::time_point now, Urgency urgency) {
  const MutexLock lock(mutex_);
  std::vector<Ledger> due;
  for (auto& [sensor_id, stream] : streams_) {
    if (IsDue(stream, now, urgency, ledger_period_)) due.push_back(TakeLedger(stream, now));
  }
  // No client waits for the ledger of the odometry alone, however many samples settle. It is sent just before those of
  // the scans, so that a client removes odometry and scans of the same time.
  const bool rested = now - odometry_.taken >= ledger_period_;
  if (urgency == Urgency::kNow || (odometry_.changed && (rested || !due.empty())))
    due.insert(due.begin(), TakeLedger(odometry_, now));
  return due;
}

void SessionRecord::MarkUnsent(NameId sensor_id) {
  const MutexLock lock(mutex_);
  if (Stream* const stream = Find(sensor_id)) stream->changed = true;
  if (sensor_id == HashName(kOdometry)) odometry_.changed = true;
}

void SessionRecord::Durable(const std::vector<JournalEntry>& entries) {
  const MutexLock lock(mutex_);
  const auto scan = [this](const StreamId& of, std::uint64_t sequence) CAIRN_NO_THREAD_SAFETY_ANALYSIS {
    Stream* const stream = of.session == status_.session.session ? Find(of.sensor_id) : nullptr;
    if (stream == nullptr) return;
    stream->account.Durable(sequence);
    stream->changed = true;
  };
  for (const JournalEntry& entry : entries) {
    if (const auto* const taken = std::get_if<ScanTaken>(&entry)) {
      scan(taken->stream, taken->scan->sequence);
    } else if (const auto* const refused = std::get_if<ScanRefused>(&entry)) {
      scan(refused->stream, refused->sequence);
    } else if (const auto* const odometry = std::get_if<OdometryTaken>(&entry)) {
      if (odometry->stream.session != status_.session.session) continue;
      odometry_.account.Durable(odometry->odometry.sequence);
      odometry_.changed = true;
    }
  }
}

}  // namespace cairn::server
