// docs/coming-from.md: every command of Berth's in its tables does what stands beside it.
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "../paths.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

namespace fs = std::filesystem;

struct Expected {
  std::string says;  ///< in what it prints
  int status = 0;
  std::string file = {};   ///< that it writes
  std::string holds = {};  ///< in that file
};

/// What each command of the document is to print, from what the device is and the other tool would show.
const std::map<std::string, Expected>& expected() {
  static const std::string blank = "00000001-00000004-00010000-00000009";
  static const std::map<std::string, Expected> all{
      {"berth trace --port can0 --timeout \"1 s\"", {"Heartbeat of node 5"}},
      {"berth trace --port can0 -o can0.log --timeout \"1 s\"", {"Heartbeat of node 5", 0, "can0.log", "can0 705#"}},
      {"berth trace --port can0 --node 5 --service heartbeat --timeout \"1 s\"", {"Heartbeat of node 5"}},
      {"berth trace run.log", {"Heartbeat of node 5"}},
      {"berth trace run.log --eds 5=pump.eds --service sdo", {"Serial number"}},
      {"berth send 080# --port can0", {"can0  080#"}},
      {"berth send 605#4018100400000000 --port can0", {"can0  605#4018100400000000"}},
      {"berth sdo read 5 1018h:04 --port can0", {"0x00000042"}},
      {"berth nmt preop 5 --port can0 --yes", {"NMT enter pre-operational sent to node 5"}},
      {"berth trace --port can0 --stats --timeout \"1 s\"", {"\n  705  "}},
      {"berth trace --port can0 --stats --bitrate 125000 --timeout \"1 s\"", {"% at 125000 bit/s"}},
      {"berth trace run.log -o run.asc", {"", 0, "run.asc", "705 "}},
      {"berth trace run.asc -o again.log", {"", 0, "again.log", " 705#05"}},
      {"berth ports", {"\n"}},
      {"berth scan --port can0", {"5  00000001-00000030-00010000-00000042"}},
      {"berth init new.toml --eds pump.eds --dry-run", {"eds  = \"pump.eds\""}},
      {"berth sdo read 5 \"Producer heartbeat time\" --port can0", {"= 100 ms"}},
      {"berth sdo read 5 \"Identity object/Serial number\" --port can0", {"0x00000042"}},
      {"berth sdo write 5 \"Producer heartbeat time\" 500 --port can0", {"1017h:00  written: 500 (0x01F4) = 500 ms"}},
      {"berth sdo write 5 1017h \"0.5 s\" --port can0", {"1017h:00  written: 500 (0x01F4) = 500 ms"}},
      {"berth sdo read 5 1018h:04 --type os --port can0", {"42000000"}},
      {"berth sdo write 5 1017h \"F4 01\" --type os --port can0", {"1017h:00  written: F401"}},
      {"berth sdo read 5 1008h --file name.txt --port can0", {"name.txt", 0, "name.txt", "Berth pump"}},
      {"berth sdo dump 5 --port can0 --eds pump.eds", {"Producer heartbeat time"}},
      {"berth sdo dump 5 --port can0 --eds pump.eds --to dcf -o pump5.dcf", {"", 0, "pump5.dcf", "ParameterValue="}},
      {"berth eds show pump.eds", {"Identity object"}},
      {"berth nmt reset-comm 5 --port can0 --yes", {"NMT reset communication sent to node 5"}},
      {"berth status", {"can0    5  pump", 1}},  // nobody has brought it up
      {"berth emcy --listen \"1 s\" --port can0", {"0 emergency messages"}},
      {"berth emcy 5 --port can0", {"1001h:00  00h  no error"}},
      {"berth store 5 --port can0 --yes", {"1010h:01  all parameters stored"}},
      {"berth restore 5 --port can0 --yes", {"1011h:01  all parameters restored"}},
      {"berth lss find --port can0", {blank}},
      {"berth lss select " + blank + " --port can0 --yes", {blank + " is in LSS configuration state"}},
      {"berth lss inquire " + blank + " --port can0", {"255 (none)"}},
      {"berth lss set-node-id " + blank + " 9 --save --port can0 --yes", {"node-ID 9, stored"}},
      {"berth lss global waiting --port can0 --yes", {"LSS waiting state"}},
      {"berth trace --port can0 --service pdo --eds 5=pump.eds --timeout \"1 s\"", {""}},  // no PDO is sent there
      {"berth send 205#0300 --port can0", {"can0  205#0300"}},
      {"berth gateway --listen 127.0.0.1:0 --for \"1 s\"", {"127.0.0.1:"}},
      {"berth sdo write 5 1017h 500 --port can0", {"1017h:00  written: 500 (0x01F4) = 500 ms"}},
      {"berth eds check pump.dcf", {"0 errors"}},
      {"berth init new.toml --eds pump.eds:2 --force", {"2 slots", 0, "new.toml", "ids  = \"1..2\""}},
      {"berth eds convert pump.dcf pump.cdcf --node 5", {"concise DCF", 0, "pump.cdcf", ""}},
      {"berth serve --port can0 --listen 127.0.0.1:0 --for \"1 s\"", {"socketcand://127.0.0.1:"}},
      {"berth sdo read 5 1017h --port can0", {"= 100 ms"}},
      {"berth sdo read 5 1008h --port can0", {"Berth pump"}},
      {"berth nmt preop all --port can0 --yes", {"NMT enter pre-operational sent to all"}},
      {"berth nmt reset-node 5 --port can0 --yes", {"NMT reset node sent to node 5"}},
      {"berth bind --dry-run", {""}},
      {"berth device plant.toml --port can0 --for \"1 s\"", {"pump                 node-ID   5  pre-operational"}},
  };
  return all;
}

