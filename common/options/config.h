// Fills an options tree from YAML text and `key=value` overrides, prints it, and lists every key. All keys have
// defaults; an unknown key, a wrong type or a value out of range is an error that names source, line, full dotted key,
// the value and the allowed range, and suggests the nearest known key. So is a key alone, without a value: only a
// section may be empty (`slam:` with every line below it commented out). A file is one YAML document.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "common/options/option_visitor.h"
#include "common/status.h"

namespace cairn {

using VisitOptions = std::function<void(OptionVisitor&)>;

// `source` names the text in errors ("cairnd.yaml", "--set").
[[nodiscard]] Result<void> ApplyYaml(const std::string& text, const std::string& source, const VisitOptions& visit);
[[nodiscard]] Result<void> ApplyYamlFile(const std::filesystem::path& path, const VisitOptions& visit);
[[nodiscard]] Result<void> ApplySet(const std::vector<std::string>& assignments, const VisitOptions& visit);

// The whole tree as YAML with comments (meaning, unit, range); ApplyYaml reads it back to the same values.
[[nodiscard]] std::string PrintYaml(const VisitOptions& visit);

}  // namespace cairn
