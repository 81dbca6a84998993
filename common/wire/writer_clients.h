// The client that each remote writer of session requests belongs to: the one that its last request named. A client may
// have several writers for a while, because it joins the domain anew where its streams stand still: it is alive while
// one of them is. Not thread-safe: one owner.
#pragma once

#include <algorithm>
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

  // Records a request of the writer. Returns whether the lease of one of the client's writers is valid.
  bool Seen(const Writer& writer, ClientId client) {
    entries_[writer].client = client;
    return Alive(client);
  }

  // Returns the client that is alive or not from now on, if that changed and the writer's client is known.
  std::optional<ClientId> Changed(const LivelinessChange& change) {
    const auto known = entries_.find(change.writer);
    if (known == entries_.end()) {
      if (!change.gone) entries_[change.writer].alive = change.alive;
      return std::nullopt;
    }
    const std::optional<ClientId> client = known->second.client;
    const bool before = client && Alive(*client);
    known->second.alive = change.alive;
    if (change.gone) entries_.erase(known);
    if (!client || Alive(*client) == before) return std::nullopt;
    return client;
  }

 private:
  struct Entry {
    std::optional<ClientId> client;
    bool alive = true;
  };
  [[nodiscard]] bool Alive(ClientId client) const {
    return std::any_of(entries_.begin(), entries_.end(),
                       [client](const auto& entry) { return entry.second.client == client && entry.second.alive; });
  }

  std::map<Writer, Entry> entries_;
};

}  // namespace cairn::wire
