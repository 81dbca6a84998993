#include "common/wire/ros2/participant.h"

#include <fastdds/dds/domain/DomainParticipantFactory.hpp>

#include "common/wire/participant_qos.h"

namespace cairn::ros2 {

using eprosima::fastrtps::types::ReturnCode_t;

Participant::~Participant() {
  if (participant_ == nullptr) return;
  participant_->delete_contained_entities();
  fd::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

Result<std::shared_ptr<Participant>> Participant::Create(const WireOptions& options, const std::string& name) {
  if (const auto valid = Validate(options); !valid) return tl::unexpected(valid.error());
  if (const auto present = RequireInterfaces(options); !present) return tl::unexpected(present.error());
  wire::ConfigureLibraryOnce();
  auto made = std::make_shared<Participant>();
  fd::DomainParticipantQos qos = wire::ParticipantQos(options, name, made->guard_);
  // A discovery server tells a mere client only of topics that it has itself; the door looks for those of others.
  if (!options.discovery_servers.empty())
    qos.wire_protocol().builtin.discovery_config.discoveryProtocol = rtps::DiscoveryProtocol_t::SUPER_CLIENT;
  SetUserData(qos.user_data(), "enclave=/;");
  made->participant_ = fd::DomainParticipantFactory::get_instance()->create_participant(
      static_cast<fd::DomainId_t>(options.domain), qos, &made->writers_, fd::StatusMask::none());
  if (made->participant_ == nullptr) {
    return Fail(StatusCode::kUnavailable, "cannot join the DDS domain " + std::to_string(options.domain) +
                                              " of the ROS 2 robots: no free port or address, or it is full");
  }
  made->publisher_ = made->participant_->create_publisher(fd::PUBLISHER_QOS_DEFAULT);
  made->subscriber_ = made->participant_->create_subscriber(fd::SUBSCRIBER_QOS_DEFAULT);
  if (made->publisher_ == nullptr || made->subscriber_ == nullptr) return tl::unexpected(Broken("a participant"));
  return made;
}

TopicUse::~TopicUse() {
  if (participant_ != nullptr) participant_->EndUse(topic_);
}

Result<TopicUse> Participant::TopicFor(const std::string& name, const fd::TypeSupport& type) {
  const MutexLock lock(mutex_);
  if (const auto known = topics_.find(name); known != topics_.end()) {
    if (known->second.topic->get_type_name() != type.get_type_name())
      return Fail(StatusCode::kFailedPrecondition, name + " is in use with another type");
    ++known->second.uses;
    return TopicUse(*this, known->second.topic);
  }
  if (participant_->find_type(type.get_type_name()).empty() &&
      type.register_type(participant_) != ReturnCode_t::RETCODE_OK) {
    return tl::unexpected(Broken("type " + type.get_type_name()));
  }
  UsedTopic& used = topics_[name];
  used.topic = participant_->create_topic(name, type.get_type_name(), fd::TOPIC_QOS_DEFAULT);
  if (used.topic == nullptr) {
    topics_.erase(name);
    return tl::unexpected(Broken("topic " + name));
  }
  used.uses = 1;
  return TopicUse(*this, used.topic);
}

void Participant::EndUse(fd::Topic* topic) {
  const MutexLock lock(mutex_);
  const auto used = topics_.find(topic->get_name());
  if (used == topics_.end() || --used->second.uses > 0) return;
  topics_.erase(used);
  participant_->delete_topic(topic);
}

}  // namespace cairn::ros2
