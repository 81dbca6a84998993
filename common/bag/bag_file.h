// One file of a bag: messages on topics, as ROS 2 records them. Implementations: MCAP (mcap_file.h), SQLite
// (sqlite_file.h), and either of them packed as a whole (packed_file.h). A file may hold anything: damage ends in an
// error that says where, and neither memory nor time grow beyond a multiple of the file's length. Not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "common/status.h"

namespace cairn::bag {

struct Topic {
  std::string name;      // "/scan"
  std::string type;      // "sensor_msgs/msg/LaserScan"
  std::string encoding;  // "cdr"

  bool operator==(const Topic&) const = default;
};

inline constexpr std::size_t kMaxTopics = 4096;  // In one file. Robots have some hundreds at most.

class File {
 public:
  // The bytes are valid during the call. False: no more is wanted.
  using Sink = std::function<bool(std::size_t topic, std::string_view message)>;

  virtual ~File() = default;
  [[nodiscard]] virtual const std::vector<Topic>& topics() const = 0;
  // What the reader should know, such as that the file's end is missing.
  [[nodiscard]] virtual const std::vector<std::string>& notes() const = 0;
  // The messages of those topics (numbers in topics()), in the order of the time when they were recorded; what was
  // recorded at the same time, in the order of the file.
  [[nodiscard]] virtual Result<void> Read(const std::vector<std::size_t>& wanted, const Sink& sink) const = 0;
  // Lets go what the next Read can make again, such as an unpacked copy.
  virtual void LetGo() const {}
};

// What the first bytes of a regular file say.
enum class FileKind { kNone, kMcap, kSqlite, kZstd };
[[nodiscard]] FileKind KindOf(const std::filesystem::path& path);
// Reads the list of topics, and checks what can be checked before messages are read.
[[nodiscard]] Result<std::unique_ptr<File>> OpenFile(const std::filesystem::path& path);

}  // namespace cairn::bag
