#include "man.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <string_view>

namespace berth::cli {
namespace {

// Text as troff takes it literally: it would make a hyphen of a minus, typographic marks of some others, and a request
// of a line that begins with a dot.
std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '\\': out += "\\e"; break;
      case '-': out += "\\-"; break;
      case '\'': out += "\\(aq"; break;
      case '`': out += "\\(ga"; break;
      case '^': out += "\\(ha"; break;
      case '~': out += "\\(ti"; break;
      case '"': out += "\\(dq"; break;
      case '.':
        if (out.empty()) out += "\\&";
        out += c;
        break;
      default: out += c;
    }
  }
  return out;
}

// The same in prose, where a hyphen between letters is one.
std::string prose(std::string_view text) {
  std::string out = escaped(text);
  for (auto at = out.find("\\-"); at != std::string::npos; at = out.find("\\-", at + 1)) {
    const bool within = at > 0 && std::isalpha(static_cast<unsigned char>(out[at - 1])) != 0 && at + 2 < out.size() &&
                        std::isalpha(static_cast<unsigned char>(out[at + 2])) != 0;
    if (within) out.erase(at, 1);
  }
  return out;
}

std::string bold(const std::string& text) { return "\\fB" + escaped(text) + "\\fR"; }
std::string italic(const std::string& text) { return "\\fI" + escaped(text) + "\\fR"; }

std::string page_name(const VerbText& verb) {
  std::string name = verb.path;
  std::ranges::replace(name, ' ', '-');
  return name;
}

std::string sentence(std::string text) {
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

std::string synopsis(const VerbText& verb) {
  std::string line = bold(verb.path);
  std::string words;
  bool options = false;
  for (const auto& word : verb.words) {
    if (word.positional) {
      const std::string name = word.choices.empty() ? italic(word.value) : escaped(word.value);
      const bool bracketed = word.required || word.value.starts_with('[');
      words += bracketed ? " " + name : " [" + name + "]";
    } else if (word.required) {
      line += " " + bold(word.names.front()) + " " + italic(word.value);
    } else {
      options = true;
    }
  }
  if (options) line += " [" + italic("option") + "]...";
  if (!verb.verbs.empty()) words += verb.needs_verb ? " " + italic("command") : " [" + italic("command") + "]";
  return line + words + "\n";
}

// "Examples:" with the indented lines below it, and what else the help ends with, which the page has in sections of its
// own.
struct Footer {
  std::string examples;
  std::string notes;

  explicit Footer(const std::string& text) {
    std::istringstream lines(text);
    bool status = false;
    for (std::string line; std::getline(lines, line);) {
      if (line == "Examples:" || line == "Example:") continue;
      status = status || line.starts_with("Exit status:");
      if (line.starts_with("  ")) {
        examples += escaped(line.substr(2)) + "\n";
      } else if (!status && !line.empty()) {
        notes += prose(line) + "\n";
      }
    }
  }
};

std::string alternatives(const VerbText& verb) {
  std::string names;
  for (const auto& word : verb.words) {
    if (word.alternative) names += (names.empty() ? "" : ", ") + bold(word.names.front());
  }
  return names;
}

void add_words(const VerbText& verb, std::string& page) {
  const auto section = [&](const char* title, bool positional) {
    bool any = false;
    for (const auto& word : verb.words) {
      if (word.positional != positional) continue;
      if (!any) page += fmt::format(".SH {}\n", title);
      any = true;
      std::string left;
      for (const auto& name : word.names) left += (left.empty() ? "" : ", ") + bold(name);
      if (positional) left = italic(word.value);
      if (!positional && !word.value.empty()) left += " " + italic(word.value);
      page += ".TP\n" + left + "\n" + prose(sentence(word.help)) + "\n";
      if (word.alternative) page += fmt::format("One of {} is required.\n", alternatives(verb));
      if (word.required && !positional) page += "Required.\n";
    }
  };
  section("ARGUMENTS", true);
  section("OPTIONS", false);
}

void add_verbs(const VerbText& verb, std::string& page) {
  if (verb.verbs.empty()) return;
  page += ".SH COMMANDS\n";
  for (const auto& below : verb.verbs) {
    page += fmt::format(".TP\n.BR {} (1)\n{}\n", escaped(page_name(below)), prose(sentence(below.help)));
  }
}

// The verb above, and the first page.
void add_related(const VerbText& verb, std::string& page) {
  page += ".SH SEE ALSO\n";
  const auto last = verb.path.rfind(' ');
  if (last == std::string::npos) {
    page += ".BR candump (1),\n.BR ip (8)\n.PP\nThe manual: /usr/share/doc/berth, or docs/ of the source.\n";
    return;
  }
  std::string above = verb.path.substr(0, last);
  std::ranges::replace(above, ' ', '-');
  page += fmt::format(".BR {} (1){}\n", escaped(above), above == "berth" ? "" : ",\n.BR berth (1)");
}

}  // namespace

ManPage man_page(const VerbText& verb, const std::string& date) {
  const std::string name = page_name(verb);
  std::string title = name;
  std::ranges::transform(title, title.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  std::string page = fmt::format(".TH \"{}\" 1 \"{}\" \"berth {}\" \"Berth\"\n", escaped(title), date, BERTH_VERSION);
  const std::string help = verb.help.ends_with('.') ? verb.help.substr(0, verb.help.size() - 1) : verb.help;
  page += fmt::format(".SH NAME\n{} \\- {}\n.SH SYNOPSIS\n{}", escaped(name), prose(help), synopsis(verb));
  const Footer footer(verb.footer);
  page += ".SH DESCRIPTION\n" + prose(sentence(verb.help)) + "\n";
  if (!footer.notes.empty()) page += ".PP\n" + footer.notes;
  add_verbs(verb, page);
  add_words(verb, page);
  page +=
      ".SH EXIT STATUS\n.TP\n0\nDone.\n.TP\n1\nThe answer is no: a slot is not operational, a device refused.\n"
      ".TP\n2\nWrong usage, or a file that cannot be read.\n.TP\n3\nThe bus or a file failed.\n";
  if (!footer.examples.empty()) page += ".SH EXAMPLES\n.EX\n" + footer.examples + ".EE\n";
  add_related(verb, page);
  return {name, page};
}

std::vector<ManPage> man_pages(const VerbText& verb, const std::string& date) {
  std::vector<ManPage> pages{man_page(verb, date)};
  for (const auto& below : verb.verbs) {
    for (auto& page : man_pages(below, date)) pages.push_back(std::move(page));
  }
  return pages;
}

}  // namespace berth::cli
