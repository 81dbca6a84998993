// The service manager is a datagram socket that the test opens.
#include "server/ops/service_notifier.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <string>

namespace cairn::server {
namespace {

class ServiceNotifierTest : public ::testing::Test {
 protected:
  void SetUp() override {
    // An abstract address: no file, and the process id makes it this test's own.
    address_.sun_family = AF_UNIX;
    const std::string name = "cairn-notify-" + std::to_string(getpid());
    name.copy(address_.sun_path + 1, sizeof(address_.sun_path) - 2);
    socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
    ASSERT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address_), length), 0);
    setenv("NOTIFY_SOCKET", ("@" + name).c_str(), 1);
  }
  void TearDown() override {
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    close(socket_);
  }
  std::string Receive() const {
    std::array<char, 256> text{};
    const ssize_t length = recv(socket_, text.data(), text.size(), MSG_DONTWAIT);  // What was sent is there at once.
    return {text.data(), static_cast<std::size_t>(std::max<ssize_t>(0, length))};
  }

  sockaddr_un address_{};
  int socket_ = -1;
  ServiceNotifier notifier_;
};

TEST_F(ServiceNotifierTest, SaysThatALongStartGoesOn) {
  notifier_.Starting("restoring", std::chrono::seconds(60));
  EXPECT_EQ(Receive(), "EXTEND_TIMEOUT_USEC=60000000\nSTATUS=restoring");
}

TEST_F(ServiceNotifierTest, SaysReadyAliveAndStopping) {
  notifier_.Ready("serving");
  EXPECT_EQ(Receive(), "READY=1\nSTATUS=serving");
  notifier_.Alive();
  EXPECT_EQ(Receive(), "WATCHDOG=1");
  notifier_.Stopping();
  EXPECT_EQ(Receive(), "STOPPING=1");
}

// The status once said `degraded` for ever after one failure of the disk.
TEST_F(ServiceNotifierTest, TheStatusIsDegradedOnlyWhileTheStoreFails) {
  ServiceStatus status(notifier_, "serving");
  status.Degraded("disk full");
  EXPECT_EQ(Receive(), "STATUS=degraded, what arrives now is not durable: disk full");
  status.Degraded("");
  EXPECT_EQ(Receive(), "STATUS=serving");
}

TEST_F(ServiceNotifierTest, TheStatusIsSentWhenItChangesAndTheStoreComesBeforeLosses) {
  ServiceStatus status(notifier_, "serving");
  status.Degraded("");
  status.Losses("1 malformed");
  EXPECT_EQ(Receive(), "STATUS=messages lost between DDS and the server: 1 malformed");
  status.Degraded("disk full");
  EXPECT_EQ(Receive(), "STATUS=degraded, what arrives now is not durable: disk full");
  status.Degraded("disk full");
  status.Losses("2 malformed");
  status.Degraded("");
  EXPECT_EQ(Receive(), "STATUS=messages lost between DDS and the server: 2 malformed");
}

TEST_F(ServiceNotifierTest, KnowsWhetherAWatchdogIsSet) {
  EXPECT_FALSE(notifier_.watchdog());
  setenv("WATCHDOG_USEC", "3000000", 1);
  ASSERT_TRUE(notifier_.watchdog());
  EXPECT_EQ(*notifier_.watchdog(), std::chrono::seconds(3));
}

}  // namespace
}  // namespace cairn::server
