// Every `--help`: an example, 80 columns, and only options that the verb takes.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <string>
#include <vector>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>
#include <sstream>

#include "../paths.hpp"
#include "environment.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

struct Page {
  Words verb;
  std::vector<std::string> lines;

  [[nodiscard]] std::string name() const {
    std::string all;
    for (const auto& word : verb) all += (all.empty() ? "" : " ") + word;
    return all;
  }
};

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::size_t columns(const std::string& line) {
  return static_cast<std::size_t>(
      std::ranges::count_if(line, [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }));
}

/// First words of the rows below "HEADING:".
std::vector<std::string> listed(const std::vector<std::string>& lines, const std::string& heading) {
  std::vector<std::string> words;
  bool below = false;
  for (const auto& line : lines) {
    if (line == heading) below = true;
    if (line.empty()) below = false;
    const bool row = line.size() > 2 && line.starts_with("  ") && line[2] != ' ';
    if (below && row) words.push_back(line.substr(2, line.find(' ', 2) - 2));
  }
  return words;
}

/// Until it ends, programs that are started look for no leaks: 0.06 s of a processor each, of 0.15 s in all, and these
/// tests start hundreds. What the verbs do is looked through for leaks by the verbs' own tests.
class WithoutLeakCheck {
  static std::string options() {
    const char* const before = std::getenv("ASAN_OPTIONS");
    return std::string(before == nullptr ? "" : before) + ":detect_leaks=0";
  }
  EnvironmentVariable variable_{"ASAN_OPTIONS", options()};
};

/// Those of a verb and all below it, as `berth VERB --help` has them.
void read_pages(const Words& verb, std::vector<Page>& pages) {
  Words words = verb;
  words.emplace_back("--help");
  const Outcome outcome = berth(words);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  pages.push_back({verb, lines_of(outcome.out)});
  for (const auto& sub : listed(lines_of(outcome.out), "Subcommands:")) {
    Words below = verb;
    below.push_back(sub);
    read_pages(below, pages);
  }
}

const std::vector<Page>& pages() {
  static const std::vector<Page> all = [] {
    const WithoutLeakCheck quick;
    std::vector<Page> read;
    read_pages({}, read);
    return read;
  }();
  return all;
}

TEST(Help, EveryPageHasAnExampleAndFits) {
  ASSERT_GT(pages().size(), 50U);
  for (const auto& page : pages()) {
    bool example = false;
    for (std::size_t i = 0; i < page.lines.size(); ++i) {
      EXPECT_LE(columns(page.lines[i]), 80U) << page.name() << ": " << page.lines[i];
      const bool heading = page.lines[i] == "Example:" || page.lines[i] == "Examples:";
      example = example || (heading && i + 1 < page.lines.size() && page.lines[i + 1].starts_with("  berth "));
    }
    EXPECT_TRUE(example) << page.name();
  }
}

TEST(Help, HelpVerbIsTheSamePage) {
  const WithoutLeakCheck quick;
  for (const auto& page : pages()) {
    Words words = page.verb;
    words.insert(words.begin(), "help");
    EXPECT_EQ(lines_of(berth(words).out), page.lines) << page.name();
  }
}

// The words of an example's command are verbs and options of that verb.
TEST(Help, ExamplesUseOptionsThatThereAre) {
  std::map<std::string, std::set<std::string>> options;
  for (const auto& page : pages()) {
    std::set<std::string>& known = options[page.name()];
    for (const auto& heading : {"Options:", "One of these:"}) {
      for (auto word : listed(page.lines, heading)) {
        for (std::istringstream names(word); std::getline(names, word, ',');) known.insert(word);
      }
    }
  }
  for (const auto& page : pages()) {
    for (const auto& line : page.lines) {
      if (!line.starts_with("  berth ")) continue;
      std::istringstream words(line.substr(8));
      std::string verb;
      for (std::string word; words >> word;) {
        if (word.starts_with("#") || word == "&&") break;
        const auto longer = verb.empty() ? word : verb + " " + word;
        if (options.contains(longer)) {
          verb = longer;
        } else if (word.starts_with("-") && word.size() > 1 && std::isalpha(static_cast<unsigned char>(word.back()))) {
          EXPECT_TRUE(options.at(verb).contains(word)) << page.name() << ": " << line << ": " << word;
        }
      }
      EXPECT_FALSE(verb.empty() && line.find("help") == std::string::npos) << page.name() << ": " << line;
    }
  }
}

// ---- options that the verb takes ----

