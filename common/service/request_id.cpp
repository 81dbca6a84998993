#include "common/service/request_id.h"

#include <array>
#include <cstdio>

namespace cairn {

std::string ShortClientId(ClientId client) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "%08x", static_cast<unsigned int>(client & 0xffffffffU));
  return text.data();
}

std::string RequestId(ClientId client, std::int64_t sequence) {
  return ShortClientId(client) + '-' + std::to_string(sequence);
}

}  // namespace cairn
