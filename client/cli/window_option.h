// How far a stream may run ahead of the server. A window below the server's queue of 64 scans never loses one.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>

namespace cairn::client {

inline constexpr std::uint64_t kFastWindow = 32;

inline void AddWindowOption(CLI::App& command, std::uint64_t& window) {
  command
      .add_option("--window", window,
                  "Scans on the way at most: a stream too fast for the server slows down instead of losing scans")
      ->check(CLI::Range(1, 48));
}

}  // namespace cairn::client
