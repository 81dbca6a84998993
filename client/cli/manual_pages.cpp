#include "client/cli/manual_pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/file/atomic_file.h"
#include "common/version.h"

namespace cairn::client {
namespace {

// Text as roff shows it unchanged.
std::string Roff(std::string_view text) {
  std::string roff;
  for (const char c : text) {
    switch (c) {
      case '\\':
        roff += "\\e";
        break;
      case '-':
        roff += "\\-";
        break;
      case '`':
        roff += "\\(ga";
        break;
      case '\'':
        roff += "\\(aq";
        break;
      case '^':
        roff += "\\(ha";
        break;
      case '~':
        roff += "\\(ti";
        break;
      default:
        roff += c;
    }
  }
  // A dot at the beginning of a line would be a command.
  roff = CLI::detail::find_and_replace(std::move(roff), "\n.", "\n\\&.");
  return roff.starts_with('.') ? "\\&" + roff : roff;
}

// The same, where a long list without spaces may be broken after each comma.
std::string RoffList(std::string_view text) {
  return CLI::detail::find_and_replace(Roff(text), ",", ",\\:");
}

std::string Bold(std::string_view text) {
  return "\\fB" + Roff(text) + "\\fR";
}

// What stands below the options of `cairn COMMAND --help`.
struct Footer {
  std::vector<std::string> text;
  std::vector<std::string> examples;
};

Footer FooterOf(const CLI::App& app) {
  Footer footer;
  // Where a command says nothing of its own, CLI11 gives it the text of the command above it.
  const CLI::App* above = app.get_parent();
  if (above != nullptr && above->get_footer() == app.get_footer()) return footer;
  bool examples = false;
  for (const std::string& line : CLI::detail::split(app.get_footer(), '\n')) {
    if (line == "EXAMPLES" || line == "EXAMPLE") {
      examples = true;
    } else {
      (examples ? footer.examples : footer.text).push_back(line);
    }
  }
  return footer;
}

class Page {
 public:
  Page(const std::string& name, const std::string& description) {
    std::string title = name;
    std::ranges::transform(title, title.begin(),
                           [](unsigned char letter) { return static_cast<char>(std::toupper(letter)); });
    text_ = fmt::format(".TH \"{}\" 1 \"\" \"cairn {}\" \"User Commands\"\n", Roff(title), Roff(kVersion));
    Section("NAME");
    text_ += fmt::format("{} \\- {}\n", Roff(name), Roff(description));
  }

  void Section(const std::string& heading) { text_ += fmt::format(".SH \"{}\"\n", Roff(heading)); }
  void Part(const std::string& heading) { text_ += fmt::format(".SS \"{}\"\n", Roff(heading)); }
  // Lines of one paragraph. Those that are indented stay lines of their own.
  void Paragraph(const std::vector<std::string>& lines) {
    if (lines.empty()) return;
    text_ += ".PP\n";
    for (const std::string& line : lines) {
      if (line.starts_with(' ')) text_ += ".br\n";
      text_ += Roff(CLI::detail::trim_copy(line)) + "\n";
    }
  }
  // Lines that stay as they are.
  void Verbatim(const std::vector<std::string>& lines) {
    text_ += ".nf\n";
    for (const std::string& line : lines) text_ += Roff(CLI::detail::trim_copy(line)) + "\n";
    text_ += ".fi\n";
  }
  // `tag` is roff already.
  void Item(const std::string& tag, const std::string& description) {
    text_ += fmt::format(".TP\n{}\n{}\n", tag, description.empty() ? "\\&" : Roff(description));
  }
  void Options(const CLI::App& app) {
    const CLI::Formatter formatter;
    for (const bool positional : {true, false}) {
      for (const CLI::Option* option : app.get_options()) {
        const bool help = app.get_parent() != nullptr && option == app.get_help_ptr();
        if (help || option->get_group().empty() || option->get_positional() != positional) continue;
        Item(Bold(formatter.make_option_name(option, positional)) + RoffList(formatter.make_option_opts(option)),
             option->get_description());
      }
    }
    // Groups of options are commands without a name.
    for (const CLI::App* group : app.get_subcommands(IsGroup)) {
      if (group->get_require_option_min() == 1) Paragraph({"One of these is needed:"});
      Options(*group);
    }
  }

