// A thread of the server that stands still, or in which something throws: the watchdog is no longer notified and the
// log names the thread; after an exception the thread goes on.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ringbuffer_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <stdexcept>
#include <string>
#include <variant>

#include "common/mutex.h"
#include "tests/server/support/whole_server.h"

namespace cairn::server::testing {
namespace {

constexpr ClientId kStranger = 9;

// The lines of the process's log while it lives.
class KeptLog {
 public:
  KeptLog() { spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", kept_)); }
  ~KeptLog() { spdlog::set_default_logger(before_); }
  KeptLog(const KeptLog&) = delete;
  KeptLog& operator=(const KeptLog&) = delete;

  [[nodiscard]] bool Has(const std::string& text) const {
    const auto lines = kept_->last_formatted();
    return std::any_of(lines.begin(), lines.end(),
                       [&text](const std::string& line) { return line.find(text) != std::string::npos; });
  }

 private:
  const std::shared_ptr<spdlog::sinks::ringbuffer_sink_mt> kept_ =
      std::make_shared<spdlog::sinks::ringbuffer_sink_mt>(256);
  const std::shared_ptr<spdlog::logger> before_ = spdlog::default_logger();
};

// Holds the threads that come to it until it is opened.
class Gate {
 public:
  ~Gate() { Open(); }
  void Wait() {
    const MutexLock lock(mutex_);
    while (!open_) opened_.Wait(mutex_);
  }
  void Open() {
    const MutexLock lock(mutex_);
    open_ = true;
    opened_.NotifyAll();
  }

 private:
  Mutex mutex_;
  CondVar opened_;
  bool open_ CAIRN_GUARDED_BY(mutex_) = false;
};

Request Ping(std::int64_t sequence) {
  Request ping;
  ping.kind = RequestKind::kPing;
  ping.client = kStranger;
  ping.sequence = sequence;
  return ping;
}

// A server whose answers wait at a gate: those that say RESOURCE_EXHAUSTED, which the dispatcher sends, at one, and
// those of the desk at the other.
class StallingServer {
 public:
  StallingServer()
      : house_(Options(), nullptr, WholeServer::kGeneration, {}, [this](const OutboundValue& value) {
          const auto* const reply = std::get_if<Reply>(&value);
          if (reply == nullptr) return;
          const bool busy = reply->status.code == StatusCode::kResourceExhausted;
          ++(busy ? dispatcher_waits_ : desk_waits_);
          (busy ? dispatcher_ : desk_).Wait();
        }) {}
  // The threads of the server end before the gates do.
  ~StallingServer() {
    desk_.Open();
    dispatcher_.Open();
  }
  StallingServer(const StallingServer&) = delete;
  StallingServer& operator=(const StallingServer&) = delete;

  void OpenDesk() { desk_.Open(); }
  void OpenDispatcher() { dispatcher_.Open(); }
  [[nodiscard]] bool DeskWaits() const {
    return house_.WaitFor([&] { return desk_waits_ > 0; });
  }
  [[nodiscard]] bool DispatcherWaits() const {
    return house_.WaitFor([&] { return dispatcher_waits_ > 0; });
  }
  [[nodiscard]] bool BecomesHealthy(bool wanted) {
    return house_.WaitFor([&] { return house_.server().healthy() == wanted; });
  }
  WholeServer* operator->() { return &house_; }

 private:
  static ServerOptions Options() {
    ServerOptions options = TestOptions();
    options.server.stall_limit_s = 0.5;
    options.server.query_queue = 1;
    return options;
  }
  std::atomic<int> desk_waits_ = 0, dispatcher_waits_ = 0;
  Gate desk_, dispatcher_;
  WholeServer house_;
};

TEST(Stalled, ADeskThatStandsStillIsNoticedAndNamed) {
  const KeptLog log;
  StallingServer server;
  ASSERT_TRUE(server.BecomesHealthy(true));
  server->Push(Ping(1));
  ASSERT_TRUE(server.DeskWaits());
  server->Push(Ping(2));
  EXPECT_TRUE(server.BecomesHealthy(false));
  EXPECT_TRUE(server->WaitFor([&] { return log.Has("desk makes no progress"); }));
  server.OpenDesk();
  EXPECT_TRUE(server.BecomesHealthy(true));
}

// The dispatcher is the thread that hands out what arrives. It answers what finds no room in the desk's queue.
TEST(Stalled, ADispatcherThatStandsStillIsNoticedAndNamed) {
  const KeptLog log;
  StallingServer server;
  server->Push(Ping(1));
  ASSERT_TRUE(server.DeskWaits());
  server->Push(Ping(2));
  server->Push(Ping(3));
  ASSERT_TRUE(server.DispatcherWaits());
  server.OpenDesk();
  ASSERT_TRUE(server.BecomesHealthy(true));
  server->Push(Ping(4));
  EXPECT_TRUE(server->WaitFor([&] { return log.Has("dispatcher makes no progress"); }));
  EXPECT_FALSE(server->server().healthy());
  server.OpenDispatcher();
  EXPECT_TRUE(server.BecomesHealthy(true));
}

TEST(Stalled, AnExceptionInTheDispatcherCostsOneValue) {
  const KeptLog log;
  std::atomic<int> thrown = 0;
  WholeServer house(TestOptions(), nullptr, WholeServer::kGeneration, {}, [&thrown](const OutboundValue& value) {
    if (std::holds_alternative<SessionRefusal>(value) && thrown++ == 0) throw std::runtime_error("no room");
  });
  house.End("nobody", kStranger);
  house.End("nobody else", kStranger);
  EXPECT_TRUE(house.WaitPhase("nobody else", kStranger, SessionPhase::kRefused));
  EXPECT_GE(thrown, 2);
  EXPECT_TRUE(log.Has("a value that was received failed with an exception and was dropped: no room"));
}

TEST(Stalled, AnExceptionWhileAnAnswerIsSentCostsThisAnswer) {
  const KeptLog log;
  std::atomic<int> thrown = 0;
  WholeServer house(TestOptions(), nullptr, WholeServer::kGeneration, {}, [&thrown](const OutboundValue& value) {
    const auto* const reply = std::get_if<Reply>(&value);
    if (reply != nullptr && thrown++ == 0) throw std::runtime_error("no room");
  });
  house.Push(Ping(100));
  EXPECT_TRUE(house.WaitFor([&thrown] { return thrown > 0; }));
  Request ping;
  ping.kind = RequestKind::kPing;
  EXPECT_TRUE(house.Ask(ping).status.ok());
  EXPECT_TRUE(log.Has("a request of kind ping failed with an exception: no room"));
}

}  // namespace
}  // namespace cairn::server::testing
