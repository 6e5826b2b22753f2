/// The layout of `--help`: 80 columns, and of each option only what the user writes. Included by verb.cpp alone.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>

namespace berth::cli {

class HelpFormat final : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool positional) const override {
    const std::string value = value_of(*option);
    std::string left = make_option_name(option, positional);
    if (positional) left = value.empty() ? left : value;
    if (!positional && !value.empty()) left += " " + value;
    return row(left, option->get_description());
  }
  std::string make_subcommand(const CLI::App* sub) const override {
    return row(sub->get_name(), sub->get_description());
  }
  std::string make_description(const CLI::App* app) const override { return wrapped(app->get_description(), 0) + "\n"; }
  std::string make_usage(const CLI::App* app, std::string name) const override {
    std::string usage = CLI::Formatter::make_usage(app, std::move(name));
    usage.pop_back();
    return wrapped(usage, 7) + "\n";
  }
  std::string make_option_usage(const CLI::Option* option) const override {
    std::string name = option->get_option_text();
    if (name.empty()) name = make_option_name(option, true);
    const bool bracketed = name.starts_with('[');
    return option->get_required() || bracketed ? name : "[" + name + "]";
  }
  // A group of options, one of which is required.
  std::string make_expanded(const CLI::App* group) const override {
    std::string text = "\nOne of these:\n";
    const auto own = [group](const CLI::Option* o) { return o->nonpositional() && o != group->get_help_ptr(); };
    for (const auto* const option : group->get_options(own)) {
      text += make_option(option, false);
    }
    return text;
  }

  /// Placeholder of its value; empty: it has none, or is a positional word with no other than its name.
  // "TEXT:TIME" is a text that is parsed as a time; "UINT:UINT in [1 - 9]" a number.
  static std::string value_of(const CLI::Option& option) {
    if (!option.get_option_text().empty()) return option.get_option_text();
    if (option.get_type_size() == 0) return {};
    if (option.get_positional()) return {};
    const std::string type = option.get_type_name();
    if (type.find(" in [") != std::string::npos || type == "UINT" || type == "INT") return "N";
    const auto kind = type.substr(type.find(':') + 1);
    if (!kind.starts_with('{')) return kind;
    std::string words = kind.substr(1, kind.size() - 2);
    std::ranges::replace(words, ',', '|');
    return words;
  }

 private:
  static constexpr std::size_t columns = 80;
  static constexpr std::size_t margin = 28;

  static std::string row(const std::string& left, const std::string& right) {
    std::string line = "  " + left;
    if (line.size() + 2 > margin) {
      line += "\n" + std::string(margin, ' ');
    } else {
      line.resize(margin, ' ');
    }
    const std::string rest = wrapped(std::string(margin, ' ') + right, margin);
    return line + rest.substr(std::min(margin, rest.size())) + "\n";
  }
  // Breaks longer lines at a space; they continue after `indent` spaces.
  static std::string wrapped(const std::string& text, std::size_t indent) {
    std::string out;
    std::string line = text;
    while (width(line) > columns) {
      auto at = line.rfind(' ', bytes_of(line, columns));
      if (at == std::string::npos || at <= indent) break;
      out += line.substr(0, at) + "\n";
      line = std::string(indent, ' ') + line.substr(at + 1);
    }
    return out + line;
  }
  static bool begins(char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }
  static std::size_t width(const std::string& line) {
    return static_cast<std::size_t>(std::ranges::count_if(line, begins));
  }
  static std::size_t bytes_of(const std::string& line, std::size_t count) {
    std::size_t at = 0;
    for (; at < line.size(); ++at) {
      if (begins(line[at]) && count-- == 0) break;
    }
    return at;
  }
};

}  // namespace berth::cli
