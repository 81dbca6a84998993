#include "common/wire/participant.h"

#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <sstream>

#include "common/wire/participant_qos.h"
#include "common/wire/security.h"

namespace cairn::wire {
namespace {

namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::types::ReturnCode_t;

// The QoS that both ends of a topic share. Every limit is set, because the default allows only 10 instances
// and refuses the next without an error.
template <typename Qos>
void SetCommon(const TopicProfile& profile, int depth, int instances, const WireOptions& options, Qos& qos) {
  qos.reliability().kind = fd::RELIABLE_RELIABILITY_QOS;
  qos.reliability().max_blocking_time = Duration_t(0.1);
  qos.durability().kind = profile.transient_local ? fd::TRANSIENT_LOCAL_DURABILITY_QOS : fd::VOLATILE_DURABILITY_QOS;
  qos.history().kind = fd::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  qos.resource_limits().max_instances = instances;
  qos.resource_limits().max_samples_per_instance = depth;
  qos.resource_limits().max_samples = instances * depth;
  qos.resource_limits().allocated_samples = 1;
  qos.data_sharing().off();
  // The sizes of samples differ much. Other memory policies would reserve the largest size for every slot
  // (measured: 7 times as much memory).
  qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
  if (profile.leased) {
    qos.liveliness().kind = fd::AUTOMATIC_LIVELINESS_QOS;
    qos.liveliness().lease_duration = Duration_t(options.liveliness_lease_s);
    qos.liveliness().announcement_period = Duration_t(options.liveliness_lease_s / 3.0);
  }
}

Status Broken(const std::string& what) {
  return {StatusCode::kInternal, "Fast DDS refused to make " + what};
}

}  // namespace

Result<std::shared_ptr<Participant>> Participant::Create(const WireOptions& options, const std::string& name) {
  if (const Result<void> valid = Validate(options); !valid) return tl::unexpected(valid.error());
  if (const Result<void> present = RequireInterfaces(options); !present) return tl::unexpected(present.error());
  if (!options.security.empty()) {
    if (const Result<void> usable = CheckSecurityFiles(options.security); !usable)
      return tl::unexpected(usable.error());
  }
  ConfigureLibraryOnce();
  const std::shared_ptr<Participant> made(new Participant(options));
  made->participant_ = fd::DomainParticipantFactory::get_instance()->create_participant(
      static_cast<fd::DomainId_t>(options.domain), ParticipantQos(options, name, made->guard_), made->peers_.get(),
      fd::StatusMask::none());
  if (made->participant_ == nullptr) {
    return Fail(StatusCode::kUnavailable, "cannot join DDS domain " + std::to_string(options.domain) +
                                              ": no free port or address, or the domain is full" +
                                              (made->secure() ? ", or Fast DDS refused wire.security" : ""));
  }
  return made;
}

Participant::~Participant() {
  if (participant_ == nullptr) return;
  participant_->delete_contained_entities();
  fd::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

// Fast DDS gives no reason. With security there is one that is likely.
Status Participant::NotMade(const std::string& what) const {
  if (!secure()) return Broken(what);
  return {StatusCode::kPermissionDenied, "the permissions in " + options_.security + " do not allow " + what};
}

fd::Publisher* Participant::PublisherFor(const std::vector<std::string>& partitions) {
  const MutexLock lock(mutex_);
  fd::Publisher*& publisher = publishers_[partitions];
  if (publisher == nullptr) {
    fd::PublisherQos qos;
    for (const std::string& partition : partitions) qos.partition().push_back(partition.c_str());
    publisher = participant_->create_publisher(qos);
  }
  return publisher;
}

fd::Subscriber* Participant::SubscriberFor(const std::string& partition) {
  const MutexLock lock(mutex_);
  fd::Subscriber*& subscriber = subscribers_[partition];
  if (subscriber == nullptr) {
    fd::SubscriberQos qos;
    if (!partition.empty()) qos.partition().push_back(partition.c_str());
    subscriber = participant_->create_subscriber(qos);
  }
  return subscriber;
}

std::string Participant::PartitionToRead(Partitions partitions, std::optional<std::uint64_t> only) const {
  switch (partitions) {
    case Partitions::kDefault:
      return {};
    case Partitions::kRobots:
      return secure() ? kEveryPartition : "";
    case Partitions::kReplies:
      return only ? ReplyPartition(ReplyPartitionOf(*only)) : kEveryPartition;
    case Partitions::kShares:
      return only && has_shares() ? SharePartition(ShareOf(*only)) : "";
  }
  return {};
}

Result<fd::Topic*> Participant::FindTopic(const TopicProfile& profile, const fd::TypeSupport& type) {
  const MutexLock lock(mutex_);
  if (const auto known = topics_.find(profile.name); known != topics_.end()) return known->second;
  // Two topics may have one type.
  if (participant_->find_type(type.get_type_name()).empty() &&
      type.register_type(participant_) != ReturnCode_t::RETCODE_OK) {
    return tl::unexpected(Broken(std::string("type ") + type.get_type_name()));
  }
  fd::Topic* topic = participant_->create_topic(profile.name, type.get_type_name(), fd::TOPIC_QOS_DEFAULT);
  if (topic == nullptr) return tl::unexpected(Broken(std::string("topic ") + profile.name));
  topics_.emplace(profile.name, topic);
  return topic;
}

Result<Participant::Writer> Participant::MakeWriter(const TopicProfile& profile, const fd::TypeSupport& type,
                                                    fd::DataWriterListener* listener,
                                                    const std::vector<std::string>& partitions) {
  const Result<fd::Topic*> topic = FindTopic(profile, type);
  if (!topic) return tl::unexpected(topic.error());
  fd::DataWriterQos qos;
  SetCommon(profile, profile.writer_depth, profile.max_instances, options_, qos);
  qos.publish_mode().kind = fd::SYNCHRONOUS_PUBLISH_MODE;
  auto& times = qos.reliable_writer_qos().times;
  times.initialHeartbeatDelay = Duration_t(0.01);
  times.heartbeatPeriod = Duration_t(profile.heartbeat_ms * 1e-3);
  times.nackResponseDelay = Duration_t(0.002);
  if (profile.deadline_s > 0) qos.deadline().period = Duration_t(profile.deadline_s);
  // Otherwise it is made of the participant's number (library_repairs.cpp).
  std::ostringstream persistence;
  persistence << rtps::GUID_t(UnpredictablePrefix(), rtps::c_EntityId_RTPSParticipant);
  qos.properties().properties().emplace_back("dds.persistence.guid", persistence.str());
  // No filters of readers: Fast DDS 2.9 changes a writer's list of them while the writer uses it.
  qos.writer_resource_limits().reader_filters_allocation.maximum = 0;
  const bool in_default = profile.partitions == Partitions::kRobots && !secure();
  fd::Publisher* publisher = PublisherFor(in_default ? std::vector<std::string>() : partitions);
  if (publisher == nullptr) return tl::unexpected(Broken("a publisher"));
  const MutexLock lock(endpoints_);
  fd::DataWriter* writer = publisher->create_datawriter(*topic, qos, listener);
  if (writer == nullptr) {
    return tl::unexpected(NotMade(std::string("a writer of ") + profile.name +
                                  (partitions.empty() ? "" : " for '" + partitions.back() + "'")));
  }
  return Writer(writer, WriterDeleter{shared_from_this()});
}

Result<Participant::Reader> Participant::MakeReader(const TopicProfile& profile, const fd::TypeSupport& type,
                                                    fd::DataReaderListener* listener,
                                                    std::optional<std::uint64_t> only) {
  const Result<fd::Topic*> topic = FindTopic(profile, type);
  if (!topic) return tl::unexpected(topic.error());
  fd::DataReaderQos qos;
  // For a moment the reader has the keys of two writers: one that is full, and the one that replaces it
  // (publication.h). A sample that finds no place among the instances is lost, also on a reliable topic.
  const int instances = profile.max_instances == 1 ? 1 : 2 * profile.max_instances;
  SetCommon(profile, profile.reader_depth, instances, options_, qos);
  qos.reliable_reader_qos().times.heartbeatResponseDelay = Duration_t(0.001);
  fd::Subscriber* subscriber = SubscriberFor(PartitionToRead(profile.partitions, only));
  if (subscriber == nullptr) return tl::unexpected(Broken("a subscriber"));
  const MutexLock lock(endpoints_);
  fd::DataReader* reader = subscriber->create_datareader(*topic, qos, listener);
  if (reader == nullptr) return tl::unexpected(NotMade(std::string("a reader of ") + profile.name));
  return Reader(reader, ReaderDeleter{shared_from_this()});
}

void Participant::WriterDeleter::operator()(fd::DataWriter* writer) const {
  const MutexLock lock(participant->endpoints_);
  const_cast<fd::Publisher*>(writer->get_publisher())->delete_datawriter(writer);
}

void Participant::ReaderDeleter::operator()(fd::DataReader* reader) const {
  const MutexLock lock(participant->endpoints_);
  const_cast<fd::Subscriber*>(reader->get_subscriber())->delete_datareader(reader);
}

}  // namespace cairn::wire