/// For each verb words with which it ends soon and well; of those that need real ports or run for long: with which it
/// is refused, but not because of an option.
class Taken : public ::testing::Test {
 protected:
  [[nodiscard]] std::map<std::string, Words> verbs() const {
    const std::string left = "00000001-00000001-00000000-00000020";
    const std::string log = folder.write("run.log", "(1.000000) can0 702#05\n(1.100000) can0 702#05\n");
    const std::string drive = example("eds/drive.eds");
    const Words sim{"-m", machine, "--sim", plant};
    const auto on = [&](Words words) {
      words.insert(words.end(), sim.begin(), sim.end());
      return words;
    };
    const auto programmed = [](Words words) {
      words.insert(words.end(), {"-m", example("programmed.toml"), "--sim", example("programmed.plant.toml")});
      return words;
    };
    return {
        {"demo", {"--fast"}},
        {"init", {folder.file("made.toml"), "--eds", drive, "--force", "--allow-outside", source_dir()}},
        {"ports", {}},
        {"up", on({"--fast"})},
        {"studio", on({"--listen", "0.0.0.0:0"})},
        {"scan", on({})},
        {"status", on({"--up"})},
        {"watch", on({"2/1001h", "--up", "--count", "1"})},
        {"history", on({"--up"})},
        {"bind", on({})},
        {"locate", on({"2", "--up", "--anyway"})},
        {"replace", on({"left", "--up", "--device", left})},
        {"forget", on({left, "--up"})},
        {"poll", on({"left", "--up"})},
        {"configure", {"-m", example("configured.toml"), "--sim", example("configured.plant.toml"), "--up"}},
        {"upload",
         {"pump 1", "-m", example("configured.toml"), "--sim", example("configured.plant.toml"), "--up", "--output",
          folder.file("uploaded.dcf"), "--force"}},
        {"backup save", on({"2", "--up", "--output", folder.file("backups")})},
        {"backup compare", on({"2", example("eds/pump.dcf"), "--up"})},
        {"backup restore", on({"2", example("eds/pump.dcf"), "--up"})},
        {"program status", programmed({"controller 3", "--up"})},
        {"program download", programmed({"controller 3", "--up"})},
        {"program start", programmed({"controller 3", "--up"})},
        {"program stop", programmed({"controller 3", "--up"})},
        {"program clear", programmed({"controller 1"})},
        {"program image", {drive, folder.file("drive.bprg")}},
        {"boot", on({})},
        {"sdo read", on({"2", "1018h:04", "--up"})},
        {"sdo write", on({"2", "1017h", "100", "--up", "--yes"})},
        {"sdo dump", on({"2", "--up"})},
        {"note read", {"belt", "1017h", "-m", noted}},
        {"note write", {"belt", "1017h", "--text", "x", "--unit", "V", "-m", noted}},
        {"note remove", {"belt", "1017h", "-m", noted}},
        {"sdo connect", on({"2", "3", "--up"})},
        {"sdo release", on({"2", "3", "--up"})},
        {"sdo channels", on({"--up"})},
        {"nmt", on({"start", "2", "--up"})},
        {"lss select", on({left})},
        {"lss inquire", on({left})},
        {"lss store", on({left})},
        {"lss set-node-id", on({left, "5"})},
        {"lss bit-timing", on({"500000", left})},
        {"lss activate", on({"10"})},
        {"lss global", on({"waiting"})},
        {"lss find", on({})},
        {"lss move-bit-rate", on({"250000"})},
        {"lss identify", on({"1", "1"})},
        {"lss identify-unconfigured", on({})},
        {"emcy", on({"2", "--up"})},
        {"store", on({"2", "--up"})},
        {"restore", on({"2", "--up"})},
        {"send", on({"080#"})},
        {"eds check", {drive}},
        {"eds convert", {drive, folder.file("out.eds")}},
        {"eds diff", {drive, drive}},
        {"eds show", {drive}},
        {"doctor", on({"--for", "1 s", "--up"})},
        {"trace", {log}},
        {"reproduce", {"--trace", "paper4-table1"}},
        {"analyze", {machine}},
        {"link", {example("linked.toml")}},
        {"document", {machine, "--output", folder.file("document")}},
        {"compare", {"--methods", "rand", "--devices", "1", "--bitrates", "125", "--seeds", "1"}},
        {"study", {"faults", "--seeds", "2"}},
        {"serve", {plant, "--listen", "127.0.0.1:0", "--for", "1 ms", "-m", machine}},
        {"gateway", {machine, "--sim", plant, "--listen", "127.0.0.1:0", "--for", "1 ms"}},
        {"adopt", {folder.file("adopted.toml"), "--port", "plant:" + folder.file("none")}},
        {"export", {machine, folder.file("export")}},
        {"import", {folder.file("none"), folder.file("imported")}},
        {"device", {plant, "--port", "plant:" + folder.file("none"), "--for", "1 ms"}},
        {"plant", {plant, "--for", "1 s", "-m", machine}},
        {"fleet show", {"line", "--broker", "mqtt://127.0.0.1:1"}},
        {"fleet roll-out", {drive, "--slot", "s", "--broker", "mqtt://127.0.0.1:1"}},
        {"man", {}},
        {"completion", {"bash"}},
        {"version", {}},
    };
  }
  [[nodiscard]] std::string value_of(const std::string& option) const {
    static const std::map<std::string, std::string> values{{"--seed", "3"},
                                                           {"--role", "view"},
                                                           {"--timeout", "60 s"},
                                                           {"--bus", "line"},
                                                           {"--for", "1 s"},
                                                           {"--until", "operational"},
                                                           {"--on-exit", "leave"},
                                                           {"--ready", "started"},
                                                           {"--log-level", "warning"},
                                                           {"--real-time", "1"},
                                                           {"--gateway", "127.0.0.1:0"},
                                                           {"--bitrate", "125000"},
                                                           {"--name", "name"},
                                                           {"--method", "rand"},
                                                           {"--seconds", "1"},
                                                           {"--device", "00000001-00000001-00000000-00000020"},
                                                           {"--type", "u32"},
                                                           {"--to", "dcf"},
                                                           {"--delay", "200"},
                                                           {"--rate", "250000"},
                                                           {"--listen", "127.0.0.1:0"},
                                                           {"--node", "5"},
                                                           {"--watch", "1 s"},
                                                           {"--every", "100 ms"},
                                                           {"--count", "2"},
                                                           {"--color", "never"},
                                                           {"--times", "relative"},
                                                           {"--conformance", "2"},
                                                           {"--from", "candump"},
                                                           {"--service", "sdo"},
                                                           {"--object", "1018h"},
                                                           {"--text", "x"},
                                                           {"--scale", "0.1"},
                                                           {"--value", "3=x"},
                                                           {"--bit", "3=x"},
                                                           {"--after", "0"},
                                                           {"--before", "5"},
                                                           {"--methods", "rand"},
                                                           {"--devices", "1"},
                                                           {"--bitrates", "125"},
                                                           {"--serials", "random"},
                                                           {"--jobs", "1"},
                                                           {"--variant", "plain"},
                                                           {"--limit", "60 s"},
                                                           {"--seeds", "1"},
                                                           {"--threads", "1"},
                                                           {"--latency", "1 ms"},
                                                           {"--errors", "1 s"},
                                                           {"--event", "10 ms"},
                                                           {"--emcy", "1 s"},
                                                           {"--sdo", "10 ms"},
                                                           {"--nmt", "1 s"},
                                                           {"--fifo", "all"},
                                                           {"--burst", "2"},
                                                           {"--trace", "paper4-table1"},
                                                           {"--program", "1"},
                                                           {"--identification", "5"},
                                                           {"--vendor", "1"},
                                                           {"--product", "2"},
                                                           {"--days", "15000"},
                                                           {"--ms", "1000"},
                                                           {"--revision-low", "0"},
                                                           {"--revision-high", "9"},
                                                           {"--serial-low", "0"},
                                                           {"--serial-high", "9"},
                                                           {"--request", "1"},
                                                           {"--sdo-timeout", "500"},
                                                           {"--part", "serial"},
                                                           {"--lease", "1 min"},
                                                           {"--master", "126"},
                                                           {"--at-most", "3"}};
    const auto known = values.find(option);
    if (option == "--output") return folder.file("out.log");
    if (option == "--plan") return folder.write("plan-before.toml", "format = 1\n");
    if (option == "--plant") return folder.file("out.plant.toml");
    return known != values.end() ? known->second : folder.file("value" + option);
  }

