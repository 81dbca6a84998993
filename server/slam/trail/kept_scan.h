// A scan that is kept for as long as its session lives: as it is, or packed, from which the same scan comes out again,
// bit by bit. Ranges of any bits take 2.9 bytes instead of 4, those of a lidar that measures millimetres 1.2. Copies
// share it. It never changes but by Pack, which only concerns the copy that is packed. Thread rule: any thread, if each
// copy stays with one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "common/sensor/scan.h"

namespace cairn::slam {

// Any floats, and the same again. Of each number the difference from the one before it is written, in as many bits as
// the largest of sixteen needs: of the numbers themselves where they are whole millimetres or quarters of them, as most
// lidars measure, and of their bits otherwise. REQUIRES of the second: `packed` was made by the first.
[[nodiscard]] std::vector<std::uint8_t> PackFloats(std::span<const float> values);
[[nodiscard]] std::vector<float> UnpackFloats(std::span<const std::uint8_t> packed, std::size_t count);

class KeptScan {
 public:
  KeptScan() = default;
  // Null is allowed, and is a KeptScan without a scan.
  KeptScan(std::shared_ptr<const Scan> scan) : whole_(std::move(scan)) {}  // NOLINT(google-explicit-constructor)
  KeptScan(std::shared_ptr<Scan> scan) : whole_(std::move(scan)) {}        // NOLINT(google-explicit-constructor)

  void Pack();
  [[nodiscard]] bool packed() const { return packed_ != nullptr; }

  // REQUIRES of all: there is a scan. A packed one is unpacked each time, but not for its stamp.
  [[nodiscard]] Stamp stamp() const { return packed_ ? packed_->rest.stamp : whole_->stamp; }
  [[nodiscard]] std::shared_ptr<const Scan> Share() const;
  [[nodiscard]] Scan operator*() const { return packed_ ? Unpack(*packed_) : *whole_; }
  [[nodiscard]] std::shared_ptr<const Scan> operator->() const { return Share(); }

 private:
  struct Packed {
    Scan rest;  // Without its ranges.
    std::uint32_t beams = 0;
    std::vector<std::uint8_t> ranges;
  };
  [[nodiscard]] static Scan Unpack(const Packed& packed);

  std::shared_ptr<const Scan> whole_;
  std::shared_ptr<const Packed> packed_;
};

}  // namespace cairn::slam
