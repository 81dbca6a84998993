// A process to be frozen or killed by liveliness_test: publishes one session request and falls silent.
//   session_robot DOMAIN PARTICIPANT_LEASE_S CLIENT
#include <unistd.h>

#include <cstdlib>

#include "common/wire/bus.h"

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  cairn::wire::WireOptions options;
  options.domain = std::atoi(argv[1]);
  options.participant_lease_s = std::atof(argv[2]);
  const auto bus = cairn::wire::Bus::Create(options, "session robot");
  if (!bus) return 1;
  const auto publication = (*bus)->Advertise<cairn::SessionRequest>();
  if (!publication) return 1;
  cairn::SessionRequest request;
  request.robot = "silent";
  request.site = "hall";
  request.client = std::strtoull(argv[3], nullptr, 10);
  if (!(*publication)->Publish(request)) return 1;
  for (;;) pause();
}
