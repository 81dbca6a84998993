#include "common/bag/packed_file.h"

#include <fcntl.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "common/bag/mcap_file.h"
#include "common/bag/readable_file.h"
#include "common/bag/sqlite_file.h"

namespace cairn::bag {
namespace {

struct FreeStream {
  void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
};

// A temporary file, which is removed at the latest when this is destroyed.
class TemporaryFile {
 public:
  [[nodiscard]] static Result<std::unique_ptr<TemporaryFile>> Create() {
    std::error_code error;
    std::filesystem::path directory = std::filesystem::temp_directory_path(error);
    if (error) return Fail(StatusCode::kNotFound, "no directory for temporary files: " + error.message());
    std::string name = (directory / "cairn-unpacked-XXXXXX").string();
    const int file = mkostemp(name.data(), O_CLOEXEC);
    if (file < 0)
      return Fail(StatusCode::kPermissionDenied,
                  directory.string() + ": no temporary file can be made: " + std::generic_category().message(errno));
    return std::unique_ptr<TemporaryFile>(new TemporaryFile(std::move(directory), std::move(name), file));
  }
  ~TemporaryFile() {
    RemoveName();
    close(file_);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  [[nodiscard]] Result<void> Append(std::string_view bytes) const {
    while (!bytes.empty()) {
      const ssize_t written = write(file_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0)
        return Fail(StatusCode::kResourceExhausted, "it cannot be unpacked in " + directory_.string() + " (" +
                                                        std::generic_category().message(errno) +
                                                        "); TMPDIR=DIR before the command chooses another directory");
      bytes.remove_prefix(static_cast<std::size_t>(written));
    }
    return {};
  }
  void RemoveName() {
    if (!name_.empty()) unlink(name_.c_str());
    name_.clear();
  }

  [[nodiscard]] std::filesystem::path name() const { return name_; }
  // A name by which this process can open it as long as this object lives.
  [[nodiscard]] std::filesystem::path name_of_descriptor() const { return "/proc/self/fd/" + std::to_string(file_); }

 private:
  TemporaryFile(std::filesystem::path directory, std::string name, int file)
      : directory_(std::move(directory)), name_(std::move(name)), file_(file) {}

  const std::filesystem::path directory_;
  std::string name_;  // Empty once it has none.
  const int file_;
};

Result<void> UnpackInto(const TemporaryFile& unpacked, const std::filesystem::path& packed,
                        const PackedLimits& limits) {
  const auto file = ReadableFile::Open(packed);
  if (!file) return tl::unexpected(file.error());
  const auto fail = [&](StatusCode code, const std::string& why) { return Fail(code, packed.string() + ": " + why); };
  const std::unique_ptr<ZSTD_DStream, FreeStream> stream(ZSTD_createDStream());
  if (stream == nullptr) return fail(StatusCode::kResourceExhausted, "no memory for zstd");
  std::string output(ZSTD_DStreamOutSize(), '\0');
  const std::uint64_t most = std::max(limits.bytes, limits.times_length * file->size());
  std::uint64_t offset = 0, bytes = 0;
  std::size_t open = 1;
  while (offset < file->size()) {
    const auto stored = file->Read(
        offset, static_cast<std::size_t>(std::min<std::uint64_t>(ZSTD_DStreamInSize(), file->size() - offset)));
    if (!stored) return fail(stored.error().code, stored.error().message);
    offset += stored->size();
    ZSTD_inBuffer in{stored->data(), stored->size(), 0};
    bool more = true;
    while (more) {
      ZSTD_outBuffer out{output.data(), output.size(), 0};
      open = ZSTD_decompressStream(stream.get(), &out, &in);
      if (ZSTD_isError(open) != 0) return fail(StatusCode::kDataLoss, std::string("zstd: ") + ZSTD_getErrorName(open));
      bytes += out.pos;
      if (bytes > most)
        return fail(StatusCode::kResourceExhausted, "it unpacks to more than " + std::to_string(most >> 20) +
                                                        " MiB; unpack it first: unzstd " + packed.string());
      if (auto written = unpacked.Append(std::string_view(output.data(), out.pos)); !written)
        return fail(written.error().code, written.error().message);
      // Where a buffer was filled, there may be more. At the end of a frame there is not, and the next call would begin
      // another frame.
      more = in.pos < in.size || (open != 0 && out.pos == out.size);
    }
  }
  if (open != 0) return fail(StatusCode::kDataLoss, "zstd: the end is missing");
  return {};
}

class PackedFile : public File {
 public:
  PackedFile(std::filesystem::path path, const PackedLimits& limits) : path_(std::move(path)), limits_(limits) {}

