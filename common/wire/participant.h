// The one file that makes DDS entities: the participant of a Bus, and the topics, writers and readers on it,
// with every transport and QoS choice of idl/README.md. Nothing of it is left to a default or to a profile
// file. Thread-safe. This header uses the Fast DDS 2.x API; include it only inside common/wire.
#pragma once

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "common/mutex.h"
#include "common/wire/bus.h"
#include "common/wire/guard_transport.h"
#include "common/wire/peer_watch.h"
#include "common/wire/topics.h"

namespace cairn::wire {

namespace fd = eprosima::fastdds::dds;  // `namespace dds` is taken by a Fast DDS header.

class Participant : public std::enable_shared_from_this<Participant> {
 public:
  struct WriterDeleter {
    std::shared_ptr<Participant> participant;
    void operator()(fd::DataWriter* writer) const;
  };
  struct ReaderDeleter {
    std::shared_ptr<Participant> participant;
    void operator()(fd::DataReader* reader) const;
  };
  using Writer = std::unique_ptr<fd::DataWriter, WriterDeleter>;
  using Reader = std::unique_ptr<fd::DataReader, ReaderDeleter>;

  [[nodiscard]] static Result<std::shared_ptr<Participant>> Create(const WireOptions& options, const std::string& name);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  // The listener is called from creation until the entity is deleted, and must outlive it. `partitions`: of a
  // topic of robots, the robot's name, which counts only with security; none: the default one. kPermissionDenied: the
  // permissions of this participant do not allow it.
  [[nodiscard]] Result<Writer> MakeWriter(const TopicProfile& profile, const fd::TypeSupport& type,
                                          fd::DataWriterListener* listener,
                                          const std::vector<std::string>& partitions = {});
  // `only`: of a topic of replies, what is in the partition of this client; of one of shares, of this robot.
  [[nodiscard]] Result<Reader> MakeReader(const TopicProfile& profile, const fd::TypeSupport& type,
                                          fd::DataReaderListener* listener, std::optional<std::uint64_t> only = {});

  [[nodiscard]] const WireOptions& options() const { return options_; }
  // Whether its topics of shares have a writer for each (partitions.h).
  [[nodiscard]] bool has_shares() const { return !secure() && options_.discovery_servers.empty(); }
  [[nodiscard]] const GuardReport& guard() const { return *guard_; }
  [[nodiscard]] PeerWatch& peers() const { return *peers_; }

 private:
  explicit Participant(const WireOptions& options)
      : options_(options), peers_(PeerWatch::Make(!options.security.empty())) {}
  [[nodiscard]] bool secure() const { return !options_.security.empty(); }
  [[nodiscard]] Status NotMade(const std::string& what) const;
  [[nodiscard]] fd::Publisher* PublisherFor(const std::vector<std::string>& partitions);
  [[nodiscard]] fd::Subscriber* SubscriberFor(const std::string& partition);
  [[nodiscard]] std::string PartitionToRead(Partitions partitions, std::optional<std::uint64_t> only) const;
  [[nodiscard]] Result<fd::Topic*> FindTopic(const TopicProfile& profile, const fd::TypeSupport& type);

  const WireOptions options_;
  const std::shared_ptr<GuardReport> guard_ = std::make_shared<GuardReport>();
  const std::shared_ptr<PeerWatch> peers_;        // The participant's listener.
  fd::DomainParticipant* participant_ = nullptr;  // Set once by Create.
  // Held while an endpoint is created or deleted: Fast DDS 2.9 can deadlock or crash where several threads do so at
  // once in one participant. Listeners must not create or delete endpoints.
  Mutex endpoints_;
  Mutex mutex_;
  std::map<std::vector<std::string>, fd::Publisher*> publishers_ CAIRN_GUARDED_BY(mutex_);  // By partitions.
  std::map<std::string, fd::Subscriber*> subscribers_ CAIRN_GUARDED_BY(mutex_);             // By partition.
  std::map<std::string, fd::Topic*> topics_ CAIRN_GUARDED_BY(mutex_);
};

}  // namespace cairn::wire
