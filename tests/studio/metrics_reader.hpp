/// A strict reader of Prometheus' text 0.0.4 and of OpenMetrics 1.0, as far as Berth writes them, for tests. It shares
/// no code with the page.
#pragma once

#include <gtest/gtest.h>

#include <cctype>
#include <cstdlib>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace berth::test {

class MetricsPage {
 public:
  using Labels = std::map<std::string, std::string>;

  /// Throws std::runtime_error with the line that is none.
  explicit MetricsPage(std::string_view text, bool open = false) : open_(open) {
    bool over = false;
    while (!text.empty()) {
      const auto end = text.find('\n');
      if (end == std::string_view::npos) throw std::runtime_error("the last line does not end");
      if (over) throw std::runtime_error("something comes after # EOF");
      line_ = text.substr(0, end);
      text.remove_prefix(end + 1);
      over = open && line_ == "# EOF";
      if (!over) line_.starts_with('#') ? take_comment() : take_sample();
    }
    if (open && !over) throw std::runtime_error("# EOF is missing");
  }

  [[nodiscard]] const std::map<std::string, std::string>& types() const { return types_; }
  /// The value of the sample with exactly these labels; empty: there is none.
  [[nodiscard]] std::optional<double> value(const std::string& name, const Labels& labels = {}) const {
    const auto found = series_.find({name, labels});
    return found == series_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  [[noreturn]] void wrong(const std::string& what) const { throw std::runtime_error(what + ": " + std::string(line_)); }
  static bool is_name(std::string_view name) {
    if (name.empty() || std::isdigit(static_cast<unsigned char>(name[0])) != 0) return false;
    for (const char c : name)
      if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_') return false;
    return true;
  }
  void take_comment() {
    std::string_view rest = line_;
    const bool help = rest.starts_with("# HELP "), type = rest.starts_with("# TYPE ");
    if (!help && !type) wrong("neither HELP nor TYPE");
    rest.remove_prefix(7);
    const std::string name(rest.substr(0, rest.find(' ')));
    if (!is_name(name) || rest.size() <= name.size() + 1) wrong("no name, or nothing after it");
    rest.remove_prefix(name.size() + 1);
    if (help && !helped_.insert(name).second) wrong("a second HELP");
    if (help && rest.find('\\') != std::string_view::npos) wrong("HELP escapes something");
    if (help) return;
    if (helped_.count(name) == 0) wrong("TYPE before its HELP");
    if (rest != "counter" && rest != "gauge" && rest != "histogram") wrong("an unknown type");
    if (!types_.emplace(name, rest).second) wrong("a second TYPE");
    family_ = name;
  }
  std::string text_in_quotes(std::string_view& rest) const {
    if (!rest.starts_with('"')) wrong("a label's value is not in quotes");
    std::string out;
    for (std::size_t i = 1; i < rest.size(); ++i) {
      if (rest[i] == '"') {
        rest.remove_prefix(i + 1);
        return out;
      }
      if (rest[i] != '\\') {
        out += rest[i];
        continue;
      }
      const char next = ++i < rest.size() ? rest[i] : '\0';
      if (next != '\\' && next != '"' && next != 'n') wrong("an unknown escape");
      out += next == 'n' ? '\n' : next;
    }
    wrong("a label's value does not end");
  }
  void take_sample() {
    std::string_view rest = line_;
    struct {
      std::string name;
      Labels labels;
      double value = 0;
    } sample;
    sample.name = rest.substr(0, rest.find_first_of("{ "));
    if (!is_name(sample.name)) wrong("no name");
    rest.remove_prefix(sample.name.size());
    if (rest.starts_with('{')) {
      while (!rest.starts_with('}')) {
        rest.remove_prefix(1);
        const std::string label(rest.substr(0, rest.find('=')));
        if (!is_name(label)) wrong("no label");
        rest.remove_prefix(label.size() + 1);
        if (!sample.labels.emplace(label, text_in_quotes(rest)).second) wrong("a label comes twice");
        if (!rest.starts_with(',') && !rest.starts_with('}')) wrong("no comma");
      }
      rest.remove_prefix(1);
    }
    if (!rest.starts_with(' ')) wrong("no value");
    const std::string number(rest.substr(1));
    char* end = nullptr;
    sample.value = std::strtod(number.c_str(), &end);
    if (number.empty() || *end != '\0') wrong("the value is no number");
    if (!is_of_family(sample.name)) wrong("a sample of another metric than the one under way");
    if (!series_.emplace(std::pair(sample.name, sample.labels), sample.value).second) wrong("a sample comes twice");
  }
  bool is_of_family(const std::string& name) const {
    if (family_.empty()) return false;
    const std::string& type = types_.at(family_);
    if (type == "histogram")
      return name == family_ + "_bucket" || name == family_ + "_sum" || name == family_ + "_count";
    return name == (open_ && type == "counter" ? family_ + "_total" : family_);
  }

  bool open_;
  std::string_view line_;
  std::string family_;
  std::set<std::string> helped_;
  std::map<std::string, std::string> types_;
  std::map<std::pair<std::string, Labels>, double> series_;
};

}  // namespace berth::test
