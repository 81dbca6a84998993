// A fleet's certificates, made once for the test program by deploy/security/make-fleet.sh: robots r1 and r2, the
// program `sim` for s1 and s2, viewer v, recorder c, operator o; and a second fleet, with which the first has nothing
// to do.
#pragma once

#include <openssl/pem.h>
#include <openssl/x509.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "tests/child_process.h"
#include "tests/loopback.h"
#include "tests/temp_directory.h"

namespace cairn::test {

inline void MakeFleet(const std::filesystem::path& directory) {
  const auto made = ChildProcess({CAIRN_MAKE_FLEET, directory.string(), "--robots", "r1,r2,sim=s1+s2", "--viewers", "v",
                                  "--recorders", "c", "--operators", "o"})
                        .Wait();
  if (made.exit_code != 0) throw std::runtime_error(made.output);
}

inline const std::filesystem::path& Fleet() {
  static const TempDirectory directory;
  static const bool made = (MakeFleet(directory.path()), true);
  static_cast<void>(made);
  return directory.path();
}
inline const std::filesystem::path& OtherFleet() {
  static const TempDirectory directory;
  static const bool made = (MakeFleet(directory.path()), true);
  static_cast<void>(made);
  return directory.path();
}

// A copy of a member's directory, for a test to damage.
inline std::filesystem::path CopyOf(const std::filesystem::path& member, const TempDirectory& into) {
  const std::filesystem::path copy = into / "copy";
  std::filesystem::remove_all(copy);
  std::filesystem::copy(member, copy, std::filesystem::copy_options::recursive);
  return copy;
}

// Signs the member's certificate again, with an end in the past.
inline void Expire(const std::filesystem::path& member, const std::filesystem::path& fleet) {
  using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;
  const auto open = [](const std::filesystem::path& path, const char* mode) {
    return File(std::fopen(path.c_str(), mode), std::fclose);
  };
  EVP_PKEY* authority = PEM_read_PrivateKey(open(fleet / "ca.key", "r").get(), nullptr, nullptr, nullptr);
  X509* certificate = PEM_read_X509(open(member / "cert.pem", "r").get(), nullptr, nullptr, nullptr);
  X509_gmtime_adj(X509_getm_notBefore(certificate), -7200);
  X509_gmtime_adj(X509_getm_notAfter(certificate), -3600);
  const bool done = X509_sign(certificate, authority, EVP_sha256()) > 0 &&
                    PEM_write_X509(open(member / "cert.pem", "w").get(), certificate) == 1;
  X509_free(certificate);
  EVP_PKEY_free(authority);
  if (!done) throw std::runtime_error("cannot sign the certificate again");
}

inline WireOptions SecureOptions(const std::filesystem::path& member) {
  WireOptions options = LoopbackOptions();
  options.security = member.string();
  return options;
}

}  // namespace cairn::test