/// The commands between backticks in the second columns of the tables, in order.
std::vector<std::string> commands_of(const std::string& document) {
  std::vector<std::string> commands;
  std::istringstream in(document);
  for (std::string line; std::getline(in, line);) {
    const auto column = line.find(" | ");
    if (!line.starts_with("| ") || column == std::string::npos) continue;
    std::size_t at = column;
    while ((at = line.find("`berth ", at)) != std::string::npos) {
      const auto end = line.find('`', at + 1);
      commands.push_back(line.substr(at + 1, end - at - 1));
      at = end + 1;
    }
  }
  return commands;
}

/// A folder with what the document speaks of: a bus with node 5 and a blank device, its description, a machine file.
class ComingFrom : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const auto* const name : {"pump.eds", "pump.dcf"}) {
      fs::copy_file(example(std::string("eds/") + name), folder.file(name));
    }
    folder.write("plant.toml", R"([bus.can0]
bitrate = 125_000
[[device]]
bus = "can0"
name = "pump"
eds = "pump.eds"
serial = 0x42
node_id = 5
heartbeat = "100 ms"
[[device]]
bus = "can0"
name = "blank"
type = { vendor = 1, product = 4, revision = 0x10000 }
serial = 9
)");
    folder.write("berth.toml",
                 "[machine]\nname = \"coming from\"\n[bus.can0]\nport = \"plant:bus.sock\"\n"
                 "bitrate = 125_000\n[[slot]]\nbus = \"can0\"\nid = 5\nname = \"pump\"\n"
                 "eds = \"pump.eds\"\n");
  }
  /// As typed in that folder.
  [[nodiscard]] Outcome shell(const std::string& command) const {
    const std::string script = "cd '" + folder.file("") + "' && export XDG_RUNTIME_DIR=. && berth() { '" + binary() +
                               "' \"$@\"; } && " + command + " > out.txt 2> err.txt < /dev/null";
    const int status = std::system(("timeout 60 sh -c \"$(cat <<'END'\n" + script + "\nEND\n)\"").c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, contents(folder.file("out.txt")),
            contents(folder.file("err.txt"))};
  }
  Folder folder;
};

TEST_F(ComingFrom, EveryCommandOfTheDocument) {
  const auto commands = commands_of(contents(source_dir() + "/docs/coming-from.md"));
  const std::set<std::string> once(commands.begin(), commands.end());
  for (const auto& [command, ignored] : expected()) {
    EXPECT_TRUE(once.contains(command)) << "no longer in the document: " << command;
  }
  std::set<std::string> tried;
  std::size_t without_machine = 0;
  for (const auto& command : commands) {
    if (!tried.insert(command).second) continue;
    const auto wanted = expected().find(command);
    ASSERT_NE(wanted, expected().end()) << "say what it prints: " << command;
    // Each has a bus and files that no other has touched.
    folder.write("run.log",
                 "(1.000000) can0 705#05\n(1.100000) can0 605#4018100400000000\n"
                 "(1.101000) can0 585#4318100442000000\n");
    Background devices({"plant", folder.file("plant.toml"), "--listen", folder.file("bus.sock")});
    ASSERT_TRUE(devices.says("Ctrl-C"));
    std::string typed = command;
    const std::string port = "--port can0";
    const auto at = typed.find(port);
    const bool bus_needed = command.find("berth serve") == std::string::npos;
    if (at != std::string::npos) {
      typed.replace(at, port.size(), bus_needed ? "--port bus.sock --bus can0" : "--port can0=plant:bus.sock");
    }
    const Outcome outcome = shell(typed);
    EXPECT_EQ(outcome.status, wanted->second.status) << command << "\n" << outcome.out << outcome.err;
    EXPECT_NE(outcome.out.find(wanted->second.says), std::string::npos) << command << "\n"
                                                                        << outcome.out << outcome.err;
    if (!wanted->second.file.empty()) {
      const auto written = folder.file(wanted->second.file);
      EXPECT_TRUE(exists(written)) << command;
      EXPECT_NE(contents(written).find(wanted->second.holds), std::string::npos) << command;
    }
    if (outcome.err.find("machine file: berth.toml") == std::string::npos) ++without_machine;
  }
  std::printf("docs/coming-from.md: %zu commands, %zu of them without a machine file\n", tried.size(), without_machine);
  EXPECT_GT(without_machine, 40U);
}

}  // namespace
}  // namespace berth::test
