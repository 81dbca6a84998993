// Reads the tiles of all sites in a domain until it is killed. cairn-study overload lets it stand still. It prints
// "tile after N signals" for the first tile, and for the first one after each SIGUSR1.
// Usage: tile_reader DOMAIN
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <iostream>
#include <string>

#include "common/wire/bus.h"

namespace {

std::atomic<int> g_signals = 0;

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  std::signal(SIGUSR1, [](int) { ++g_signals; });
  cairn::wire::WireOptions options;
  options.domain = std::stoi(argv[1]);
  const auto bus = cairn::wire::Bus::Create(options, "tile reader");
  if (!bus) {
    std::cerr << bus.error().message << std::endl;
    return 1;
  }
  std::atomic<int> said = -1;
  const auto tiles = (*bus)->Subscribe<cairn::TileSample>([&](cairn::TileSample&&) {
    const int signals = g_signals;
    if (said.exchange(signals) != signals) std::cout << "tile after " << signals << " signals" << std::endl;
  });
  if (!tiles) {
    std::cerr << tiles.error().message << std::endl;
    return 1;
  }
  for (;;) pause();
}