  static bool IsGroup(const CLI::App* app) { return app->get_name().empty(); }
  static bool IsCommand(const CLI::App* app) { return !app->get_name().empty(); }

  [[nodiscard]] std::string text() && { return std::move(text_); }

 private:
  std::string text_;
};

// What a command and its subcommands say, gathered in one walk.
void Describe(const CLI::App& app, const std::string& path, Page& page, std::vector<std::string>& examples) {
  const Footer footer = FooterOf(app);
  page.Paragraph(footer.text);
  examples.insert(examples.end(), footer.examples.begin(), footer.examples.end());
  page.Options(app);
  for (const CLI::App* command : app.get_subcommands(Page::IsCommand)) {
    const std::string name = path + " " + command->get_name();
    page.Part(name);
    page.Paragraph({command->get_description() + "."});
    Describe(*command, name, page, examples);
  }
}

// The command lines that there are: those of the subcommands where there are any.
void AddUsage(const CLI::App& app, const std::string& path, std::vector<std::string>& usage) {
  const auto commands = app.get_subcommands(Page::IsCommand);
  for (const CLI::App* command : commands) AddUsage(*command, path + " " + command->get_name(), usage);
  if (!commands.empty()) return;
  const std::string text = CLI::Formatter().make_usage(&app, path);
  usage.push_back(text.substr(text.find(path)));
}

void SeeAlso(Page& page, const std::vector<std::string>& names) {
  page.Section("SEE ALSO");
  std::string line;
  for (const std::string& name : names) line += (line.empty() ? "" : ", ") + name + "(1)";
  page.Paragraph({line + ", cairnd(8)"});
}

std::string CommandPage(const CLI::App& command) {
  const std::string path = "cairn " + command.get_name();
  Page page("cairn-" + command.get_name(), command.get_description());
  page.Section("SYNOPSIS");
  std::vector<std::string> usage, examples;
  AddUsage(command, path, usage);
  page.Verbatim(usage);
  page.Section("DESCRIPTION");
  page.Paragraph({"The options of cairn(1), such as --json and --domain, work here as well."});
  Describe(command, path, page, examples);
  if (!examples.empty()) {
    page.Section("EXAMPLES");
    page.Verbatim(examples);
  }
  SeeAlso(page, {"cairn"});
  return std::move(page).text();
}

std::string MainPage(const CLI::App& app) {
  Page page("cairn", "client of the mapping server cairnd");
  page.Section("SYNOPSIS");
  page.Verbatim({"cairn [OPTIONS] COMMAND"});
  page.Section("DESCRIPTION");
  page.Paragraph({app.get_description()});
  page.Section("OPTIONS");
  page.Options(app);
  page.Paragraph(CLI::detail::split(app.get_footer(), '\n'));
  page.Section("COMMANDS");
  page.Paragraph({"Each command has a page of its own, such as cairn-map(1)."});
  std::string chapter;
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands(Page::IsCommand)) {
    if (command->get_group() != chapter) page.Part(command->get_group());
    chapter = command->get_group();
    page.Item(Bold(command->get_name()), command->get_description());
    names.push_back("cairn-" + command->get_name());
  }
  SeeAlso(page, names);
  return std::move(page).text();
}

}  // namespace

std::vector<ManualPage> ManualPages(const CLI::App& app) {
  std::vector<ManualPage> pages = {{"cairn", MainPage(app)}};
  for (const CLI::App* command : app.get_subcommands(Page::IsCommand))
    pages.push_back({"cairn-" + command->get_name(), CommandPage(*command)});
  return pages;
}

Result<void> WriteManualPages(const CLI::App& app, const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) return Fail(StatusCode::kPermissionDenied, directory.string() + ": " + error.message());
  for (const ManualPage& page : ManualPages(app)) {
    if (auto written = WriteFileAtomically(directory / (page.name + ".1"), page.text); !written) return written;
  }
  return {};
}

}  // namespace cairn::client
