// The option that bounds how far a stream may run ahead of the server. With a window below 64, the length of the
// server's queue, no scan is lost.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>

namespace cairn::client {

inline constexpr std::uint64_t kFastWindow = 32;

inline void AddWindowOption(CLI::App& command, std::uint64_t& window) {
  command
      .add_option(
          "--window", window,
          "Most scans sent and not yet answered [with --fast: 32]; a stream that is too fast for the server waits "
          "instead of losing scans")
      ->check(CLI::Range(1, 48));
}

}  // namespace cairn::client
