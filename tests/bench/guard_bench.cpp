// What the check of a datagram costs: for every datagram that arrives, and for every one that is sent.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <vector>

#include "common/wire/rtps_datagram.h"

namespace cairn::bench {
namespace {

// INFO_DST, INFO_TS, DATA with `payload` bytes, HEARTBEAT: what a scan is sent in. The number stands where it is told.
struct ScanDatagram {
  std::vector<std::uint8_t> bytes = {'R', 'T', 'P', 'S', 2, 3, 1, 15};
  std::size_t sequence = 0;

  explicit ScanDatagram(std::uint16_t payload) {
    Zeros(12);
    Begin(0x0e, 12);
    Zeros(12);
    Begin(0x09, 8);
    Zeros(8);
    Begin(0x15, static_cast<std::uint16_t>(24 + payload), 0x05);
    bytes.insert(bytes.end(), {0, 0, 16, 0, 0, 0, 1, 7, 0, 0, 1, 2, 0, 0, 0, 0});
    sequence = bytes.size();
    Zeros(4);
    bytes.insert(bytes.end(), {0, 1, 0, 0});
    Zeros(payload);
    Begin(0x07, 28);
    bytes.insert(bytes.end(), {0, 0, 1, 7, 0, 0, 2, 2, 0, 0, 0, 0, 1, 0, 0, 0});
    Zeros(12);
  }
  void Number(std::uint32_t n) {
    for (std::size_t i = 0; i < 4; ++i) bytes[sequence + i] = static_cast<std::uint8_t>(n >> (8 * i));
  }

 private:
  void Begin(std::uint8_t id, std::uint16_t length, std::uint8_t flags = 0x01) {
    for (const unsigned byte : {unsigned{id}, unsigned{flags}, length & 0xffU, unsigned{length} >> 8U})
      bytes.push_back(static_cast<std::uint8_t>(byte));
  }
  void Zeros(std::size_t n) { bytes.resize(bytes.size() + n); }
};

void GuardInspectsDatagram(benchmark::State& state) {
  ScanDatagram datagram(static_cast<std::uint16_t>(state.range(0)));
  wire::SequenceGate gate;
  std::uint32_t number = 0;
  for (auto _ : state) {
    datagram.Number(++number);
    if (wire::InspectDatagram(datagram.bytes, gate) != wire::DatagramFault::kNone) state.SkipWithError("refused");
  }
}
BENCHMARK(GuardInspectsDatagram)->Arg(60)->Arg(1500)->Arg(30000);

void GuardNotesSentDatagram(benchmark::State& state) {
  ScanDatagram datagram(static_cast<std::uint16_t>(state.range(0)));
  wire::SequenceGate gate;
  std::uint32_t number = 0;
  for (auto _ : state) {
    datagram.Number(++number);
    wire::NoteSent(datagram.bytes, gate);
  }
}
BENCHMARK(GuardNotesSentDatagram)->Arg(1500);

}  // namespace
}  // namespace cairn::bench
