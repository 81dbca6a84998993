#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <map>

#include "common/wire/bus.h"
#include "tests/loopback.h"

namespace cairn::wire {
namespace {

using namespace test;

SessionRequest From(ClientId client) {
  SessionRequest request;
  request.robot = "robot-" + std::to_string(client);
  request.site = "hall";
  request.client = client;
  return request;
}

class Liveliness : public ::testing::Test {
 protected:
  SubscriptionEvents Events() {
    SubscriptionEvents events;
    events.liveliness = [this](ClientId client, NameId robot_id, bool alive) {
      if (robot_id == 0) return;
      const std::lock_guard lock(mutex_);
      alive_[client] = alive;
    };
    return events;
  }
  bool Said(ClientId client, bool alive) {
    return Eventually([&] {
      const std::lock_guard lock(mutex_);
      const auto known = alive_.find(client);
      return known != alive_.end() && known->second == alive;
    });
  }
  bool HeardOf(ClientId client) {
    const std::lock_guard lock(mutex_);
    return alive_.count(client) != 0;
  }

  std::mutex mutex_;
  std::map<ClientId, bool> alive_;
};

TEST_F(Liveliness, NamesTheClientThatWentAway) {
  const auto server = MakeBus("server");
  Inbox<SessionRequest> inbox;
  const auto subscription = Must(server->Subscribe<SessionRequest>(inbox.Sink(), Events()));
  const auto staying = MakeBus("staying");
  auto leaving = MakeBus("leaving");
  const auto stays = Must(staying->Advertise<SessionRequest>());
  auto leaves = Must(leaving->Advertise<SessionRequest>());
  ASSERT_TRUE(stays->Publish(From(1)));
  ASSERT_TRUE(leaves->Publish(From(2)));
  ASSERT_TRUE(inbox.WaitFor(2));
  leaves.reset();
  leaving.reset();
  EXPECT_TRUE(Said(2, false));
  EXPECT_FALSE(HeardOf(1));
}

// A client that has nothing to say keeps its lease. (The guard once took liveliness messages for broken ones.)
TEST_F(Liveliness, LeavesAQuietClientAlone) {
  WireOptions options = LoopbackOptions();
  options.liveliness_lease_s = 0.5;
  const auto server = MakeBus("server", options);
  const auto robot = MakeBus("robot", options);
  Inbox<SessionRequest> inbox;
  const auto subscription = Must(server->Subscribe<SessionRequest>(inbox.Sink(), Events()));
  const auto publication = Must(robot->Advertise<SessionRequest>());
  ASSERT_TRUE(publication->Publish(From(3)));
  ASSERT_TRUE(inbox.WaitFor(1));
  EXPECT_FALSE(Eventually([&] { return HeardOf(3); }, std::chrono::milliseconds(1500)));  // Three leases.
  EXPECT_EQ(server->datagrams_refused(), 0U);
}

// Another process, which this one may stop, wake and kill. Dies with this one at the latest.
class Child {
 public:
  Child(const WireOptions& options, ClientId client) {
    const std::string domain = std::to_string(options.domain);
    const std::string lease = std::to_string(options.participant_lease_s);
    const std::string id = std::to_string(client);
    pid_ = fork();
    if (pid_ != 0) return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    execl(CAIRN_SESSION_ROBOT, CAIRN_SESSION_ROBOT, domain.c_str(), lease.c_str(), id.c_str(), nullptr);
    _exit(127);
  }
  ~Child() {
    Signal(SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  void Signal(int signal) const { kill(pid_, signal); }

 private:
  pid_t pid_ = 0;
};

// kill -9 says no goodbye.
TEST_F(Liveliness, NoticesAKilledClientWithinItsLease) {
  const Child child(LoopbackOptions(), 7);
  const auto server = MakeBus("server");
  Inbox<SessionRequest> inbox;
  const auto subscription = Must(server->Subscribe<SessionRequest>(inbox.Sink(), Events()));
  ASSERT_TRUE(inbox.WaitFor(1));
  child.Signal(SIGKILL);
  EXPECT_TRUE(Said(7, false));
  EXPECT_EQ(inbox.values()[0].client, 7U);
}

// A frozen process that thaws before it is forgotten is the same client again.
TEST_F(Liveliness, TellsOfAClientThatComesBack) {
  WireOptions options = LoopbackOptions();
  options.participant_lease_s = 600.0;  // Only the writer's lease is to run out.
  const Child child(options, 9);
  const auto server = MakeBus("server", options);
  Inbox<SessionRequest> inbox;
  const auto subscription = Must(server->Subscribe<SessionRequest>(inbox.Sink(), Events()));
  ASSERT_TRUE(inbox.WaitFor(1));
  child.Signal(SIGSTOP);
  EXPECT_TRUE(Said(9, false));
  child.Signal(SIGCONT);
  EXPECT_TRUE(Said(9, true));
}

}  // namespace
}  // namespace cairn::wire
