#include "tests/studies/mapper_choice.h"

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>

#include "common/options/config.h"
#include "common/options/option_fields.h"

namespace cairn::studies {
namespace {

VisitOptions TreeOf(slam::MapperOptions& options) {
  return [&options](OptionVisitor& visitor) {
    visitor.Section("slam", "The estimator.", [&] { slam::Visit(visitor, options); });
  };
}

class ChoiceFinder final : public SectionVisitor {
 public:
  explicit ChoiceFinder(std::string key) : key_(std::move(key)) {}
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }

  void Real(std::string_view, double&, std::string_view, double, double, const Help&) override {}
  void Integer(std::string_view, std::int64_t&, std::string_view, std::int64_t, std::int64_t, const Help&) override {}
  void Flag(std::string_view, bool&, const Help&) override {}
  void Text(std::string_view, std::string&, const Help&) override {}
  void Choice(std::string_view key, int&, std::span<const std::string_view> names, const Help&) override {
    if (FullKey(key) == key_) names_.assign(names.begin(), names.end());
  }

 private:
  const std::string key_;
  std::vector<std::string> names_;
};

}  // namespace

Result<slam::MapperOptions> MapperWith(const std::vector<std::string>& assignments, std::uint64_t seed) {
  slam::MapperOptions options;
  if (auto applied = ApplySet(assignments, TreeOf(options)); !applied) return tl::unexpected<Status>(applied.error());
  options.seed = static_cast<std::int64_t>(seed);
  return options;
}

std::vector<std::string> ChoicesOf(const std::string& key) {
  slam::MapperOptions options;
  ChoiceFinder finder(key);
  TreeOf(options)(finder);
  return finder.names();
}

}  // namespace cairn::studies
