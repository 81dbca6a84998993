#include "server/slam/checkpoint.h"

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <sstream>
#include <utility>

#include "common/file/checksum.h"
#include "common/file/number_bytes.h"
#include "common/options/number_text.h"

namespace cairn::slam {
namespace {

constexpr std::string_view kMagic = "CAIRNEST";
constexpr std::string_view kChecksum = " with the checksum ";  // Between a known map and its checksum.

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
    for (const double number : {line.a.x(), line.a.y(), line.b.x(), line.b.y()}) numbers += BytesOfNumber(number);
  return text + "slam.line_match.map" + std::string(kChecksum) + std::to_string(ChecksumOf(numbers)) + '\n';
}

using Values = std::map<std::string, std::string, std::less<>>;  // By key.

// The checksum of a known map is a value, too.
std::pair<std::string, std::string> KeyAndValue(const std::string& line) {
  const auto end = line.find(kChecksum);
  const auto key_end = end == std::string::npos ? line.find(' ') : end + kChecksum.size() - 1;
  return {line.substr(0, key_end), key_end == std::string::npos ? "" : line.substr(key_end + 1)};
}

Values ValuesOf(const std::string& text) {
  Values values;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) values.insert(KeyAndValue(line));
  return values;
}

// The first option that has another value there; nothing if there is none.
std::optional<Status> FirstDifference(const std::string& here, const Values& there) {
  static const Values kDefaults = ValuesOf(TextOf({}));
  const auto line = [](const std::string& key, const Values& values) {
    const auto found = values.find(key);
    return found == values.end() ? std::string("(nothing)") : key + ' ' + found->second;
  };
  const auto different = [](const std::string& our, const std::string& their) {
    return Status{StatusCode::kFailedPrecondition,
                  "the checkpoint was made with other options: there '" + their + "', here '" + our + "'"};
  };
  std::istringstream lines(here);
  for (std::string our; std::getline(lines, our);) {
    const std::string key = KeyAndValue(our).first;
    const std::string their = line(key, there.contains(key) ? there : kDefaults);
    if (our != their) return different(our, their);
  }
  // Of the keys that are there only, the one of a known map says that the estimator had one.
  const Values ours = ValuesOf(here);
  for (const auto& [key, value] : there)
    if (key.ends_with(kChecksum.substr(0, kChecksum.size() - 1)) && !ours.contains(key))
      return different("(nothing)", line(key, there));
  return std::nullopt;
}

// Gives every option the value that it has in the text, or its default.
class OptionReader final : public OptionVisitor {
 public:
  explicit OptionReader(const Values& values) : values_(values) {}
  void Section(std::string_view key, std::string_view /*help*/, const std::function<void()>& fields) override {
    const std::size_t outer = prefix_.size();
    prefix_ += std::string(key) + '.';
    fields();
    prefix_.resize(outer);
  }
  void Real(std::string_view key, double& value, std::string_view /*unit*/, double min, double max,
            const Help& /*help*/) override {
    ReadNumber(key, value, min, max);
  }
  void Integer(std::string_view key, std::int64_t& value, std::string_view /*unit*/, std::int64_t min, std::int64_t max,
               const Help& /*help*/) override {
    ReadNumber(key, value, min, max);
  }
  void Flag(std::string_view key, bool& value, const Help& /*help*/) override {
    const std::string* const text = Find(key);
    if (text == nullptr) return;
    value = *text == "true";
    if (!value && *text != "false") wrong_ = prefix_ + std::string(key);
  }
  void Text(std::string_view key, std::string& value, const Help& /*help*/) override {
    if (const std::string* const text = Find(key)) value = *text;
  }
  void Choice(std::string_view key, int& value, std::span<const std::string_view> names,
              const Help& /*help*/) override {
    const std::string* const text = Find(key);
    if (text == nullptr) return;
    const auto name = std::ranges::find(names, *text);
    if (name == names.end()) {
      wrong_ = prefix_ + std::string(key);
    } else {
      value = static_cast<int>(name - names.begin());
    }
  }
  // The last key whose value can not be read; empty if there is none.
  [[nodiscard]] const std::string& wrong() const { return wrong_; }

 private:
  [[nodiscard]] const std::string* Find(std::string_view key) const {
    const auto found = values_.find(prefix_ + std::string(key));
    return found == values_.end() ? nullptr : &found->second;
  }
  template <typename Number>
  void ReadNumber(std::string_view key, Number& value, Number min, Number max) {
    const std::string* const text = Find(key);
    if (text == nullptr) return;
    if (!ParseNumber(*text, value) || !(min <= value && value <= max)) wrong_ = prefix_ + std::string(key);
  }

  const Values& values_;
  std::string prefix_ = "slam.";
  std::string wrong_;
};

struct Parts {
  std::string options;
  OpenedCheckpoint opened;
};

Result<Parts> PartsOf(std::string_view bytes) {
  const auto damaged = [](const char* why) {
    return Fail(StatusCode::kDataLoss, std::string("the checkpoint is damaged: ") + why);
  };
  if (bytes.substr(0, kMagic.size()) != kMagic) return damaged("it does not begin as one");
  bytes.remove_prefix(kMagic.size());
  const auto format = TakeNumber<std::uint32_t>(bytes);
  if (!format) return damaged("it is too short");
  if (*format < kOldestCheckpointFormat || *format > kCheckpointFormat)
    return Fail(*format > kCheckpointFormat ? StatusCode::kUnimplemented : StatusCode::kFailedPrecondition,
                "the checkpoint has format " + std::to_string(*format) + ", this program reads " +
                    std::to_string(kOldestCheckpointFormat) + " to " + std::to_string(kCheckpointFormat));
  const auto checksum = TakeNumber<std::uint64_t>(bytes);
  if (!checksum || *checksum != ChecksumOf(bytes)) return damaged("its checksum is wrong");
  const auto length = TakeNumber<std::uint64_t>(bytes);
  if (!length || *length > bytes.size()) return damaged("it is too short");
  return Parts{std::string(bytes.substr(0, *length)), {bytes.substr(*length), *format}};
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
  std::string checked = BytesOfNumber(static_cast<std::uint64_t>(options_.size()));
  checked += options_;
  checked += state;
  std::string bytes(kMagic);
  bytes += BytesOfNumber(kCheckpointFormat);
  bytes += BytesOfNumber(ChecksumOf(checked));
  return bytes + checked;
}

Result<OpenedCheckpoint> OpenCheckpoint(std::string_view bytes, const MapperOptions& options) {
  const auto parts = PartsOf(bytes);
  if (!parts) return tl::unexpected(parts.error());
  const std::string here = TextOf(options);
  if (here == parts->options) return parts->opened;
  if (auto different = FirstDifference(here, ValuesOf(parts->options))) return tl::unexpected(std::move(*different));
  return parts->opened;
}

Result<MapperOptions> OptionsOf(std::string_view bytes, const MapperOptions& here) {
  const auto parts = PartsOf(bytes);
  if (!parts) return tl::unexpected(parts.error());
  const Values values = ValuesOf(parts->options);
  OptionReader reader(values);
  MapperOptions options;
  options.filter.line_match.map = here.filter.line_match.map;
  Visit(reader, options);
  if (!reader.wrong().empty())
    return Fail(StatusCode::kDataLoss, "the checkpoint is damaged: its options have no proper " + reader.wrong());
  if (auto valid = Validate(options); !valid) return tl::unexpected(valid.error());
  return options;
}

}  // namespace cairn::slam
