// The client that each remote writer of session requests belongs to, and the robots that it speaks for: the client that
// its last request named, and the robots that it has named with it. With DDS Security the robot of a request is checked
// and its client is not: who names the client of another robot must not keep that one alive. A client may have several
// writers for a while, because it joins the domain anew where its streams stand still: it is alive while one of them
// is. Not thread-safe: one owner.
#pragma once

#include <algorithm>
#include <fastdds/dds/common/InstanceHandle.hpp>
#include <map>
#include <set>
#include <utility>
#include <vector>

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
  struct Speaker {
    ClientId client = 0;
    NameId robot_id = 0;
    friend bool operator==(const Speaker&, const Speaker&) = default;
  };

  // Records a request of the writer. Returns whether the lease of one of the client's writers is valid.
  bool Seen(const Writer& writer, const Speaker& speaker) {
    Entry& entry = entries_[writer];
    if (entry.client != speaker.client || entry.robots.size() >= kMostRobots) entry.robots.clear();
    entry.client = speaker.client;
    entry.robots.insert(speaker.robot_id);
    return Alive(speaker);
  }

  // Returns those that are alive or not from now on, where that changed and the writer's client is known.
  std::vector<Speaker> Changed(const LivelinessChange& change) {
    const auto known = entries_.find(change.writer);
    if (known == entries_.end()) {
      if (!change.gone) entries_[change.writer].alive = change.alive;
      return {};
    }
    std::vector<std::pair<Speaker, bool>> before;
    for (const NameId robot_id : known->second.robots) {
      const Speaker speaker{known->second.client, robot_id};
      before.emplace_back(speaker, Alive(speaker));
    }
    known->second.alive = change.alive;
    if (change.gone) entries_.erase(known);
    std::vector<Speaker> changed;
    for (const auto& [speaker, was_alive] : before) {
      if (Alive(speaker) != was_alive) changed.push_back(speaker);
    }
    return changed;
  }

 private:
  static constexpr std::size_t kMostRobots = 256;  // Of one writer, which could name any number of them.
  struct Entry {
    ClientId client = 0;
    std::set<NameId> robots;  // Empty until its first request.
    bool alive = true;
  };
  [[nodiscard]] bool Alive(const Speaker& speaker) const {
    return std::any_of(entries_.begin(), entries_.end(), [&speaker](const auto& one) {
      const Entry& entry = one.second;
      return entry.alive && entry.client == speaker.client && entry.robots.contains(speaker.robot_id);
    });
  }

  std::map<Writer, Entry> entries_;
};

}  // namespace cairn::wire
