#include "common/wire/reader_events.h"

#include <utility>

namespace cairn::wire {
namespace {

namespace fd = eprosima::fastdds::dds;

std::string PolicyName(fd::QosPolicyId_t id) {
  switch (id) {
    case fd::DURABILITY_QOS_POLICY_ID:
      return "durability";
    case fd::DEADLINE_QOS_POLICY_ID:
      return "deadline";
    case fd::OWNERSHIP_QOS_POLICY_ID:
      return "ownership";
    case fd::LIVELINESS_QOS_POLICY_ID:
      return "liveliness";
    case fd::PARTITION_QOS_POLICY_ID:
      return "partition";
    case fd::RELIABILITY_QOS_POLICY_ID:
      return "reliability";
    case fd::DATAREPRESENTATION_QOS_POLICY_ID:
      return "data_representation";
    default:
      return "policy " + std::to_string(static_cast<unsigned>(id));
  }
}

}  // namespace

std::optional<ReaderNews> ReaderEvents::Wait() {
  const MutexLock lock(mutex_);
  while (!pending_ && !stopped_) wake_.Wait(mutex_);
  if (stopped_) return std::nullopt;
  pending_ = false;
  return std::exchange(news_, {});
}

void ReaderEvents::Stop() {
  const MutexLock lock(mutex_);
  stopped_ = true;
  wake_.NotifyAll();
}

void ReaderEvents::on_data_available(Reader*) {
  const MutexLock lock(mutex_);
  pending_ = true;
  wake_.NotifyOne();
}

void ReaderEvents::on_subscription_matched(Reader*, const fd::SubscriptionMatchedStatus& status) {
  matched_.store(status.current_count);
  const MutexLock lock(mutex_);
  news_.matched = status.current_count;
  // A writer that leaves normally may be removed before its lease runs out, without a change of liveliness.
  if (status.current_count_change < 0) news_.liveliness.push_back({status.last_publication_handle, false, true});
  pending_ = true;
  wake_.NotifyOne();
}

void ReaderEvents::on_liveliness_changed(Reader*, const eprosima::fastrtps::LivelinessChangedStatus& status) {
  if (status.alive_count_change == 0) return;
  const MutexLock lock(mutex_);
  news_.liveliness.push_back({status.last_publication_handle, status.alive_count_change > 0, false});
  pending_ = true;
  wake_.NotifyOne();
}

void ReaderEvents::on_requested_incompatible_qos(Reader*, const fd::RequestedIncompatibleQosStatus& status) {
  const MutexLock lock(mutex_);
  news_.incompatible_policy = PolicyName(status.last_policy_id);
  pending_ = true;
  wake_.NotifyOne();
}

void ReaderEvents::on_sample_rejected(Reader*, const fd::SampleRejectedStatus& status) {
  if (status.last_reason != fd::REJECTED_BY_INSTANCES_LIMIT) return;
  const MutexLock lock(mutex_);
  news_.full = true;
  pending_ = true;
  wake_.NotifyOne();
}

void ReaderEvents::on_sample_lost(Reader*, const fd::SampleLostStatus& status) {
  const MutexLock lock(mutex_);
  news_.lost_total = status.total_count;
  pending_ = true;
  wake_.NotifyOne();
}

}  // namespace cairn::wire
