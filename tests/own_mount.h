// Mounts for one test, which nobody else on the machine sees: the thread that makes one gets a mount namespace of its
// own, and so does what it starts from then on. Only where the user may do that (CAP_SYS_ADMIN).
#pragma once

#include <sched.h>
#include <sys/mount.h>

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

namespace cairn::test {

class OwnMount {
 public:
  // An empty disk of this size over the directory. Null: not permitted.
  static std::unique_ptr<OwnMount> Disk(const std::filesystem::path& directory, std::size_t bytes) {
    const std::string size = "size=" + std::to_string(bytes);
    if (!OwnNamespace() || mount("disk", directory.c_str(), "tmpfs", 0, size.c_str()) != 0) return nullptr;
    return std::unique_ptr<OwnMount>(new OwnMount(directory));
  }
  // The directory with what is in it, which nobody can change, not even root. Null: not permitted.
  static std::unique_ptr<OwnMount> ReadOnly(const std::filesystem::path& directory) {
    if (!OwnNamespace() || mount(directory.c_str(), directory.c_str(), nullptr, MS_BIND, nullptr) != 0) return nullptr;
    std::unique_ptr<OwnMount> own(new OwnMount(directory));
    if (mount(nullptr, directory.c_str(), nullptr, MS_REMOUNT | MS_BIND | MS_RDONLY, nullptr) != 0) return nullptr;
    return own;
  }
  ~OwnMount() { umount2(directory_.c_str(), MNT_DETACH); }
  OwnMount(const OwnMount&) = delete;
  OwnMount& operator=(const OwnMount&) = delete;

 private:
  explicit OwnMount(std::filesystem::path directory) : directory_(std::move(directory)) {}
  static bool OwnNamespace() {
    return unshare(CLONE_NEWNS) == 0 && mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0;
  }

  const std::filesystem::path directory_;
};

}  // namespace cairn::test
