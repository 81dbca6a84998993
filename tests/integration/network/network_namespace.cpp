#include "tests/integration/network/network_namespace.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <thread>

namespace cairn::test {
namespace {

constexpr char kDevice[] = "tap0";

ifreq Named(const char* device) {
  ifreq request{};
  std::strncpy(request.ifr_name, device, IFNAMSIZ - 1);
  return request;
}

ifreq WithAddress(const char* device, const std::string& address) {
  ifreq request = Named(device);
  sockaddr_in ipv4{};
  ipv4.sin_family = AF_INET;
  inet_pton(AF_INET, address.c_str(), &ipv4.sin_addr);
  std::memcpy(&request.ifr_addr, &ipv4, sizeof(ipv4));
  return request;
}

bool Raise(int socket, const char* device) {
  ifreq request = Named(device);
  if (ioctl(socket, SIOCGIFFLAGS, &request) != 0) return false;
  request.ifr_flags = static_cast<short>(request.ifr_flags | IFF_UP | IFF_RUNNING);
  return ioctl(socket, SIOCSIFFLAGS, &request) == 0;
}

// Makes loopback and the device of the calling thread's namespace work. What failed; null where nothing did.
const char* Configure(int frames, const std::string& address) {
  ifreq tap = Named(kDevice);
  tap.ifr_flags = IFF_TAP | IFF_NO_PI;
  if (ioctl(frames, TUNSETIFF, &tap) != 0) return "make a TAP device";
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  ifreq own = WithAddress(kDevice, address), mask = WithAddress(kDevice, "255.255.255.0");
  const bool works = socket >= 0 && ioctl(socket, SIOCSIFADDR, &own) == 0 &&
                     ioctl(socket, SIOCSIFNETMASK, &mask) == 0 && Raise(socket, "lo") && Raise(socket, kDevice);
  const int error = errno;
  close(socket);
  errno = error;
  return works ? nullptr : "give a TAP device an address";
}

}  // namespace

Result<NetworkNamespace> NetworkNamespace::Create(const std::string& address) {
  NetworkNamespace made;
  const char* failed = nullptr;
  int error = 0;
  // Only this thread moves into the new namespace.
  std::thread([&] {
    if (unshare(CLONE_NEWNET) != 0) {
      failed = "make a network namespace";
    } else if ((made.namespace_ = open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC)) < 0) {
      failed = "open a network namespace";
    } else if ((made.frames_ = open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC)) < 0) {
      failed = "open /dev/net/tun";
    } else {
      failed = Configure(made.frames_, address);
    }
    error = errno;
  }).join();
  if (failed == nullptr) return made;
  return Fail(StatusCode::kPermissionDenied, std::string("cannot ") + failed + ": " + std::strerror(error));
}

NetworkNamespace::~NetworkNamespace() {
  if (frames_ >= 0) close(frames_);
  if (namespace_ >= 0) close(namespace_);
}

void NetworkNamespace::Enter() const {
  if (setns(namespace_, CLONE_NEWNET) != 0) throw std::runtime_error("cannot enter a network namespace");
}

}  // namespace cairn::test
