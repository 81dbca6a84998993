// Collects the events that the middleware reports for one reader and hands it to the subscription's thread:
// the listener side never blocks, takes or calls back. Thread-safe; one waiting thread.
#pragma once

#include <atomic>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/mutex.h"
#include "common/wire/writer_clients.h"

namespace cairn::wire {

// The events since the last Wait. Data may be waiting whether or not there are events.
struct ReaderNews {
  std::optional<int> matched;
  std::optional<int> lost_total;
  std::optional<std::string> incompatible_policy;
  std::vector<LivelinessChange> liveliness;  // In order.
  bool full = false;                         // A sample was refused, because there are too many instances.
};

class ReaderEvents final : public eprosima::fastdds::dds::DataReaderListener {
 public:
  // Blocks until there are data or events. Returns nothing after Stop.
  [[nodiscard]] std::optional<ReaderNews> Wait();
  void Stop();
  [[nodiscard]] int matched() const { return matched_.load(); }

 private:
  using Reader = eprosima::fastdds::dds::DataReader;
  void on_data_available(Reader* reader) override;
  void on_subscription_matched(Reader* reader,
                               const eprosima::fastdds::dds::SubscriptionMatchedStatus& status) override;
  void on_liveliness_changed(Reader* reader, const eprosima::fastrtps::LivelinessChangedStatus& status) override;
  void on_requested_incompatible_qos(Reader* reader,
                                     const eprosima::fastdds::dds::RequestedIncompatibleQosStatus& status) override;
  void on_sample_rejected(Reader* reader, const eprosima::fastdds::dds::SampleRejectedStatus& status) override;
  void on_sample_lost(Reader* reader, const eprosima::fastdds::dds::SampleLostStatus& status) override;

  std::atomic<int> matched_ = 0;
  Mutex mutex_;
  CondVar wake_;
  bool pending_ CAIRN_GUARDED_BY(mutex_) = false;
  bool stopped_ CAIRN_GUARDED_BY(mutex_) = false;
  ReaderNews news_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::wire
