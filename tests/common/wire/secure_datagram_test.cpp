#include "common/wire/secure_datagram.h"

#include <gtest/gtest.h>

#include "common/wire/fragment_assembly.h"
#include "tests/common/wire/datagram.h"

namespace cairn::wire {
namespace {

using namespace test;

// Announcements of participants and handshakes hold lists whose counts the library trusts. They are read before anybody
// is authenticated, the tokens of announcements also without security.
class SecurityLists : public ::testing::Test {
 protected:
  // An announcement with one parameter, which `fill` writes.
  template <typename Fill>
  static DatagramFault Announcement(std::uint16_t parameter, std::uint16_t bytes, Fill fill) {
    Datagram datagram;
    datagram.Begin(0x15, kHasData).U16(0).U16(16).U32(0).U32(0xc2000100).Sequence(1).U16(0x0300).U16(0);
    fill(datagram.U16(parameter).U16(bytes));
    return datagram.U16(1).U16(0).End().Inspect();
  }
  static Datagram Handshake(std::uint32_t reader = 0xc4010200, std::uint32_t writer = 0xc3010200) {
    Datagram datagram;
    datagram.Begin(0x15, kHasData).U16(0).U16(16).U32(reader).U32(writer).Sequence(1).U16(0x0100).U16(0);
    return datagram.Zeros(96).Text("dds.auth");
  }
};

TEST_F(SecurityLists, OfTokensMustBeWhole) {
  constexpr std::uint16_t kIdentity = 0x1001;
  constexpr std::uint16_t kPermissions = 0x1002;
  for (const std::uint16_t token : {kIdentity, kPermissions}) {
    const auto one_property = [](Datagram& d) { d.Text("PKI").U32(1).Text("a").Text("b").U32(0); };
    EXPECT_EQ(Announcement(token, 32, one_property), DatagramFault::kNone);
    EXPECT_EQ(Announcement(token, 28, one_property), DatagramFault::kSecurity);
    EXPECT_EQ(Announcement(token, 16, [](Datagram& d) { d.Text("PKI").U32(0xffffffff).U32(0); }),
              DatagramFault::kSecurity);
    EXPECT_EQ(Announcement(token, 16, [](Datagram& d) { d.Text("PKI").U32(0).U32(0x10000000); }),
              DatagramFault::kSecurity);
    EXPECT_EQ(Announcement(token, 8, [](Datagram& d) { d.U32(0xfffffff0).U32(0); }), DatagramFault::kSecurity);
  }
}

TEST_F(SecurityLists, OfHandshakesMustBeWhole) {
  EXPECT_EQ(Handshake().U32(0).End().Inspect(), DatagramFault::kNone);
  EXPECT_EQ(Handshake().U32(0xffffffff).End().Inspect(), DatagramFault::kSecurity);
  EXPECT_EQ(Handshake().U32(1).Text("PKI").U32(0).U32(0).End().Inspect(), DatagramFault::kNone);
  EXPECT_EQ(Handshake().U32(1).Text("PKI").U32(0x7fffffff).U32(0).End().Inspect(), DatagramFault::kSecurity);
  EXPECT_EQ(Handshake().U32(1).Text("PKI").U32(0).U32(1).Text("dh1").U32(0xfffffff0).End().Inspect(),
            DatagramFault::kSecurity);
  // A message to the reader alone is read as well, and one from the writer.
  EXPECT_EQ(Handshake(0, 0xc3010200).U32(0xffffffff).End().Inspect(), DatagramFault::kSecurity);
  EXPECT_EQ(Handshake(0xc4010200, 0).U32(0xffffffff).End().Inspect(), DatagramFault::kSecurity);
}

// Made with: openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj "/" (and "/CN=a").
constexpr char kNoSubject[] =
    "-----BEGIN CERTIFICATE-----\n"
    "MIIBVTCB+6ADAgECAhQEqece3NOjdLMXYlfg8gLDSACPJzAKBggqhkjOPQQDAjAA\n"
    "MB4XDTI2MTEyMjIyNDQyNFoXDTM2MTExOTIyNDQyNFowADBZMBMGByqGSM49AgEG\n"
    "CCqGSM49AwEHA0IABBrvd7g+t47seouRkAdDkz3vXlB/XqQcLfplXGmsgMr3eZ5n\n"
    "w9HgyLRRdEw5Gp+uNv+zhh+mK7EWRydvqniRprOjUzBRMB0GA1UdDgQWBBQ2b3jY\n"
    "FNJXnkk7EEqKDBxUIAwJ0TAfBgNVHSMEGDAWgBQ2b3jYFNJXnkk7EEqKDBxUIAwJ\n"
    "0TAPBgNVHRMBAf8EBTADAQH/MAoGCCqGSM49BAMCA0kAMEYCIQCm5rPXUsc+NfRy\n"
    "Grrs86iok2pyjP9yq2g2F9K1z+u0mwIhAO0ppLrsV6rxCOE/C2O9UlB5Be41ODHh\n"
    "jFAtYXxktK7f\n"
    "-----END CERTIFICATE-----\n";
constexpr char kSubject[] =
    "-----BEGIN CERTIFICATE-----\n"
    "MIIBbTCCAROgAwIBAgIUYAZJ9YO1DcTEQbRVJGcuaNkmfxswCgYIKoZIzj0EAwIw\n"
    "DDEKMAgGA1UEAwwBYTAeFw0yNjExMjIyMjQ0MjRaFw0zNjExMTkyMjQ0MjRaMAwx\n"
    "CjAIBgNVBAMMAWEwWTATBgcqhkjOPQIBBggqhkjOPQMBBwNCAASKZO+8WLuCJsHt\n"
    "JgLXKcWzJ0+RoJZPm7hw1oEdaflWZWbi7jAFt2JPrEiFdbCcplJ95ge5ywBbG3Zi\n"
    "WF842Dl/o1MwUTAdBgNVHQ4EFgQUXCqcjZSxi1AcW96wfsl7jKbGVagwHwYDVR0j\n"
    "BBgwFoAUXCqcjZSxi1AcW96wfsl7jKbGVagwDwYDVR0TAQH/BAUwAwEB/zAKBggq\n"
    "hkjOPQQDAgNIADBFAiAXC9x0aGCQskW4bHrLyunVkgf3EFGry+MU1pAwEderewIh\n"
    "AJbjCxPBMDNNt0dTRKaUavbT2DmEjulcrsWTfgTPQbbR\n"
    "-----END CERTIFICATE-----\n";

// The library takes the length -1 of a subject without entries, before it verifies the certificate.
TEST_F(SecurityLists, OfHandshakesHoldACertificateWithASubject) {
  const auto with = [](const std::string& certificate) {
    return Handshake().U32(1).Text("PKI").U32(0).U32(1).Text("c.id").Text(certificate).End().Inspect();
  };
  EXPECT_EQ(with(kSubject), DatagramFault::kNone);
  EXPECT_EQ(with(kNoSubject), DatagramFault::kSecurity);
  EXPECT_EQ(with("nonsense"), DatagramFault::kSecurity);
}

TEST_F(SecurityLists, OfTheseKindsAreNotSentInFragments) {
  for (const std::uint32_t writer : {0xc2000100U, 0xc2030000U, 0xc3010200U}) {
    Datagram datagram;
    datagram.Begin(0x16, 0).U16(0).U16(28).U32(0).U32(writer).Sequence(1).U32(1).U16(1).U16(100).U32(1000);
    datagram.Zeros(100).End();
    EXPECT_TRUE(HasBuiltInFragments(datagram.bytes()));  // The guard refuses these where DDS Security is on.
  }
}

TEST(SecureDatagram, ProtectedPartsHoldTheirLengths) {
  const auto part = [](std::uint8_t id, std::size_t zeros, std::uint32_t count, std::size_t rest) {
    return Datagram().Begin(id, 0).Zeros(zeros).BigEndian(count).Zeros(rest).End().Inspect();
  };
  EXPECT_EQ(part(0x30, 0, 64, 64), DatagramFault::kNone);
  EXPECT_EQ(part(0x30, 0, 65, 64), DatagramFault::kSecurity);
  EXPECT_EQ(part(0x30, 0, 0xfffffff5, 64), DatagramFault::kSecurity);
  EXPECT_EQ(part(0x31, 16, 0, 0), DatagramFault::kNone);
  EXPECT_EQ(part(0x31, 12, 0, 0), DatagramFault::kSecurity);
  for (const bool whole : {true, false}) {
    Datagram datagram;
    datagram.Begin(0x33, 0).Zeros(whole ? 20 : 16).End().Begin(0x34, 0).Zeros(20).End();
    EXPECT_EQ(datagram.Inspect(), whole ? DatagramFault::kNone : DatagramFault::kSecurity);
  }
  for (const std::uint8_t id : {0x32, 0x34}) {
    EXPECT_EQ(part(id, 16, 2, 40), DatagramFault::kNone);
    EXPECT_EQ(part(id, 16, 3, 40), DatagramFault::kSecurity);
    EXPECT_EQ(part(id, 12, 0, 0), DatagramFault::kSecurity);
  }
}

// In a submessage that ends with the datagram (its length is 0) the library looks for further ones, which need not be
// whole. It came out of mutated traffic, and ended every program of a fleet with DDS Security.
TEST(SecureDatagram, WhatIsSignedAsAWholeEndsWithItsSignature) {
  const auto prefix = [] { return Datagram().Begin(0x33, 0).Zeros(20).End(); };
  const auto signed_by = [](Datagram datagram) { return datagram.Begin(0x34, 0).Zeros(20).End().Inspect(); };
  EXPECT_EQ(signed_by(prefix()), DatagramFault::kNone);
  EXPECT_EQ(signed_by(prefix().Heartbeat(1, 3)), DatagramFault::kNone);
  EXPECT_EQ(signed_by(prefix().Heartbeat(1, 3).Begin(0x30, 0).BigEndian(8).Zeros(8).End()), DatagramFault::kNone);
  EXPECT_EQ(prefix().Inspect(), DatagramFault::kSecurity);
  EXPECT_EQ(prefix().Heartbeat(1, 3).Inspect(), DatagramFault::kSecurity);
  // A heartbeat of the length 0. What it holds is taken for a submessage with a length beyond the end, or for none.
  const auto to_the_end = [&] {
    return prefix().Begin(0x07, 0).U32(0).U32(0x000002c2).Sequence(1).Sequence(3).U32(1).EndWithLength(0);
  };
  EXPECT_EQ(to_the_end().Inspect(), DatagramFault::kSecurity);
  EXPECT_EQ(to_the_end().U32(0xffff0101).Inspect(), DatagramFault::kSecurity);
  // The signature itself must be whole, also in such a submessage.
  const auto signed_within = [&](std::uint32_t receivers) {
    Datagram datagram = prefix().Begin(0x50, 0).EndWithLength(0);
    return datagram.Begin(0x34, 0).Zeros(16).BigEndian(receivers).End().Inspect();
  };
  EXPECT_EQ(signed_within(0), DatagramFault::kNone);
  EXPECT_EQ(signed_within(7), DatagramFault::kSecurity);
  // Somewhere else a signature is no beginning of one.
  EXPECT_EQ(Datagram().Heartbeat(1, 3).Begin(0x33, 0).Zeros(20).End().Inspect(), DatagramFault::kNone);
}

// The length of the ciphertext is used before anything of the sample is authenticated.
TEST(SecureDatagram, EncryptedSamplesHoldTheirCiphertext) {
  constexpr std::uint32_t kAes256Gcm = 4;
  const auto sample = [](std::uint32_t length, std::size_t ciphertext) {
    return Data(kHasData, 1)
        .BigEndian(kAes256Gcm)
        .Zeros(16)
        .BigEndian(length)
        .Zeros(ciphertext)
        .Zeros(20)
        .End()
        .Inspect();
  };
  EXPECT_EQ(sample(100, 100), DatagramFault::kNone);
  EXPECT_EQ(sample(101, 100), DatagramFault::kSecurity);
  EXPECT_EQ(sample(0xfffffff5, 100), DatagramFault::kSecurity);
  const auto fragment = [](std::uint32_t length) {
    Datagram datagram;
    datagram.Begin(0x16, 0).U16(0).U16(28).U32(0).U32(0x000002c2).Sequence(1).U32(1).U16(1).U16(100).U32(1000);
    return datagram.BigEndian(kAes256Gcm).Zeros(16).BigEndian(length).Zeros(76).End().Inspect();
  };
  EXPECT_EQ(fragment(956), DatagramFault::kNone);
  EXPECT_EQ(fragment(957), DatagramFault::kSecurity);
}

}  // namespace
}  // namespace cairn::wire
