// Samples of every topic: the number of the topic, then the serialised sample. What a reader accepts is a value that
// can be sent again and arrives as the same value; scans and odometry go through the door of the server.
#include <array>
#include <cstdint>
#include <limits>

#include "server/ingress/admission.h"
#include "tests/common/wire/sample_values.h"
#include "tests/fuzz/wire_bytes.h"

namespace cairn::fuzz {
namespace {

bool IsNumber(std::uint64_t sequence) {
  return sequence > 0 && sequence <= server::kMaxSequence;
}

void UseSample(const ScanSample& sample) {
  const server::ScanArrival arrival = server::Admit(ScanSample(sample), {});
  Must(arrival.refused.has_value() == (!IsNumber(sample.scan.sequence) || !ValidateScan(sample.scan)),
       "only valid scans are admitted");
  Must(arrival.scan != nullptr && arrival.scan->sequence == sample.scan.sequence, "a refused scan can be counted");
}
void UseSample(const OdometrySample& sample) {
  const server::OdometryArrival arrival = server::Admit(OdometrySample(sample));
  Must(arrival.refused == (!IsNumber(sample.odometry.sequence) || !ValidateOdometry(sample.odometry)),
       "only valid odometry is admitted");
}
void UseSample(const TileSample& sample) {
  Must(wire::FitsTileKey(sample.tile.key), "a tile that came can be sent");
}
template <typename Value>
void UseSample(const Value& /*value*/) {}

template <typename Value>
bool RunValue(std::string_view bytes) {
  const std::optional<Value> value = Received<Value>(bytes);
  if (!value) return false;
  UseSample(*value);
  const std::optional<Value> again = Received<Value>(Serialized(*value));
  Must(again.has_value(), "what was accepted is accepted again");
  Must(wire::Same(*again, *value), "a value that is sent again arrives as the same value");
  return true;
}

constexpr std::array kRunSample = {
    &RunValue<SessionRequest>, &RunValue<SessionState>, &RunValue<SessionRefusal>, &RunValue<ScanSample>,
    &RunValue<OdometrySample>, &RunValue<PoseReport>,   &RunValue<Ledger>,         &RunValue<MapInfo>,
    &RunValue<TileSample>,     &RunValue<Job>,          &RunValue<Request>,        &RunValue<Reply>};

bool RunSample(std::string_view input) {
  Pieces pieces(input);
  const std::size_t topic = pieces.Take() % kRunSample.size();
  return kRunSample[topic](pieces.rest());
}

std::vector<std::string> SeedsOfSamples() {
  SessionRequest session = wire::ExtremeSessionRequest();
  session.sensors.resize(2);
  std::vector<std::string> seeds;
  const auto add = [&seeds](const auto& value) {
    seeds.push_back(std::string(1, static_cast<char>(seeds.size())) + Serialized(value));
  };
  add(session);
  add(wire::ExtremeSessionState());
  add(wire::ExtremeSessionRefusal());
  add(wire::ExtremeScan(16));
  add(wire::ExtremeOdometry());
  add(wire::ExtremePose());
  add(wire::ExtremeLedger());
  add(wire::ExtremeMapInfo());
  add(wire::ExtremeTile(32));
  add(wire::ExtremeJob());
  add(wire::ExtremeRequest());
  add(Reply{});
  Must(seeds.size() == kRunSample.size(), "a seed of every topic");
  Reply reply = wire::ExtremeReply();
  reply.tiles.resize(0);
  // No number, which is not equal to itself.
  reply.load.front().up_s = std::numeric_limits<double>::quiet_NaN();
  reply.edits.front().width_m = std::numeric_limits<double>::quiet_NaN();
  seeds.push_back(std::string(1, static_cast<char>(seeds.size() - 1)) + Serialized(reply));
  return seeds;
}

const bool kSampleTarget = Register({"sample", &RunSample, &SeedsOfSamples});

}  // namespace
}  // namespace cairn::fuzz
