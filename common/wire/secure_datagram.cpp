#include "common/wire/secure_datagram.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <string_view>

#include "common/wire/rtps_submessage.h"

namespace cairn::wire {
namespace {

using Bytes = std::span<const std::uint8_t>;

// Reads CDR in order. Everything is aligned to 4 bytes from the beginning of `bytes`.
class Cursor {
 public:
  Cursor(Bytes bytes, bool little, std::size_t at) : bytes_(bytes), little_(little), at_(at) {}

  [[nodiscard]] std::size_t left() const { return bytes_.size() - at_; }
  bool Skip(std::size_t count) {
    if (count > left()) return false;
    at_ += count;
    return true;
  }
  std::optional<std::uint32_t> U32() {
    if (left() < 4) return {};
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      value |= static_cast<std::uint32_t>(bytes_[at_ + i]) << (8 * (little_ ? i : 3 - i));
    }
    at_ += 4;
    return value;
  }
  // A string or a vector of octets: its length, its bytes, and what aligns the next one. The last may end unaligned.
  std::optional<Bytes> Block() {
    const auto size = U32();
    if (!size || *size > left()) return {};
    const Bytes block = bytes_.subspan(at_, *size);
    at_ = std::min(bytes_.size(), (at_ + *size + 3) & ~std::size_t{3});
    return block;
  }
  // A list whose items take at least `smallest` bytes each.
  template <typename Item>
  bool List(std::size_t smallest, Item item) {
    const auto count = U32();
    if (!count || *count > left() / smallest) return false;
    for (std::uint32_t i = 0; i < *count; ++i) {
      if (!item()) return false;
    }
    return true;
  }

 private:
  Bytes bytes_;
  bool little_;
  std::size_t at_;
};

bool HasSubject(Bytes pem) {
  const std::unique_ptr<BIO, int (*)(BIO*)> bio(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())), BIO_free);
  const auto no_password = [](char*, int, int, void*) { return 0; };
  const std::unique_ptr<X509, void (*)(X509*)> certificate(PEM_read_bio_X509(bio.get(), nullptr, no_password, nullptr),
                                                           X509_free);
  ERR_clear_error();
  return certificate && X509_NAME_entry_count(X509_get_subject_name(certificate.get())) > 0;
}

bool ReadHolder(Cursor& cursor) {
  const auto property = [&] { return cursor.Block() && cursor.Block(); };
  const auto binary = [&] {
    const auto name = cursor.Block();
    const auto value = name ? cursor.Block() : std::nullopt;
    if (!value) return false;
    constexpr std::string_view kCertificate = "c.id";
    const bool certificate =
        name->size() >= kCertificate.size() && std::memcmp(name->data(), kCertificate.data(), kCertificate.size()) == 0;
    return !certificate || HasSubject(*value);
  };
  return cursor.Block() && cursor.List(8, property) && cursor.List(8, binary);
}

// Lengths within protected parts are big-endian, whatever the flags say.
std::uint32_t BigEndian(Bytes bytes, std::size_t at) {
  return Cursor(bytes, false, at).U32().value_or(0xffffffff);
}

constexpr std::size_t kCryptoHeaderBytes = 20;  // CryptoHeader: kind 4, key 4, session 4, vector 8.
constexpr std::size_t kMacBytes = 16;
constexpr std::size_t kReceiverMacBytes = 20;  // Key 4, MAC 16.

}  // namespace

bool IsWholeToken(Bytes bytes, bool little) {
  Cursor cursor(bytes, little, 0);
  return ReadHolder(cursor) && cursor.left() == 0;
}

bool IsWholeHandshake(Bytes payload) {
  constexpr std::size_t kIdentities = 2 * 24 + 3 * 16;  // Two message identities, three GUIDs.
  if (payload.size() < 4 || payload[0] != 0 || payload[1] > 1) return false;
  Cursor cursor(payload, payload[1] == 1, 4);
  return cursor.Skip(kIdentities) && cursor.Block() && cursor.List(12, [&] { return ReadHolder(cursor); });
}

bool IsWholeProtection(std::uint8_t id, Bytes content) {
  switch (id) {
    case 0x30:  // SEC_BODY: the length of the ciphertext, and the ciphertext.
      return content.size() >= 4 && BigEndian(content, 0) <= content.size() - 4;
    case 0x31:  // SEC_PREFIX
    case 0x33:  // SRTPS_PREFIX
      return content.size() == kCryptoHeaderBytes;
    case 0x32:  // SEC_POSTFIX
    case 0x34:  // SRTPS_POSTFIX
      return content.size() >= kMacBytes + 4 &&
             BigEndian(content, kMacBytes) <= (content.size() - kMacBytes - 4) / kReceiverMacBytes;
    default:
      return true;
  }
}

bool IsWholeIfSigned(Bytes datagram) {
  constexpr std::uint8_t kSignedPrefix = 0x33, kSignedPostfix = 0x34;
  if (datagram.size() <= kRtpsHeaderBytes || datagram[kRtpsHeaderBytes] != kSignedPrefix) return true;
  for (std::size_t at = kRtpsHeaderBytes; at + 4 <= datagram.size();) {
    // It may stand in a submessage that ends with the datagram, where nothing else looks at it.
    if (datagram[at] == kSignedPostfix) return IsWholeProtection(kSignedPostfix, datagram.subspan(at + 4));
    const bool little = (datagram[at + 1] & 1) != 0;
    const std::size_t length = datagram[at + (little ? 2 : 3)] + std::size_t{256} * datagram[at + (little ? 3 : 2)];
    at += 4 + ((length + 3) & ~std::size_t{3});
  }
  return false;
}

bool HoldsItsCiphertext(Bytes beginning, std::size_t size) {
  constexpr std::uint32_t kAes128Gcm = 2;
  constexpr std::uint32_t kAes256Gcm = 4;
  if (beginning.size() < kCryptoHeaderBytes + 4) return true;
  const std::uint32_t kind = BigEndian(beginning, 0);
  if (kind != kAes128Gcm && kind != kAes256Gcm) return true;
  const std::size_t rest = kCryptoHeaderBytes + 4 + kMacBytes + 4;
  return size >= rest && BigEndian(beginning, kCryptoHeaderBytes) <= size - rest;
}

}  // namespace cairn::wire