  Folder folder;
  std::string machine = folder.write("machine.toml", small_machine);
  std::string plant = folder.write("plant.toml", small_plant);
  /// Its device has a description of its own, beside which notes can stand.
  std::string belt = folder.write("belt.eds", contents(example("eds/belt.eds")));
  std::string noted = folder.write("noted.toml",
                                   "[machine]\nname = \"n\"\n[bus.line]\nport = \"sim\"\nbitrate = 250_000\n"
                                   "[[slot]]\nbus = \"line\"\nid = 5\nname = \"belt\"\neds = \"belt.eds\"\n");
};

// No option on a page is refused as wrong use when it stands by itself behind a command that is good without it. Those
// whose value has to be a thing that is there (a port, a description) or that need others are left to their own tests.
TEST_F(Taken, EveryOptionThatIsShown) {
  static const std::set<std::string> others{"-h",    "--port",      "--control", "--eds",   "--machine",
                                            "--sim", "--sim-state", "--file",    "--watch", "--follow"};
  static const std::set<std::string> together{"up --events",
                                              "up --gateway",
                                              "up --pace",
                                              "demo --events",
                                              "demo --pace",
                                              "up --studio",
                                              "demo --studio",
                                              "up --mqtt",
                                              "demo --mqtt",
                                              "trace --to",
                                              "trace --stats",
                                              "trace --quiet",
                                              "trace --ring",
                                              "trace --filter",
                                              "eds diff --node",
                                              "reproduce --negotiation-load",
                                              "plant --listen",
                                              "sdo dump --to",
                                              "emcy --listen",
                                              "gateway --real-time",
                                              "adopt --all",
                                              "device --device",
                                              "device --except",
                                              "configure --bus",
                                              "configure --from",
                                              "configure --restart",
                                              "program download --keep",
                                              "fleet roll-out --group",
                                              "up --master-id",
                                              "up --priority",
                                              "upload --bus",
                                              "analyze --node",
                                              "link --node",
                                              "up --studio-role",
                                              "up --studio-tokens",
                                              "up --studio-certificate",
                                              "up --studio-key",
                                              "up --studio-open-metrics",
                                              "demo --studio-role",
                                              "demo --studio-tokens",
                                              "demo --studio-certificate",
                                              "demo --studio-key",
                                              "demo --studio-open-metrics",
                                              "fleet show --login",
                                              "fleet show --ca",
                                              "fleet show --certificate",
                                              "fleet show --key",
                                              "fleet roll-out --login",
                                              "fleet roll-out --ca",
                                              "fleet roll-out --certificate",
                                              "fleet roll-out --key",
                                              "studio --certificate",
                                              "studio --key",
                                              "study --merge",
                                              "study --summary"};
  const auto known = verbs();
  const WithoutLeakCheck quick;
  for (const auto& page : pages()) {
    const bool group = !listed(page.lines, "Subcommands:").empty();
    if (group || page.name().starts_with("sim ") || page.name().starts_with("world ")) continue;
    const auto base = known.find(page.name());
    ASSERT_NE(base, known.end()) << page.name() << ": say in this test how it is run";
    for (const auto& row : page.lines) {
      if (!row.starts_with("  -")) continue;
      const auto names = row.substr(2, row.find(' ', 2) - 2);
      const auto option = names.substr(names.find("--") == std::string::npos ? 0 : names.find("--"));
      const std::string name = option.substr(0, option.find(','));
      if (others.contains(names.substr(0, names.find(','))) || others.contains(name)) continue;
      if (together.contains(page.name() + " " + name)) continue;
      if (std::ranges::find(base->second, name) != base->second.end()) continue;
      Words words = page.verb;
      words.insert(words.end(), base->second.begin(), base->second.end());
      words.push_back(name);
      const bool takes = row.size() > 2 + names.size() + 1 && row[2 + names.size() + 1] != ' ';
      if (takes) words.push_back(value_of(name));
      const Outcome outcome = berth(words);
      EXPECT_TRUE(outcome.status != 2 || page.name() == "import") << page.name() << " " << name << ": " << outcome.err;
    }
  }
}

// What a start costs, in time of a processor: what a person waits for on a machine that has nothing else to do.
TEST(Help, TheFirstLineComesAtOnce) {
  constexpr int rounds = 20;
  const auto processor_ms = [] {
    rusage used{};
    getrusage(RUSAGE_CHILDREN, &used);
    const auto ms = [](const timeval& t) {
      return 1000.0 * static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) / 1000.0;
    };
    return ms(used.ru_utime) + ms(used.ru_stime);
  };
  const double before = processor_ms();
  for (int i = 0; i < rounds; ++i) {
    const Outcome help = berth({"--help"});
    ASSERT_EQ(help.status, 0);
  }
  const double each = (processor_ms() - before) / rounds;
  std::printf("berth --help: %.1f ms of a processor (mean of %d starts)\n", each, rounds);
  EXPECT_LT(each, 500.0);
}

}  // namespace
}  // namespace berth::test
