#include "common/options/config.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <exception>
#include <optional>
#include <set>
#include <sstream>

#include "common/file/atomic_file.h"
#include "common/options/option_fields.h"

namespace cairn {
namespace {

// Notes the line at which a document begins and ignores what is in it.
class DocumentStarts final : public YAML::EventHandler {
 public:
  [[nodiscard]] int line() const { return line_; }

  void OnDocumentStart(const YAML::Mark& mark) override { line_ = mark.line; }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}

 private:
  int line_ = 0;
};

constexpr std::size_t kMaxConfigBytes = 1u << 20;
// Aliases can make a small text an endless or exponentially large tree.
constexpr int kDeepest = 32;
constexpr std::size_t kMostValues = 10'000;
// PrintYaml writes most keys below this heading; their names do not contain it.
constexpr const char* kHeading = "expert";

// Collects the leaves of a YAML tree as assignments. Returns the first problem, or nothing.
class Flattening {
 public:
  explicit Flattening(std::string source) : source_(std::move(source)) {}

  std::string Take(const YAML::Node& node, const std::string& key, int depth) {
    if (depth > kDeepest || assignments_.size() > kMostValues) return Place(node) + ": nested too deeply or too large";
    if (node.IsNull()) return {};  // A text with nothing in it.
    if (node.IsSequence()) return Place(node) + ": " + (key.empty() ? "" : key + ": ") + "lists are not used here";
    if (node.IsScalar()) {
      if (key.empty()) return Place(node) + ": not a tree of keys and values";
      assignments_.push_back({Place(node), key, node.Scalar()});
      return {};
    }
    std::set<std::string> names;
    for (const auto& entry : node) {
      if (!entry.first.IsScalar()) return Place(entry.first) + ": a key must be a plain word";
      const std::string& name = entry.first.Scalar();
      const std::string full = key.empty() ? name : key + "." + name;
      const bool alone = entry.second.IsNull() || (entry.second.IsMap() && entry.second.size() == 0);
      // Once with and once without the heading is twice as well. Only a section may stand alone in several places.
      const bool again = entry.second.IsScalar() ? alone_.contains(full) || !given_.insert(full).second
                                                 : alone && given_.contains(full);
      if (!names.insert(name).second || again) return Place(entry.first) + ": " + full + ": given twice";
      if (depth == 0 && name == kHeading && !entry.second.IsScalar()) {
        if (std::string problem = Take(entry.second, "", depth + 1); !problem.empty()) return problem;
        continue;
      }
      if (alone) {
        alone_.insert(full);
        // The place of nothing would be that of the next token.
        assignments_.push_back({Place(entry.first), full, std::nullopt});
        continue;
      }
      if (std::string problem = Take(entry.second, full, depth + 1); !problem.empty()) return problem;
    }
    return {};
  }

  [[nodiscard]] const std::vector<Assignment>& assignments() const { return assignments_; }

 private:
  [[nodiscard]] std::string Place(const YAML::Node& node) const {
    const int line = node.Mark().line;
    return line < 0 ? source_ : source_ + ":" + std::to_string(line + 1);
  }

  std::string source_;
  std::vector<Assignment> assignments_;
  std::set<std::string> given_, alone_;  // Full keys with a value, and without one.
};

}  // namespace

std::optional<int> LineAfterFirstDocument(const std::string& text) {
  std::istringstream stream(text);
  YAML::Parser parser(stream);
  DocumentStarts starts;
  const bool follows = parser.HandleNextDocument(starts) && parser.HandleNextDocument(starts);
  return follows ? std::optional(starts.line()) : std::nullopt;
}

Result<void> ApplyYaml(const std::string& text, const std::string& source, const VisitOptions& visit) {
  Flattening flat(source);
  try {
    const std::string problem = flat.Take(YAML::Load(text), "", 0);
    if (!problem.empty()) return Fail(StatusCode::kInvalidArgument, problem);
    if (const auto line = LineAfterFirstDocument(text)) {
      return Fail(StatusCode::kInvalidArgument,
                  source + ":" + std::to_string(*line + 1) + ": a second document; all keys belong into one");
    }
  } catch (const YAML::Exception& error) {
    const int line = error.mark.line;
    return Fail(StatusCode::kInvalidArgument,
                source + (line < 0 ? "" : ":" + std::to_string(line + 1)) + ": not YAML: " + error.msg);
  } catch (const std::exception& error) {
    return Fail(StatusCode::kInvalidArgument, source + ": not YAML: " + error.what());
  }
  return Assign(flat.assignments(), visit);
}

Result<void> ApplyYamlFile(const std::filesystem::path& path, const VisitOptions& visit) {
  const auto bytes = ReadWholeFile(path, kMaxConfigBytes);
  if (!bytes) return tl::unexpected(bytes.error());
  return ApplyYaml(std::string(bytes->begin(), bytes->end()), path.string(), visit);
}

Result<void> ApplySet(const std::vector<std::string>& assignments, const VisitOptions& visit) {
  std::vector<Assignment> parsed;
  for (const std::string& assignment : assignments) {
    const std::size_t equals = assignment.find('=');
    if (equals == std::string::npos || equals == 0) {
      return Fail(StatusCode::kInvalidArgument, "--set: '" + assignment + "' is not key=value");
    }
    parsed.push_back({"--set", assignment.substr(0, equals), assignment.substr(equals + 1)});
  }
  return Assign(parsed, visit);
}

}  // namespace cairn
