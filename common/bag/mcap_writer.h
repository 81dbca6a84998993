// Writes MCAP files with everything by which readers seek: chunks compressed with zstd, checksums, indexes of messages
// and of chunks, statistics and a summary. What is in a chunk that has ended stays readable whatever happens
// afterwards: a file without its end is read up to its last whole chunk (mcap_file.h). The file is not flushed to the
// disk before Finish. Not thread-safe. Source: the MCAP specification, version 0 (mcap.dev/spec).
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/bag/mcap_records.h"
#include "common/status.h"

namespace cairn::bag {

struct McapWriterOptions {
  bool overwrite = false;  // A file that exists is an error without this.
  // A chunk ends when its records have so many bytes. Larger chunks pack better; smaller ones lose less with a program
  // that is killed.
  std::uint64_t chunk_bytes = std::uint64_t{1} << 20;
};

class McapWriter {
 public:
  // kAlreadyExists: there is such a file.
  [[nodiscard]] static Result<std::unique_ptr<McapWriter>> Create(const std::filesystem::path& path,
                                                                  const McapWriterOptions& options = {});
  ~McapWriter();  // A file that was not finished has no end.
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  // Both return the number by which the following calls name it. kResourceExhausted: there are too many.
  [[nodiscard]] Result<std::uint16_t> AddSchema(std::string_view name, std::string_view encoding,
                                                std::string_view content);
  [[nodiscard]] Result<std::uint16_t> AddChannel(std::uint16_t schema, std::string_view topic,
                                                 std::string_view encoding);

  // Times are nanoseconds since 1970. If the file cannot be written (kResourceExhausted: the disk is full), it gets its
  // end behind the chunks that are whole, if there is room for it; then every call returns the same error.
  [[nodiscard]] Result<void> Write(std::uint16_t channel, std::uint64_t log_time, std::uint64_t publish_time,
                                   std::string_view message);
  // Makes what was written readable: ends the chunk. Without messages in it, does nothing.
  [[nodiscard]] Result<void> EndChunk();
  // Ends the file, and flushes it to the disk. Nothing can be written afterwards.
  [[nodiscard]] Result<void> Finish();

  [[nodiscard]] std::uint64_t bytes() const { return end_; }  // Of the file, without the chunk that has not ended.
  [[nodiscard]] std::uint64_t messages() const { return messages_; }

 private:
  struct ChunkPlace {
    std::uint64_t start = 0, length = 0;  // Of the chunk's record in the file.
    std::uint64_t first_time = 0, last_time = 0;
    std::uint64_t stored_bytes = 0, bytes = 0;
    std::uint64_t index_bytes = 0;
    std::vector<std::pair<std::uint16_t, std::uint64_t>> indexes = {};  // Of each channel: where its index begins.
  };
  using MessagePlace = std::pair<std::uint64_t, std::uint64_t>;  // Time, and offset in the chunk's records.

  McapWriter(std::filesystem::path path, int file, const McapWriterOptions& options);
  // Appends to the file. If that fails, cuts off what was written in part, and writes the end.
  [[nodiscard]] Result<void> Append(std::string_view bytes);
  [[nodiscard]] int TryAppend(std::string_view bytes);  // An error number, or 0.
  [[nodiscard]] std::string EndOfFile() const;

  const std::filesystem::path path_;
  const int file_;
  const McapWriterOptions options_;
  Status error_;  // Of the first failure.
  std::uint64_t end_ = 0;
  std::uint32_t checksum_ = 0;  // Of the file so far.

  std::vector<std::string> schemas_;   // Their records; number 1 is the first.
  std::vector<std::string> channels_;  // Likewise, from 0.
  std::vector<std::uint64_t> counts_;  // Messages of each channel.
  std::uint64_t messages_ = 0;
  std::vector<ChunkPlace> chunks_;

  // The chunk that has not ended.
  std::string records_;
  std::uint64_t first_time_ = 0, last_time_ = 0;
  std::map<std::uint16_t, std::vector<MessagePlace>> places_;
};

}  // namespace cairn::bag
