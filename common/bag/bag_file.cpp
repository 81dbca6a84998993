#include "common/bag/bag_file.h"

#include <array>
#include <fstream>
#include <system_error>

#include "common/bag/mcap_file.h"
#include "common/bag/mcap_records.h"
#include "common/bag/packed_file.h"
#include "common/bag/sqlite_file.h"

namespace cairn::bag {

FileKind KindOf(const std::filesystem::path& path) {
  constexpr std::string_view kSqliteMagic("SQLite format 3\0", 16), kZstdMagic = "\x28\xb5\x2f\xfd";
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return FileKind::kNone;
  std::array<char, 16> start{};
  std::ifstream file(path, std::ios::binary);
  file.read(start.data(), start.size());
  const std::string_view bytes(start.data(), static_cast<std::size_t>(file.gcount()));
  if (bytes.starts_with(kMcapMagic.substr(0, kMcapNameBytes))) return FileKind::kMcap;
  if (bytes == kSqliteMagic) return FileKind::kSqlite;
  return bytes.starts_with(kZstdMagic) ? FileKind::kZstd : FileKind::kNone;
}

Result<std::unique_ptr<File>> OpenFile(const std::filesystem::path& path) {
  switch (KindOf(path)) {
    case FileKind::kMcap:
      return OpenMcap(path);
    case FileKind::kSqlite:
      return OpenSqlite(path);
    case FileKind::kZstd:
      return OpenPacked(path);
    case FileKind::kNone:
      break;
  }
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return Fail(StatusCode::kNotFound, path.string() + ": no such file");
  return Fail(StatusCode::kInvalidArgument, path.string() + ": neither MCAP nor a database of SQLite");
}

}  // namespace cairn::bag
