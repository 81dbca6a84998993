// What the guard must know of DDS Security before any key is known: the parts of datagrams that Fast DDS 2.9 decodes
// before it has authenticated their sender. The library takes counts and lengths from them without a check, so that one
// forged datagram could make it allocate gigabytes, read beyond a buffer or end with an exception; a part of this also
// without security. These faults were read in its source. Stateless, thread-safe.
// Source: OMG DDS-SECURITY 1.1, sections 7.3.6, 7.4.3 and 9.5.2; Fast DDS 2.9.1: CDRMessage.hpp, PKIDH.cpp,
// AESGCMGMAC_Transform.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace cairn::wire {

// A token (DataHolder) of a participant's announcement, which takes the whole span.
[[nodiscard]] bool IsWholeToken(std::span<const std::uint8_t> bytes, bool little);

// The serialised payload of a handshake message (ParticipantStatelessMessage), with its encapsulation. Its lists must
// be whole, and a certificate in it must have a subject.
[[nodiscard]] bool IsWholeHandshake(std::span<const std::uint8_t> payload);

// The content of a submessage that belongs to a protected one: SEC_BODY, SEC_PREFIX, SEC_POSTFIX, SRTPS_PREFIX or
// SRTPS_POSTFIX. True for every other `id`.
[[nodiscard]] bool IsWholeProtection(std::uint8_t id, std::span<const std::uint8_t> content);

// A datagram that begins with SRTPS_PREFIX is signed as a whole. Fast DDS steps from submessage to submessage by their
// lengths until it finds SRTPS_POSTFIX, and takes a length of 0 literally. If a length leads beyond the end, it does
// not move but still adds the length, and reads beyond the datagram. So every step must stay inside, up to an
// SRTPS_POSTFIX. True for every other datagram.
[[nodiscard]] bool IsWholeIfSigned(std::span<const std::uint8_t> datagram);

// The beginning of a sample of `size` bytes. If it is encrypted, the ciphertext must lie within the sample.
[[nodiscard]] bool HoldsItsCiphertext(std::span<const std::uint8_t> beginning, std::size_t size);

}  // namespace cairn::wire
