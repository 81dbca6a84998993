#include "common/wire/security.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/pkcs7.h>
#include <openssl/x509.h>
#include <openssl/x509_vfy.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>

namespace cairn::wire {
namespace {

constexpr const char* kAuthority = "identity_ca.pem";
constexpr const char* kCertificate = "cert.pem";
constexpr const char* kKeyFile = "key.pem";
constexpr const char* kGovernance = "governance.smime";
constexpr const char* kPermissions = "permissions.smime";

template <auto Free>
struct Freed {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};
using Bio = std::unique_ptr<BIO, Freed<BIO_free_all>>;
using Certificate = std::unique_ptr<X509, Freed<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;
using Trust = std::unique_ptr<X509_STORE, Freed<X509_STORE_free>>;
using Verification = std::unique_ptr<X509_STORE_CTX, Freed<X509_STORE_CTX_free>>;
using Signature = std::unique_ptr<PKCS7, Freed<PKCS7_free>>;

tl::unexpected<Status> Faulty(const std::filesystem::path& file, const std::string& fault) {
  ERR_clear_error();
  return Fail(StatusCode::kFailedPrecondition, "wire.security: " + file.string() + " " + fault);
}

Result<std::string> Read(const std::filesystem::path& file) {
  constexpr std::size_t kLargest = std::size_t{1} << 20U;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return Faulty(file, "cannot be read (deploy/security/make-fleet.sh makes it)");
  std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  if (bytes.size() > kLargest) return Faulty(file, "is too large");
  return bytes;
}

Bio BioOf(const std::string& bytes) {
  return Bio(BIO_new_mem_buf(bytes.data(), static_cast<int>(bytes.size())));
}

Result<Certificate> ReadCertificate(const std::filesystem::path& file) {
  const Result<std::string> bytes = Read(file);
  if (!bytes) return tl::unexpected(bytes.error());
  Certificate certificate(PEM_read_bio_X509(BioOf(*bytes).get(), nullptr, nullptr, nullptr));
  if (!certificate) return Faulty(file, "is not a certificate in PEM format");
  return certificate;
}

Result<void> CheckKey(const std::filesystem::path& file, X509* certificate) {
  const Result<std::string> bytes = Read(file);
  if (!bytes) return tl::unexpected(bytes.error());
  struct stat info {};
  if (stat(file.c_str(), &info) != 0 || (info.st_mode & S_IRWXO) != 0) {
    return Faulty(file, "is open to every user of this machine; chmod 600 it");
  }
  // Without a function of our own, OpenSSL would ask for a password on the terminal.
  const auto no_password = [](char*, int, int, void*) { return 0; };
  const Key key(PEM_read_bio_PrivateKey(BioOf(*bytes).get(), nullptr, no_password, nullptr));
  if (!key) return Faulty(file, "is not a private key in PEM format without a password");
  if (X509_check_private_key(certificate, key.get()) != 1) {
    return Faulty(file, std::string("does not belong to ") + kCertificate);
  }
  return {};
}

Result<void> CheckIssued(const std::filesystem::path& file, X509* certificate, X509_STORE* trust) {
  const Verification verification(X509_STORE_CTX_new());
  if (X509_STORE_CTX_init(verification.get(), trust, certificate, nullptr) == 1 &&
      X509_verify_cert(verification.get()) == 1) {
    return {};
  }
  const int error = X509_STORE_CTX_get_error(verification.get());
  return Faulty(file, std::string("is not valid: ") + X509_verify_cert_error_string(error));
}

// The text of a signed file, without its signature.
Result<std::string> ReadSigned(const std::filesystem::path& file, X509_STORE* trust) {
  const Result<std::string> bytes = Read(file);
  if (!bytes) return tl::unexpected(bytes.error());
  BIO* content = nullptr;
  const Signature signature(SMIME_read_PKCS7(BioOf(*bytes).get(), &content));
  const Bio signed_content(content);
  const Bio text(BIO_new(BIO_s_mem()));
  if (!signature || PKCS7_verify(signature.get(), nullptr, trust, content, text.get(), PKCS7_TEXT) != 1) {
    return Faulty(file, std::string("has no valid signature of ") + kAuthority);
  }
  const char* data = nullptr;
  const long size = BIO_get_mem_data(text.get(), &data);
  return std::string(data, static_cast<std::size_t>(size));
}

// As it stands in permissions: RFC 2253, for example CN=r1,OU=robot,O=cairn.
std::string SubjectOf(X509* certificate) {
  const Bio text(BIO_new(BIO_s_mem()));
  X509_NAME_print_ex(text.get(), X509_get_subject_name(certificate), 0, XN_FLAG_RFC2253 & ~ASN1_STRFLGS_ESC_MSB);
  const char* data = nullptr;
  const long size = BIO_get_mem_data(text.get(), &data);
  return {data, static_cast<std::size_t>(size)};
}

}  // namespace

Result<void> CheckSecurityFiles(const std::string& directory) {
  const std::filesystem::path place(directory);
  const Result<Certificate> authority = ReadCertificate(place / kAuthority);
  if (!authority) return tl::unexpected(authority.error());
  const Result<Certificate> certificate = ReadCertificate(place / kCertificate);
  if (!certificate) return tl::unexpected(certificate.error());
  const Trust trust(X509_STORE_new());
  X509_STORE_add_cert(trust.get(), authority->get());
  if (auto own = CheckKey(place / kKeyFile, certificate->get()); !own) return own;
  if (auto issued = CheckIssued(place / kCertificate, certificate->get(), trust.get()); !issued) return issued;
  if (const auto rules = ReadSigned(place / kGovernance, trust.get()); !rules) return tl::unexpected(rules.error());
  const auto permissions = ReadSigned(place / kPermissions, trust.get());
  if (!permissions) return tl::unexpected(permissions.error());
  const std::string subject = SubjectOf(certificate->get());
  if (permissions->find("<subject_name>" + subject + "</subject_name>") == std::string::npos) {
    return Faulty(place / kPermissions, "has no grant for " + subject);
  }
  return {};
}

void AddSecurity(const std::string& directory, eprosima::fastdds::dds::DomainParticipantQos& qos) {
  const std::string place = "file://" + std::filesystem::absolute(directory).string() + "/";
  auto& properties = qos.properties().properties();
  const auto add = [&](const std::string& name, const std::string& value) { properties.emplace_back(name, value); };
  add("dds.sec.auth.plugin", "builtin.PKI-DH");
  const std::string identity = "dds.sec.auth.builtin.PKI-DH.";
  add(identity + "identity_ca", place + kAuthority);
  add(identity + "identity_certificate", place + kCertificate);
  add(identity + "private_key", place + kKeyFile);
  add("dds.sec.access.plugin", "builtin.Access-Permissions");
  const std::string access = "dds.sec.access.builtin.Access-Permissions.";
  add(access + "permissions_ca", place + kAuthority);
  add(access + "governance", place + kGovernance);
  add(access + "permissions", place + kPermissions);
  add("dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC");
}

}  // namespace cairn::wire
