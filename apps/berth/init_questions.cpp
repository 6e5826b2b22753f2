// `berth init` on a terminal: the questions to the user.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "ask.hpp"
#include "berth/design/machine.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/text/quantity.hpp"
#include "init.hpp"
#include "ports.hpp"

namespace berth::cli {
namespace {

namespace fs = std::filesystem;

Failure nothing_written() { return failure(Exit::no, "nothing was written"); }

// Expands "~/drive.eds" as a shell does.
std::string at_home(const std::string& word) {
  const char* const home = std::getenv("HOME");
  const bool named = word.starts_with("~/") && home != nullptr && *home != '\0';
  return named ? home + word.substr(1) : word;
}

/// The user's answer, or `usual` for Enter alone. Asks again while `wrong` returns a problem.
tl::expected<std::string, Failure> answer(Interrupt& interrupt, const std::string& question, const std::string& usual,
                                          const std::function<std::string(const std::string&)>& wrong) {
  for (;;) {
    auto line = ask_line(usual.empty() ? question + ":" : fmt::format("{} [{}]:", question, usual), interrupt);
    if (!line) {
      print_line("");
      return tl::unexpected(nothing_written());
    }
    if (line->empty()) line = usual;
    line = at_home(*line);
    const auto why = wrong(*line);
    if (why.empty()) return *line;
    print_line("  " + why);
  }
}

bool is_file(const std::string& word) {
  std::error_code none;
  return fs::is_regular_file(word, none);
}

std::string no_name(const std::string& name) {
  return design::good_name(name) ? "" : std::string("this is not a name; ") + design::name_fix;
}

std::string no_bit_rate(const std::string& word) {
  static constexpr std::array<std::string_view, 8> rates{"10000",  "20000",  "50000",  "125000",
                                                         "250000", "500000", "800000", "1000000"};
  return std::ranges::find(rates, word) != rates.end() ? "" : fmt::format("one of {}", fmt::join(rates, ", "));
}

void tell_descriptions_here() {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(".", error)) {
    auto ending = entry.path().extension().string();
    std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (ending == ".eds" || ending == ".xdd") names.push_back(entry.path().filename().string());
  }
  std::ranges::sort(names);
  constexpr std::size_t most = 12;
  const auto left_out = names.size() > most ? names.size() - most : 0;
  names.resize(names.size() - left_out);
  for (const auto& name : names) print_line("  " + name);
  if (left_out > 0) print_line(fmt::format("  and {} more", left_out));
}

// Reported at once, not after all questions. `berth eds check` has the whole list.
std::string unusable(const std::string& file) {
  const auto reading = eds::read_any_file(file);
  if (reading.usable()) return {};
  const auto first = std::ranges::find(reading.findings, Finding::Severity::error, &Finding::severity);
  return fmt::format("this cannot be used: {}; `berth eds check` shows more",
                     first == reading.findings.end() ? "it is not a description" : first->message);
}

tl::expected<void, Failure> take_description(InitOptions& init, const std::string& file, Interrupt& interrupt) {
  const auto count = answer(interrupt, "  how many of it", "1", [](const std::string& word) {
    const auto number = text::parse_ranges(word, 1, 126);
    return number && number->size() == 1 ? "" : "a number from 1 to 126";
  });
  if (!count) return tl::unexpected(count.error());
  init.eds.push_back(file + ":" + *count);
  return {};
}

tl::expected<void, Failure> take_port(Options& options, const std::string& word, Interrupt& interrupt) {
  const auto port = port_of_word(word);
  if (!port) return tl::unexpected(failure(Exit::usage, port.error()));
  options.ports = {word};
  const auto kind = port->kind;
  if (kind == can::PortKind::slcan && !options.bit_rate) {
    const auto rate = answer(interrupt, "Bit rate of the bus", "125000", no_bit_rate);
    if (!rate) return tl::unexpected(rate.error());
    options.bit_rate = static_cast<unsigned>(std::stoul(*rate));
  }
  if (kind != can::PortKind::plant || !options.bus.empty()) return {};
  const auto bus = answer(interrupt, "Name of the bus", "field", no_name);
  if (!bus) return tl::unexpected(bus.error());
  options.bus = *bus;
  return {};
}

tl::expected<void, Failure> ask_sources(Options& options, InitOptions& init, Interrupt& interrupt) {
  for (;;) {
    const bool first = init.eds.empty();
    const auto word = answer(interrupt, first ? "Description, or port" : "Another description (Enter: no more)", "",
                             [&](const std::string& said) -> std::string {
                               if (is_file(said)) return unusable(said);
                               if (const auto file = file_of_counted(said); !file.empty()) return unusable(file);
                               if (said.empty() && !first) return {};
                               if (said.empty())
                                 return "a file (drive.eds, or drive.eds:4 for four), or a port (can0, /dev/ttyACM0)";
                               if (first && port_of_word(said)) return {};
                               return first ? "there is no such file, and this is not a port" : "there is no such file";
                             });
    if (!word) return tl::unexpected(word.error());
    if (word->empty()) return {};
    if (!file_of_counted(*word).empty()) {
      init.eds.push_back(*word);
      continue;
    }
    if (!is_file(*word)) return take_port(options, *word, interrupt);
    if (auto taken = take_description(init, *word, interrupt); !taken) return taken;
  }
}

// One "yes" permits replacing all existing files.
tl::expected<void, Failure> ask_to_replace(const Options& options, InitOptions& init, Interrupt& interrupt) {
  if (init.force || options.dry_run) return {};
  std::vector<std::string> there;
  for (const auto& path : {init.file, init.plant}) {
    std::error_code none;
    if (fs::exists(fs::symlink_status(path, none))) there.push_back(path);
  }
  if (there.empty()) return {};
  const bool one = there.size() == 1;
  const std::string question = fmt::format("{} {} there already. Replace {}?", fmt::join(there, " and "),
                                           one ? "is" : "are", one ? "it" : "them");
  if (!ask_yes(question, interrupt)) return tl::unexpected(nothing_written());
  init.force = true;
  return {};
}

}  // namespace

tl::expected<void, Failure> ask_for_machine(Options& options, InitOptions& init, Interrupt& interrupt) {
  print_line("A machine is made from device descriptions (EDS, DCF, XDD, XDC), or from a bus");
  print_line("that is there: every device that answers gets a slot. Ctrl-C ends this.");
  std::error_code none;
  const std::string usual = init.file.empty() ? "berth.toml" : init.file;
  const bool there = fs::exists(fs::symlink_status(usual, none));
  if (there && !init.force)
    print_line(usual + " is there already: name another file, or Berth asks before it replaces this one.");
  tell_descriptions_here();
  if (auto asked = ask_sources(options, init, interrupt); !asked) return asked;
  if (init.file.empty()) {
    const auto file = answer(interrupt, "Machine file to write", "berth.toml", [](const std::string& word) {
      const auto wrong = init_file_problem(word);
      return wrong.empty() ? init_folder_problem(word) : wrong + ": NAME.toml";
    });
    if (!file) return tl::unexpected(file.error());
    init.file = *file;
  }
  if (init.name.empty()) {
    const auto folder = fs::weakly_canonical(fs::absolute(init.file), none).parent_path().filename().string();
    const auto name = answer(interrupt, "Name of the machine", name_from(folder), no_name);
    if (!name) return tl::unexpected(name.error());
    init.name = *name;
  }
  if (init.plant.empty()) init.plant = plant_beside(init.file);
  return ask_to_replace(options, init, interrupt);
}

}  // namespace berth::cli
