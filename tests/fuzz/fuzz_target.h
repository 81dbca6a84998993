// A fuzz target: what a program does with bytes from outside, from the decoder to the place where the value is used.
// Its source is linked into two programs: `fuzz_NAME` (libFuzzer, clang only, guided by coverage) and
// `fuzz_replay_test` (every compiler), which runs the seeds and the kept inputs of all targets once.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cairn::fuzz {

struct Target {
  const char* name;
  // Whether the decoder accepted the input. Aborts where something that must hold does not.
  bool (*run)(std::string_view input);
  // Good inputs, made by the encoders as they are now; `run` accepts each of them.
  std::vector<std::string> (*seeds)();
};

// In the order in which they were registered.
inline std::vector<Target>& Targets() {
  static std::vector<Target> targets;
  return targets;
}

inline bool Register(const Target& target) {
  Targets().push_back(target);
  return true;
}

// Also in builds without assertions.
inline void Must(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what);
  std::abort();
}

// Takes an input apart: numbers, and pieces with their length before them. Beyond the end, zeros and empty pieces.
class Pieces {
 public:
  explicit Pieces(std::string_view input) : rest_(input) {}

  [[nodiscard]] bool empty() const { return rest_.empty(); }
  [[nodiscard]] std::string_view rest() const { return rest_; }
  template <typename Number = std::uint8_t>
  Number Take() {
    Number number{};
    std::memcpy(&number, rest_.data(), std::min(sizeof(number), rest_.size()));
    rest_.remove_prefix(std::min(sizeof(number), rest_.size()));
    return number;
  }
  // As much as its length says, or as is left.
  std::string_view TakePiece() {
    const std::size_t wanted = Take<std::uint16_t>();
    const std::size_t size = std::min(wanted, rest_.size());
    const std::string_view piece = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return piece;
  }

 private:
  std::string_view rest_;
};

// The opposite: REQUIRES a piece shorter than 64 KiB.
inline std::string Piece(std::string_view bytes) {
  const auto size = static_cast<std::uint16_t>(bytes.size());
  std::string piece(sizeof(size), '\0');
  std::memcpy(piece.data(), &size, sizeof(size));
  return piece.append(bytes);
}

}  // namespace cairn::fuzz
