// The client that each remote writer of session requests belongs to: the one that its last request named. Not
// thread-safe: one owner.
#pragma once

#include <fastdds/dds/common/InstanceHandle.hpp>
#include <map>
#include <optional>

#include "common/service/session.h"

namespace cairn::wire {

struct LivelinessChange {
  eprosima::fastdds::dds::InstanceHandle_t writer;
  bool alive = false;
  bool gone = false;  // The writer is no longer matched; it will not return under this handle.
};

class WriterClients {
 public:
  using Writer = eprosima::fastdds::dds::InstanceHandle_t;

  // Records a request of the writer. Returns whether the writer's lease is valid.
  bool Heard(const Writer& writer, ClientId client) {
    Entry& entry = entries_[writer];
    entry.client = client;
    return entry.alive;
  }

  // Returns the client whose state has changed, if the writer's client is known.
  std::optional<ClientId> Changed(const LivelinessChange& change) {
    const auto known = entries_.find(change.writer);
    if (known == entries_.end()) {
      if (!change.gone) entries_[change.writer].alive = change.alive;
      return std::nullopt;
    }
    const bool changed = known->second.alive != change.alive;
    const std::optional<ClientId> client = changed ? known->second.client : std::nullopt;
    known->second.alive = change.alive;
    if (change.gone) entries_.erase(known);
    return client;
  }

 private:
  struct Entry {
    std::optional<ClientId> client;
    bool alive = true;
  };
  std::map<Writer, Entry> entries_;
};

}  // namespace cairn::wire
