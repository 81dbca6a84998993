// Somebody who has the paths of a site smoothed and switches its map, at random moments and again and again, while its
// server is killed: what was answered must hold after each start. Orders and kills overlap, so many orders are never
// answered; those may be carried out or not.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "client/lib/query_client.h"
#include "common/wire/bus.h"

namespace cairn::test {

class KilledOrders {
 public:
  struct Outcome {
    int jobs = 0;      // Whose submission was answered.
    int ended = 0;     // Jobs that have succeeded or were given up. Those that have ended otherwise are in `broken`.
    int given_up = 0;  // Because eight servers have died while they ran.
    int switches = 0;  // Of the map to another version than was known to be enabled, whose order was answered.
    int checks = 0;    // How often everything was compared with what had been answered.
    std::vector<std::string> broken;
  };

  // Begins at once.
  KilledOrders(std::string site, std::uint64_t seed);
  ~KilledOrders();

  // Gives no more orders, waits until the jobs have ended, and checks once more. The server runs.
  [[nodiscard]] Outcome Finish();

 private:
  void Run(const std::stop_token& stop);
  void SubmitJob();
  void SwitchMap();
  // What a server said before it answered an order is on the disk as well, because the answer waits for that.
  void PromiseHeld(std::set<std::uint32_t>&& heard);
  // Compares what the server says with what it has promised. Returns false where it did not answer, or has no map yet.
  bool Check();
  bool CheckJobs();
  void Break(const std::string& what);

  const std::string site_;
  std::mt19937_64 random_;
  std::unique_ptr<wire::Bus> bus_;
  std::unique_ptr<client::QueryClient> queries_;
  Outcome outcome_;
  std::map<std::uint64_t, Job> jobs_;  // What was last heard of each. The oldest that have ended are forgotten.
  Generation generation_ = 0;          // Of the server that was heard last.
  std::set<std::uint32_t> heard_;  // Map versions of jobs that have succeeded: an answer to a question is no promise.
  std::set<std::uint32_t> versions_;  // Those that must be there after each start.
  std::set<std::uint32_t> may_be_enabled_{1};
  std::jthread thread_;  // The last member: it uses everything above.
};

}  // namespace cairn::test
