#include "server/slam/trail/kept_scan.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

namespace cairn::slam {
namespace {

// How the floats became whole numbers: the first byte of what is packed.
enum class Code : std::uint8_t { kBits = 0, kMillimetres, kQuarters };

constexpr std::size_t kBlock = 16;  // Numbers that share one width.
constexpr double kMostSteps = 1e8;  // Larger ones would not be exact.

double StepsPerMetre(Code code) {
  return code == Code::kMillimetres ? 1000.0 : 4000.0;
}

float FloatOf(std::int64_t steps, Code code) {
  return static_cast<float>(static_cast<double>(steps) / StepsPerMetre(code));
}

bool SameBits(float a, float b) {
  return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}

// False if one of the values is no multiple of the step.
bool ToSteps(std::span<const float> values, Code code, std::vector<std::uint32_t>& steps) {
  steps.clear();
  for (const float value : values) {
    const double exact = static_cast<double>(value) * StepsPerMetre(code);
    if (!(exact >= 0.0 && exact < kMostSteps)) return false;
    const auto step = static_cast<std::uint32_t>(exact + 0.5);
    if (!SameBits(FloatOf(step, code), value)) return false;
    steps.push_back(step);
  }
  return true;
}

void ToBits(std::span<const float> values, std::vector<std::uint32_t>& bits) {
  bits.clear();
  for (const float value : values) bits.push_back(std::bit_cast<std::uint32_t>(value));
}

// Small numbers of either sign become small numbers.
std::uint32_t ZigZag(std::uint32_t difference) {
  return (difference << 1) ^ (0U - (difference >> 31));
}
std::uint32_t FromZigZag(std::uint32_t number) {
  return (number >> 1) ^ (0U - (number & 1U));
}

constexpr std::size_t kMostBytesOfBlock = 1 + kBlock * sizeof(std::uint32_t);

// Returns the end of what was written. REQUIRES: there is room for kMostBytesOfBlock for each block.
std::uint8_t* WriteBlocks(std::span<const std::uint32_t> numbers, std::uint8_t* to) {
  static_assert(std::endian::native == std::endian::little, "words are written as they are in memory");
  std::uint32_t before = 0;
  for (std::size_t first = 0; first < numbers.size(); first += kBlock) {
    const std::size_t count = std::min(kBlock, numbers.size() - first);
    std::array<std::uint32_t, kBlock> differences{};
    std::uint32_t all = 0;
    for (std::size_t i = 0; i < count; ++i) {
      differences[i] = ZigZag(numbers[first + i] - before);
      before = numbers[first + i];
      all |= differences[i];
    }
    const int width = std::bit_width(all);
    *to++ = static_cast<std::uint8_t>(width);
    std::uint64_t bits = 0;
    int held = 0;
    for (std::size_t i = 0; i < count; ++i) {
      bits |= std::uint64_t{differences[i]} << held;
      held += width;
      if (held < 32) continue;
      std::memcpy(to, &bits, 4);
      to += 4;
      bits >>= 32;
      held -= 32;
    }
    for (; held > 0; held -= 8, bits >>= 8) *to++ = static_cast<std::uint8_t>(bits);
  }
  return to;
}

}  // namespace

std::vector<std::uint8_t> PackFloats(std::span<const float> values) {
  std::vector<std::uint32_t> numbers;
  numbers.reserve(values.size());
  Code code = Code::kMillimetres;
  if (!ToSteps(values, code, numbers)) {
    code = Code::kQuarters;
    if (!ToSteps(values, code, numbers)) {
      code = Code::kBits;
      ToBits(values, numbers);
    }
  }
  const std::size_t blocks = (numbers.size() + kBlock - 1) / kBlock;
  std::vector<std::uint8_t> room(1 + blocks * kMostBytesOfBlock);
  room[0] = static_cast<std::uint8_t>(code);
  return {room.data(), WriteBlocks(numbers, room.data() + 1)};
}

std::vector<float> UnpackFloats(std::span<const std::uint8_t> packed, std::size_t count) {
  std::vector<float> values(count);
  const auto code = static_cast<Code>(packed[0]);
  std::size_t at = 1;
  std::uint32_t before = 0;
  for (std::size_t first = 0; first < count; first += kBlock) {
    const int width = packed[at++];
    const std::uint64_t mask = (std::uint64_t{1} << width) - 1;
    std::uint64_t bits = 0;
    int held = 0;
    for (std::size_t i = first; i < std::min(first + kBlock, count); ++i) {
      for (; held < width; held += 8) bits |= std::uint64_t{packed[at++]} << held;
      before += FromZigZag(static_cast<std::uint32_t>(bits & mask));
      bits >>= width;
      held -= width;
      values[i] = code == Code::kBits ? std::bit_cast<float>(before) : FloatOf(before, code);
    }
  }
  return values;
}

void KeptScan::Pack() {
  if (!whole_) return;
  auto packed = std::make_shared<Packed>();
  packed->rest.sequence = whole_->sequence;
  packed->rest.stamp = whole_->stamp;
  packed->rest.angle_first_rad = whole_->angle_first_rad;
  packed->rest.angle_step_rad = whole_->angle_step_rad;
  packed->rest.range_min_m = whole_->range_min_m;
  packed->rest.range_max_m = whole_->range_max_m;
  packed->rest.beam_period_s = whole_->beam_period_s;
  packed->rest.tilt_rad = whole_->tilt_rad;
  packed->rest.T_robot_laser = whole_->T_robot_laser;
  packed->beams = static_cast<std::uint32_t>(whole_->ranges_m.size());
  packed->ranges = PackFloats(whole_->ranges_m);
  packed_ = std::move(packed);
  whole_ = nullptr;
}

std::shared_ptr<const Scan> KeptScan::Share() const {
  if (!packed_) return whole_;
  return std::make_shared<const Scan>(Unpack(*packed_));
}

Scan KeptScan::Unpack(const Packed& packed) {
  Scan scan = packed.rest;
  scan.ranges_m = UnpackFloats(packed.ranges, packed.beams);
  return scan;
}

}  // namespace cairn::slam
