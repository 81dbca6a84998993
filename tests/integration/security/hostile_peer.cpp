// A member of a fleet, or a stranger, that ignores every check of its own side: of its certificate, and of what its
// permissions allow it to write. Only what the other side enforces can stop it.
// Usage: hostile_peer DOMAIN DIRECTORY ask | command | pose ROBOT | tile SITE
//                                      | scan ROBOT PARTITION | odometry ROBOT PARTITION | end ROBOT PARTITION
// `end` asks the server to end the robot's session.
// It sends ten times a second until it is killed, and says when it has matched a reader.
#include <openssl/x509_vfy.h>

#include <chrono>
#include <iostream>
#include <thread>

#include "common/wire/bus.h"

// This executable exports its symbols, so the library's calls come here.
extern "C" {
int X509_verify_cert(X509_STORE_CTX*) {  // NOLINT(readability-identifier-naming): OpenSSL's name.
  return 1;
}
// Fast DDS 2.9: Permissions::check_create_datawriter.
bool AllowEveryWriter() __asm__(
    "_ZN8eprosima8fastrtps4rtps8security11Permissions23check_create_datawriterERKNS2_6HandleEjRKNSt7__cxx1112basic_"
    "stringIcSt11char_traitsIcESaIcEEERKSt6vectorISC_SaISC_EERNS2_17SecurityExceptionE");
__attribute__((used)) bool AllowEveryWriter() {
  return true;
}
}

namespace {

using namespace cairn;

template <typename Value>
int Send(wire::Bus& bus, const std::string& robot, Value value) {
  auto publication = bus.Advertise<Value>(robot);
  if (!publication) {
    std::cout << "cannot write: " << publication.error().message << std::endl;
    return 1;
  }
  std::cout << "writing" << std::endl;
  bool matched = false;
  for (;;) {
    if (!matched && (*publication)->matched() > 0) {
      matched = true;
      std::cout << "matched" << std::endl;
    }
    if constexpr (std::is_same_v<Value, ScanSample>) ++value.scan.sequence;
    if constexpr (std::is_same_v<Value, OdometrySample>) ++value.odometry.sequence;
    static_cast<void>((*publication)->Publish(value));
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

Request RequestOf(RequestKind kind) {
  Request request;
  request.client = 66;
  request.sequence = 1;
  request.kind = kind;
  request.site = "hall";
  return request;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() < 3) return 2;
  wire::WireOptions options;
  options.domain = std::stoi(arguments[0]);
  options.security = arguments[1];
  const auto bus = wire::Bus::Create(options, "hostile peer");
  if (!bus) {
    std::cout << "cannot join: " << bus.error().message << std::endl;
    return 1;
  }
  if (arguments[2] == "ask") return Send(**bus, "", RequestOf(RequestKind::kPing));
  if (arguments[2] == "command") return Send(**bus, "", Command{RequestOf(RequestKind::kJobSubmit)});
  const std::string& name = arguments.at(3);
  if (arguments[2] == "pose") {
    PoseReport pose;
    pose.robot = name;
    pose.robot_id = HashName(name);
    pose.localized = true;
    return Send(**bus, "", pose);
  }
  if (arguments[2] == "tile") {
    TileSample tile;
    tile.site_id = HashName(name);
    tile.tile.version = 1;
    return Send(**bus, "", tile);
  }
  const std::string& partition = arguments.at(4);
  if (arguments[2] == "end") {
    SessionRequest request;
    request.robot = name;
    request.site = "hall";
    request.end = true;
    request.client = request.session = 66;
    return Send(**bus, partition, request);
  }
  const StreamId stream = {.robot_id = HashName(name), .sensor_id = HashName("laser"), .session = 5};
  if (arguments[2] == "odometry") return Send(**bus, partition, OdometrySample{.stream = stream, .odometry = {}});
  ScanSample sample;
  sample.stream = stream;
  sample.scan.ranges_m.assign(10, 1.0F);
  return Send(**bus, partition, sample);
}