  Result<void> ReadTopics() {
    if (auto opened = OpenCopy(); !opened) return opened;
    topics_ = copy_->topics();
    for (const std::string& note : copy_->notes()) notes_.push_back(WithOwnName(note));
    return {};
  }

  [[nodiscard]] const std::vector<Topic>& topics() const override { return topics_; }
  [[nodiscard]] const std::vector<std::string>& notes() const override { return notes_; }

  [[nodiscard]] Result<void> Read(const std::vector<std::size_t>& wanted, const Sink& sink) const override {
    if (auto opened = OpenCopy(); !opened) return opened;
    if (copy_->topics() != topics_)
      return Fail(StatusCode::kDataLoss, path_.string() + ": it has changed while it was read");
    auto read = copy_->Read(wanted, sink);
    if (!read) return Fail(read.error().code, WithOwnName(read.error().message));
    return read;
  }

  void LetGo() const override {
    copy_.reset();
    unpacked_.reset();
  }

 private:
  // Unpacks the file, unless that is done.
  Result<void> OpenCopy() const {
    if (copy_ != nullptr) return {};
    auto made = TemporaryFile::Create();
    if (!made) return Fail(made.error().code, path_.string() + ": " + made.error().message);
    unpacked_ = *std::move(made);
    if (auto done = UnpackInto(*unpacked_, path_, limits_); !done) return done;
    auto opened = Open(*unpacked_);
    if (!opened) return Fail(opened.error().code, WithOwnName(opened.error().message));
    copy_ = *std::move(opened);
    unpacked_->RemoveName();
    return {};
  }

  [[nodiscard]] static Result<std::unique_ptr<File>> Open(const TemporaryFile& unpacked) {
    // Of a file in a file, each could unpack to a thousand times its length.
    constexpr McapLimits kLimits = {.times_length = 10};
    switch (KindOf(unpacked.name())) {
      case FileKind::kMcap:
        return OpenMcap(unpacked.name_of_descriptor(), kLimits);
      case FileKind::kSqlite:
        return OpenSqlite(unpacked.name(), SqliteUse::kKeepOpen);  // It opens no file without a name.
      case FileKind::kZstd:
      case FileKind::kNone:
        break;
    }
    return Fail(StatusCode::kInvalidArgument,
                unpacked.name().string() + ": neither MCAP nor a database of SQLite is in it");
  }

  // What is said of the copy is said of the file.
  [[nodiscard]] std::string WithOwnName(const std::string& text) const {
    const std::size_t name = text.find(": ");
    return path_.string() + (name == std::string::npos ? ": " + text : ", unpacked" + text.substr(name));
  }

  const std::filesystem::path path_;
  const PackedLimits limits_;
  std::vector<Topic> topics_;
  std::vector<std::string> notes_;
  // The copy goes before the file in which it is.
  mutable std::unique_ptr<TemporaryFile> unpacked_;
  mutable std::unique_ptr<File> copy_;
};

}  // namespace

Result<std::unique_ptr<File>> OpenPacked(const std::filesystem::path& path, const PackedLimits& limits) {
  auto file = std::make_unique<PackedFile>(path, limits);
  if (auto read = file->ReadTopics(); !read) return tl::unexpected(read.error());
  return file;
}

}  // namespace cairn::bag
