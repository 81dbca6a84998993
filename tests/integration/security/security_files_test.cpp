// Whether the files of an identity (deploy/security/make-fleet.sh) belong together, and what is said where they do not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/integration/security/fleet_files.h"

namespace cairn {
namespace {

using test::Fleet;
using test::SecureOptions;
using ::testing::HasSubstr;

class SecurityFiles : public ::testing::Test {
 protected:
  void SetUp() override { member_ = test::CopyOf(Fleet() / "robots" / "r1", directory_); }
  std::string Fault() {
    const auto bus = wire::Bus::Create(SecureOptions(member_), "member");
    if (bus) return "none";
    EXPECT_EQ(bus.error().code, StatusCode::kFailedPrecondition);
    return bus.error().message;
  }
  void Copy(const std::filesystem::path& from, const std::string& name) {
    std::filesystem::copy_file(from, member_ / name, std::filesystem::copy_options::overwrite_existing);
  }
  static std::string TextOf(const std::filesystem::path& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  const TempDirectory directory_;
  std::filesystem::path member_;
};

TEST_F(SecurityFiles, AreComplete) {
  EXPECT_EQ(Fault(), "none");
  for (const char* name : {"identity_ca.pem", "cert.pem", "key.pem", "governance.smime", "permissions.smime"}) {
    member_ = test::CopyOf(Fleet() / "robots" / "r1", directory_);
    std::filesystem::remove(member_ / name);
    EXPECT_THAT(Fault(), HasSubstr(std::string(name) + " cannot be read"));
    std::ofstream(member_ / name) << "nonsense";
    EXPECT_THAT(Fault(), HasSubstr(std::string(name)));
  }
}

TEST_F(SecurityFiles, BelongTogether) {
  Copy(Fleet() / "robots" / "r2" / "key.pem", "key.pem");
  const std::string fault = Fault();
  EXPECT_THAT(fault, HasSubstr("key.pem does not belong to cert.pem"));
  const std::string secret = TextOf(member_ / "key.pem").substr(40, 20);
  EXPECT_EQ(fault.find(secret), std::string::npos);
  member_ = test::CopyOf(Fleet() / "robots" / "r1", directory_);
  Copy(test::OtherFleet() / "ca.pem", "identity_ca.pem");
  EXPECT_THAT(Fault(), HasSubstr("cert.pem is not valid: unable to get local issuer certificate"));
  member_ = test::CopyOf(Fleet() / "viewers" / "v", directory_);
  Copy(Fleet() / "operators" / "o" / "permissions.smime", "permissions.smime");
  EXPECT_THAT(Fault(), HasSubstr("permissions.smime has no grant for CN=v,OU=viewer,O=cairn"));
  member_ = test::CopyOf(Fleet() / "robots" / "r1", directory_);
  Copy(test::OtherFleet() / "robots" / "r1" / "permissions.smime", "permissions.smime");
  EXPECT_THAT(Fault(), HasSubstr("permissions.smime has no valid signature of identity_ca.pem"));
}

TEST_F(SecurityFiles, AreNotChangedAfterTheyWereSigned) {
  std::string text = TextOf(member_ / "permissions.smime");
  const auto at = text.find("cairn/v1/request");
  ASSERT_NE(at, std::string::npos);
  std::ofstream(member_ / "permissions.smime") << text.replace(at, 16, "cairn/v1/*      ");
  EXPECT_THAT(Fault(), HasSubstr("permissions.smime has no valid signature"));
}

// The certificate of a member comes from the same authority, but it is not one to sign permissions with.
TEST_F(SecurityFiles, AreNotSignedByAMember) {
  const std::filesystem::path text = directory_ / "permissions.xml", forged = directory_ / "forged.smime";
  std::ofstream(text) << "<dds><permissions/></dds>";
  const auto signing =
      ChildProcess({"/usr/bin/env", "openssl", "smime", "-sign", "-in", text.string(), "-text", "-out", forged.string(),
                    "-signer", (member_ / "cert.pem").string(), "-inkey", (member_ / "key.pem").string()})
          .Wait();
  ASSERT_EQ(signing.exit_code, 0) << signing.output;
  Copy(forged, "permissions.smime");
  EXPECT_THAT(Fault(), HasSubstr("permissions.smime has no valid signature"));
}

TEST_F(SecurityFiles, AreInDateAndSecret) {
  std::filesystem::permissions(member_ / "key.pem", std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  EXPECT_THAT(Fault(), HasSubstr("key.pem is open to every user of this machine"));
  std::filesystem::permissions(member_ / "key.pem", std::filesystem::perms::others_read,
                               std::filesystem::perm_options::remove);
  test::Expire(member_, Fleet());
  EXPECT_THAT(Fault(), HasSubstr("cert.pem is not valid: certificate has expired"));
}

TEST_F(SecurityFiles, OfAnExistingFleetStayWhenMembersAreAdded) {
  const std::string before = TextOf(Fleet() / "robots" / "r1" / "cert.pem");
  const auto made = ChildProcess({CAIRN_MAKE_FLEET, Fleet().string(), "--robots", "r1,r9"}).Wait();
  EXPECT_EQ(made.exit_code, 0) << made.output;
  EXPECT_EQ(TextOf(Fleet() / "robots" / "r1" / "cert.pem"), before);
  member_ = Fleet() / "robots" / "r9";
  EXPECT_EQ(Fault(), "none");
  for (const char* name : {"-x", "a;b", "<b>", "../up", "a b"}) {
    const auto refused = ChildProcess({CAIRN_MAKE_FLEET, Fleet().string(), "--viewers", name}).Wait();
    EXPECT_EQ(refused.exit_code, 2) << name << ": " << refused.output;
  }
}

}  // namespace
}  // namespace cairn
