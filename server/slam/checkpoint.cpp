#include "server/slam/checkpoint.h"

#include <cstring>
#include <functional>
#include <span>
#include <sstream>
#include <utility>

#include "common/file/checksum.h"
#include "common/options/number_text.h"

namespace cairn::slam {
namespace {

constexpr std::string_view kMagic = "CAIRNEST";

template <typename Number>
void AppendNumber(std::string& bytes, Number number) {
  bytes.append(reinterpret_cast<const char*>(&number), sizeof(number));
}

template <typename Number>
bool TakeNumber(std::string_view& bytes, Number& number) {
  if (bytes.size() < sizeof(number)) return false;
  std::memcpy(&number, bytes.data(), sizeof(number));
  bytes.remove_prefix(sizeof(number));
  return true;
}

// Writes every option as a line `key value`.
class OptionLines final : public OptionVisitor {
 public:
  void Section(std::string_view key, std::string_view /*help*/, const std::function<void()>& fields) override {
    const std::size_t outer = prefix_.size();
    prefix_ += std::string(key) + '.';
    fields();
    prefix_.resize(outer);
  }
  void Real(std::string_view key, double& value, std::string_view /*unit*/, double /*min*/, double /*max*/,
            const Help& /*help*/) override {
    Line(key, ExactText(value));
  }
  void Integer(std::string_view key, std::int64_t& value, std::string_view /*unit*/, std::int64_t /*min*/,
               std::int64_t /*max*/, const Help& /*help*/) override {
    Line(key, std::to_string(value));
  }
  void Flag(std::string_view key, bool& value, const Help& /*help*/) override { Line(key, value ? "true" : "false"); }
  void Text(std::string_view key, std::string& value, const Help& /*help*/) override { Line(key, value); }
  void Choice(std::string_view key, int& value, std::span<const std::string_view> names,
              const Help& /*help*/) override {
    Line(key, std::string(names[static_cast<std::size_t>(value)]));
  }
  [[nodiscard]] std::string text() && { return std::move(text_); }

 private:
  void Line(std::string_view key, const std::string& value) {
    text_ += prefix_ + std::string(key) + ' ' + value + '\n';
  }

  std::string prefix_ = "slam.";
  std::string text_;
};

std::string TextOf(MapperOptions options) {
  OptionLines lines;
  Visit(lines, options);
  std::string text = std::move(lines).text();
  if (!options.filter.line_match.map) return text;
  // A file may hold another map under the same name.
  std::string numbers;
  for (const MapLine& line : *options.filter.line_match.map)
    for (const double number : {line.a.x(), line.a.y(), line.b.x(), line.b.y()}) AppendNumber(numbers, number);
  return text + "slam.line_match.map with the checksum " + std::to_string(ChecksumOf(numbers)) + '\n';
}

// The first line that differs. REQUIRES: the texts are different.
Status Different(const std::string& here, const std::string& there) {
  std::istringstream ours(here), theirs(there);
  std::string our, their;
  do {
    if (!std::getline(ours, our)) our = "(nothing)";
    if (!std::getline(theirs, their)) their = "(nothing)";
  } while (our == their && (ours || theirs));
  return {StatusCode::kFailedPrecondition,
          "the checkpoint was made with other options: there '" + their + "', here '" + our + "'"};
}

}  // namespace

Checkpoint::Checkpoint(const MapperOptions& options, StateWriter state)
    : options_(TextOf(options)), state_(std::move(state)) {}

std::string Checkpoint::Bytes() const {
  return With(state_.Bytes());
}

std::string Checkpoint::Main() const {
  return With(state_.Main());
}

std::string Checkpoint::With(const std::string& state) const {
  std::string checked;
  AppendNumber(checked, static_cast<std::uint64_t>(options_.size()));
  checked += options_;
  checked += state;
  std::string bytes(kMagic);
  AppendNumber(bytes, kCheckpointFormat);
  AppendNumber(bytes, ChecksumOf(checked));
  return bytes + checked;
}

Result<std::string_view> OpenCheckpoint(std::string_view bytes, const MapperOptions& options) {
  const auto damaged = [](const char* why) {
    return Fail(StatusCode::kDataLoss, std::string("the checkpoint is damaged: ") + why);
  };
  if (bytes.substr(0, kMagic.size()) != kMagic) return damaged("it does not begin as one");
  bytes.remove_prefix(kMagic.size());
  std::uint32_t format = 0;
  std::uint64_t checksum = 0, length = 0;
  if (!TakeNumber(bytes, format)) return damaged("it is too short");
  if (format != kCheckpointFormat)
    return Fail(format > kCheckpointFormat ? StatusCode::kUnimplemented : StatusCode::kFailedPrecondition,
                "the checkpoint has format " + std::to_string(format) + ", this program reads " +
                    std::to_string(kCheckpointFormat));
  if (!TakeNumber(bytes, checksum) || checksum != ChecksumOf(bytes)) return damaged("its checksum is wrong");
  if (!TakeNumber(bytes, length) || length > bytes.size()) return damaged("it is too short");
  const std::string here = TextOf(options), there(bytes.substr(0, length));
  if (here != there) return tl::unexpected(Different(here, there));
  return bytes.substr(length);
}

}  // namespace cairn::slam
