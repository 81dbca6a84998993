// A file system for SQLite that fails on demand: it passes every call on to the real one until a fault is set. Sources:
// sqlite.org/vfs.html. Without shared memory, because the store locks its database for itself.
#pragma once

#include <sqlite3.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <string>

namespace cairn::server::testing {

enum class DiskFault { kNone, kFull, kWriteError, kSyncError, kReadOnly, kReadError };

class FaultyVfs {
 public:
  FaultyVfs() {
    real_ = sqlite3_vfs_find(nullptr);
    fault() = DiskFault::kNone;
    vfs_ = *real_;
    vfs_.iVersion = 1;
    vfs_.zName = kName;
    vfs_.szOsFile = static_cast<int>(sizeof(File)) + real_->szOsFile;
    vfs_.xOpen = [](sqlite3_vfs*, const char* name, sqlite3_file* file, int flags, int* out) {
      auto* const mine = reinterpret_cast<File*>(file);
      std::memset(mine, 0, sizeof(File));
      mine->real = reinterpret_cast<sqlite3_file*>(mine + 1);
      const int result = real_->xOpen(real_, name, mine->real, flags, out);
      if (result == SQLITE_OK) mine->base.pMethods = &Methods();
      return result;
    };
    sqlite3_vfs_register(&vfs_, 0);
  }
  ~FaultyVfs() { sqlite3_vfs_unregister(&vfs_); }
  FaultyVfs(const FaultyVfs&) = delete;
  FaultyVfs& operator=(const FaultyVfs&) = delete;

  static std::string name() { return kName; }
  void Set(DiskFault wanted) { fault() = wanted; }

 private:
  static constexpr const char* kName = "faulty";
  struct alignas(8) File {
    sqlite3_file base;
    sqlite3_file* real;
  };
  static std::atomic<DiskFault>& fault() {
    static std::atomic<DiskFault> set{DiskFault::kNone};
    return set;
  }
  static sqlite3_file* RealOf(sqlite3_file* file) { return reinterpret_cast<File*>(file)->real; }

  static int Write(sqlite3_file* file, const void* bytes, int count, sqlite3_int64 offset) {
    sqlite3_file* const to = RealOf(file);
    switch (fault()) {
      case DiskFault::kFull:
        // As a full disk does: a part of it is written.
        to->pMethods->xWrite(to, bytes, count / 2, offset);
        return SQLITE_FULL;
      case DiskFault::kWriteError:
        return SQLITE_IOERR_WRITE;
      case DiskFault::kReadOnly:
        return SQLITE_READONLY;
      case DiskFault::kNone:
      case DiskFault::kSyncError:
      case DiskFault::kReadError:
        break;
    }
    return to->pMethods->xWrite(to, bytes, count, offset);
  }
  static int Sync(sqlite3_file* file, int flags) {
    if (fault() == DiskFault::kSyncError) return SQLITE_IOERR_FSYNC;
    return RealOf(file)->pMethods->xSync(RealOf(file), flags);
  }

  static const sqlite3_io_methods& Methods() {
    static const sqlite3_io_methods methods = [] {
      sqlite3_io_methods m{};
      m.iVersion = 1;
      m.xClose = [](sqlite3_file* f) { return RealOf(f)->pMethods->xClose(RealOf(f)); };
      m.xRead = [](sqlite3_file* f, void* to, int n, sqlite3_int64 at) {
        if (fault() == DiskFault::kReadError) return SQLITE_IOERR_READ;
        return RealOf(f)->pMethods->xRead(RealOf(f), to, n, at);
      };
      m.xWrite = &Write;
      m.xTruncate = [](sqlite3_file* f, sqlite3_int64 size) { return RealOf(f)->pMethods->xTruncate(RealOf(f), size); };
      m.xSync = &Sync;
      m.xFileSize = [](sqlite3_file* f, sqlite3_int64* size) {
        return RealOf(f)->pMethods->xFileSize(RealOf(f), size);
      };
      m.xLock = [](sqlite3_file* f, int level) { return RealOf(f)->pMethods->xLock(RealOf(f), level); };
      m.xUnlock = [](sqlite3_file* f, int level) { return RealOf(f)->pMethods->xUnlock(RealOf(f), level); };
      m.xCheckReservedLock = [](sqlite3_file* f, int* out) {
        return RealOf(f)->pMethods->xCheckReservedLock(RealOf(f), out);
      };
      m.xFileControl = [](sqlite3_file* f, int what, void* with) {
        return RealOf(f)->pMethods->xFileControl(RealOf(f), what, with);
      };
      m.xSectorSize = [](sqlite3_file* f) { return RealOf(f)->pMethods->xSectorSize(RealOf(f)); };
      m.xDeviceCharacteristics = [](sqlite3_file* f) { return RealOf(f)->pMethods->xDeviceCharacteristics(RealOf(f)); };
      return m;
    }();
    return methods;
  }

  static inline sqlite3_vfs* real_ = nullptr;
  sqlite3_vfs vfs_{};
};

}  // namespace cairn::server::testing
