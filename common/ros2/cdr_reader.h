// Takes the fields of a message from its bytes, as ROS 2 puts them on the wire and into bags: four bytes that name the
// encoding, then plain CDR in either byte order, each number aligned to its own size. Bytes from anywhere are safe: the
// first field that does not fit makes the reader bad, and from then on every field is zero. A reader of our own and not
// Fast CDR, because the programs that need no middleware read bags as well, and because a length of a message never
// makes it allocate more than the message itself is long. Source: OMG CORBA 3.0, 15.3 (CDR); OMG DDSI-RTPS 2.3, 10.2.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

namespace cairn::ros2 {

class CdrReader {
 public:
  // The bytes must outlive the reader.
  explicit CdrReader(std::string_view bytes) {
    constexpr std::size_t kEncapsulationBytes = 4;
    ok_ = bytes.size() >= kEncapsulationBytes && bytes[0] == 0 && (bytes[1] == 0 || bytes[1] == 1);
    if (!ok_) return;
    swapped_ = (bytes[1] == 1) != (std::endian::native == std::endian::little);
    bytes_ = bytes.substr(kEncapsulationBytes);
  }

  [[nodiscard]] bool ok() const { return ok_; }

  template <typename Number>
  Number Take() {
    Align(sizeof(Number));
    char raw[sizeof(Number)] = {};
    if (const std::string_view source = TakeBytes(sizeof(Number)); ok_) source.copy(raw, sizeof(Number));
    if (swapped_) Reverse(raw);
    return std::bit_cast<Number>(raw);
  }
  // Its length counts the zero at its end.
  std::string TakeString() {
    std::string_view text = TakeBytes(Take<std::uint32_t>());
    if (!text.empty() && text.back() == '\0') text.remove_suffix(1);
    return std::string(text);
  }
  // The number of elements of a sequence; an element takes at least `least_bytes`.
  std::uint32_t TakeCount(std::size_t least_bytes) {
    const auto count = Take<std::uint32_t>();
    ok_ = ok_ && count <= (bytes_.size() - at_) / least_bytes;
    return ok_ ? count : 0;
  }
  std::vector<float> TakeFloats() {
    std::vector<float> values(TakeCount(sizeof(float)));
    for (float& value : values) value = Take<float>();
    return values;
  }

 private:
  void Align(std::size_t size) { at_ += (size - at_ % size) % size; }
  std::string_view TakeBytes(std::size_t size) {
    ok_ = ok_ && at_ <= bytes_.size() && size <= bytes_.size() - at_;
    if (!ok_) return {};
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }
  template <std::size_t kSize>
  static void Reverse(char (&raw)[kSize]) {
    for (std::size_t i = 0; i < kSize / 2; ++i) std::swap(raw[i], raw[kSize - 1 - i]);
  }

  std::string_view bytes_;  // After the four that name the encoding: alignment counts from there.
  std::size_t at_ = 0;
  bool ok_ = false;
  bool swapped_ = false;
};

}  // namespace cairn::ros2
