// `berth link` as a person uses it.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "berth/eds/concise_dcf.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/od/values.hpp"
#include "berth/text/columns.hpp"
#include "machines.hpp"
#include "process.hpp"
#include "tests/paths.hpp"

namespace berth::test {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// The example in a folder of its own, with its links or others.
class Link : public ::testing::Test {
 protected:
  Link() : folder_(fs::temp_directory_path() / ("berth-link-" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "eds");
    for (const char* const name : {"controller.eds", "io.eds"})
      fs::copy(example("eds/") + name, folder_ / "eds" / name);
    machine_ = read(example("linked.toml"));
    write("linked.toml", machine_);
  }
  ~Link() override { fs::remove_all(folder_); }
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  static std::string read(const fs::path& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
  }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  [[nodiscard]] std::string file(const std::string& name) const { return (folder_ / name).string(); }

  fs::path folder_;
  std::string machine_;
};

}  // namespace

namespace {

/// The valid PDOs of a DCF: their COB-IDs, and in each the bit at which every mapped object begins, with its length.
class PdosOfDcf {
 public:
  struct Mapped {
    std::uint16_t index;
    std::uint8_t sub;
    unsigned bit;
    unsigned bits;
  };
  PdosOfDcf(const std::string& path, std::uint8_t node, std::uint16_t communication) {
    const auto reading = eds::read_any_file(path);
    EXPECT_TRUE(reading.usable()) << path;
    if (!reading.usable()) return;
    od::Values values(reading.file.description, NodeId(node));
    for (const auto& each : reading.file.parameters) {
      const auto bytes = eds::encode(each.value, each.type, NodeId(node));
      if (bytes) static_cast<void>(values.set_bytes(each.object, *bytes));
    }
    for (unsigned i = 0; i < 64; ++i) {
      const auto index = static_cast<std::uint16_t>(communication + i);
      const auto cob_id = values.get_or<std::uint32_t>({index, 1}, 0x8000'0000);
      if ((cob_id & 0x8000'0000) != 0) continue;
      unsigned bit = 0;
      const auto mapping = static_cast<std::uint16_t>(index + 0x200);
      const auto count = values.get_or<std::uint8_t>({mapping, 0}, 0);
      for (std::uint8_t entry = 1; entry <= count; ++entry) {
        const auto word = values.get_or<std::uint32_t>({mapping, entry}, 0);
        pdos[cob_id & 0x7FF].push_back(
            {static_cast<std::uint16_t>(word >> 16U), static_cast<std::uint8_t>(word >> 8U), bit, word & 0xFFU});
        bit += word & 0xFFU;
      }
    }
  }
  [[nodiscard]] const Mapped* find(std::uint32_t cob_id, std::uint16_t index, std::uint8_t sub) const {
    const auto pdo = pdos.find(cob_id);
    if (pdo == pdos.end()) return nullptr;
    const auto at = std::ranges::find_if(pdo->second, [&](const auto& m) { return m.index == index && m.sub == sub; });
    return at == pdo->second.end() ? nullptr : &*at;
  }
  [[nodiscard]] bool has(std::uint16_t index, std::uint8_t sub) const {
    return std::ranges::any_of(pdos, [&](const auto& pdo) { return find(pdo.first, index, sub) != nullptr; });
  }
  std::map<std::uint32_t, std::vector<Mapped>> pdos;  // by CAN-ID
};

struct Joined {
  const char* producer;
  std::uint8_t producer_id;
  std::uint16_t from;
  std::uint8_t from_sub;
  const char* consumer;
  std::uint8_t consumer_id;
  std::uint16_t to;
  std::uint8_t to_sub;
  unsigned bits;
};

}  // namespace

TEST_F(Link, ThePlanFitsATerminal) {
  const Outcome run = berth({"link", file("linked.toml"), "--links"});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("field: 250 kbit/s, 4 objects in 3 PDOs"), std::string::npos) << run.out;
  EXPECT_NE(run.out.find(" 181h  press"), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("left io/6000h:01 -> belt/A4C0h:02"), std::string::npos) << run.out;
  std::istringstream lines(run.out);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(text::columns(line), 80U) << line;
  EXPECT_FALSE(fs::exists(folder_ / "plan.toml"));
}

// S5.20: devices, node-IDs and bit rate, then variables, then PDOs: all of it stands in the DCFs. S5.9: the used
// variables too.
TEST_F(Link, S5_9_S5_20_FilesOfAllSteps) {
  const Outcome dry = berth({"link", file("linked.toml"), "--output", file("out"), "--dry-run"});
  EXPECT_EQ(dry.status, 0) << dry.err;
  EXPECT_NE(dry.out.find("would write " + file("out/press.dcf")), std::string::npos) << dry.out;
  EXPECT_FALSE(fs::exists(file("out")));
  const Outcome run = berth({"link", file("linked.toml"), "--output", file("out")});
  EXPECT_EQ(run.status, 0) << run.err;
  const std::string dcf = read(file("out/press.dcf"));
  for (const char* const line : {"NodeID=0x01", "Baudrate=250", "NodeName=press", "ParameterName=speed",
                                 "Denotation=speed", "ModifiedBy=berth link"}) {
    EXPECT_NE(dcf.find(line), std::string::npos) << line;
  }
  const Outcome checked = berth({"eds", "check", file("out/press.dcf")});
  EXPECT_EQ(checked.status, 0) << checked.out;
  EXPECT_NE(checked.out.find("0 errors, 0 warnings"), std::string::npos) << checked.out;
  const Outcome again = berth({"link", file("linked.toml"), "--output", file("out")});
  EXPECT_NE(again.out.find("all files are up to date"), std::string::npos) << again.out;
}

// S5.22, the visual object linker: a producer is linked to its consumers by their names, and mapping, CAN-IDs and
// variables follow; what is linked no more is mapped no more; the programming system gets the variables.
TEST_F(Link, S5_22_ProducersAreMappedOntoTheirConsumersAndTakenOutAgain) {
  ASSERT_EQ(berth({"link", file("linked.toml"), "--output", file("out")}).status, 0);
  const std::vector<Joined> all{{"press", 1, 0xA100, 1, "belt", 2, 0xA580, 1, 16},
                                {"press", 1, 0xA040, 1, "belt", 2, 0xA4C0, 1, 8},
                                {"left_io", 3, 0x6000, 1, "press", 1, 0xA4C0, 1, 8},
                                {"left_io", 3, 0x6000, 1, "belt", 2, 0xA4C0, 2, 8},
                                {"belt", 2, 0xA040, 1, "right_io", 4, 0x6200, 1, 8}};
  std::map<std::uint32_t, std::string> sender;
  for (const auto& each : all) {
    const PdosOfDcf sent(file("out/") + each.producer + ".dcf", each.producer_id, 0x1800);
    const PdosOfDcf taken(file("out/") + each.consumer + ".dcf", each.consumer_id, 0x1400);
    bool arrives = false;
    for (const auto& [cob_id, mapped] : sent.pdos) {
      EXPECT_EQ(sender.emplace(cob_id, each.producer).first->second, each.producer) << "a CAN-ID has one sender";
      const auto* const from = sent.find(cob_id, each.from, each.from_sub);
      const auto* const to = taken.find(cob_id, each.to, each.to_sub);
      if (from == nullptr || to == nullptr) continue;
      arrives = true;
      EXPECT_EQ(from->bit, to->bit) << each.consumer;
      EXPECT_EQ(from->bits, each.bits) << each.producer;
      EXPECT_EQ(to->bits, each.bits) << each.consumer;
    }
    EXPECT_TRUE(arrives) << each.producer << " to " << each.consumer;
  }
  // To the programming system: what the network calls an input is an output of the program.
  const std::string of_press = read(file("out/press.gvl.st"));
  const std::string of_belt = read(file("out/belt.gvl.st"));
  const auto line_of = [](const std::string& text, const std::string& name) {
    const auto at = text.find(name);
    return at == std::string::npos ? std::string() : text.substr(at, text.find('\n', at) - at);
  };
  EXPECT_NE(line_of(of_press, "speed").find("%Q"), std::string::npos) << of_press;
  EXPECT_NE(line_of(of_press, "speed").find("UINT"), std::string::npos) << of_press;
  EXPECT_NE(line_of(of_belt, "press_speed").find("%I"), std::string::npos) << of_belt;
  EXPECT_NE(read(file("out/belt.plcopen.xml")).find("press_speed"), std::string::npos);
  // Demapping: of the first link nothing is left, and the others are as they were.
  const auto first = machine_.find("[[link]]");
  const auto second = machine_.find("[[link]]", first + 1);
  write("linked.toml", machine_.substr(0, first) + machine_.substr(second));
  ASSERT_EQ(berth({"link", file("linked.toml"), "--output", file("out")}).status, 0);
  const PdosOfDcf sent(file("out/press.dcf"), 1, 0x1800);
  const PdosOfDcf taken(file("out/belt.dcf"), 2, 0x1400);
  EXPECT_FALSE(sent.has(0xA100, 1));
  EXPECT_FALSE(taken.has(0xA580, 1));
  EXPECT_TRUE(sent.has(0xA040, 1));
  EXPECT_TRUE(taken.has(0xA4C0, 1));
  EXPECT_EQ(read(file("out/press.gvl.st")).find("speed"), std::string::npos);
}

TEST_F(Link, TheNextPlanGoesOnFromTheLast) {
  ASSERT_EQ(berth({"link", file("linked.toml"), "--output", file("out")}).status, 0);
  const std::string before = read(file("out/plan.toml"));
  // The first link goes; what the second one has stays, and the linked DCFs are the slots' configurations now.
  const auto first = machine_.find("[[link]]");
  const auto second = machine_.find("[[link]]", first + 1);
  std::string changed = machine_.substr(0, first) + machine_.substr(second);
  for (const auto& [slot, eds] : {std::pair("press", "eds/controller.eds"), std::pair("belt", "eds/controller.eds")}) {
    const auto at = changed.find("name = \"" + std::string(slot) + "\"");
    const auto line = changed.find(eds, at);
    changed.insert(changed.find('\n', line) + 1, "config = \"out/" + std::string(slot) + ".dcf\"\n");
  }
  write("linked.toml", changed);
  const Outcome run = berth({"link", file("linked.toml"), "--output", file("out"), "--json"});
  ASSERT_EQ(run.status, 0) << run.out << run.err;
  const json said = json::parse(run.out);
  EXPECT_TRUE(said.at("good"));
  EXPECT_TRUE(said.at("written"));
  bool running = false;
  for (const auto& pdo : said.at("pdos")) {
    if (pdo.at("producer") != "press") continue;
    running = true;
    EXPECT_EQ(pdo.at("can_id"), "0x181");
    EXPECT_EQ(pdo.at("objects").size(), 1U);
    EXPECT_EQ(pdo.at("objects").at(0).at("object"), "A040h:01");
  }
  EXPECT_TRUE(running) << run.out;
  EXPECT_EQ(read(file("out/press.dcf")).find("speed"), std::string::npos) << "the variable is gone";
  EXPECT_NE(read(file("out/plan.toml")), before);
}

TEST_F(Link, ALinkThatCannotBeIsExitOneAndNoFiles) {
  write("linked.toml", machine_ + "\n[[link]]\nfrom = \"left io/6005h:00\"\nto = [\"press/x\"]\n");
  const Outcome run = berth({"link", file("linked.toml"), "--output", file("out")});
  EXPECT_EQ(run.status, 1);
  EXPECT_NE(run.err.find("linked.toml:64:1: error: link[5]: left io/6005h:00: "), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("cannot be mapped into a TPDO"), std::string::npos) << run.err;
  EXPECT_FALSE(fs::exists(file("out")));
}

namespace {

// The devices of linked.toml. The programs of the two controllers have the variables that the linker makes.
constexpr const char* plant_head = R"([plant]
seed = 3
[bus.field]
)";
constexpr const char* press = R"(
[[device]]
bus = "field"
name = "press"
eds = "eds/controller.eds"
serial = 1
script = "press.lua"
variables = [
  { name = "running", type = "UNSIGNED8", object = "A040h:01" },
  { name = "speed", type = "UNSIGNED16", object = "A100h:01" },
  { name = "stop_buttons", type = "UNSIGNED8", object = "A4C0h:01" },
]
)";
constexpr const char* belt = R"(
[[device]]
bus = "field"
name = "belt"
eds = "eds/controller.eds"
serial = 2
script = "belt.lua"
variables = [
  { name = "lamps", type = "UNSIGNED8", object = "A040h:01" },
  { name = "press_running", type = "UNSIGNED8", object = "A4C0h:01" },
  { name = "stop_buttons", type = "UNSIGNED8", object = "A4C0h:02" },
  { name = "press_speed", type = "UNSIGNED16", object = "A580h:01" },
]
)";
constexpr const char* modules = R"(
[[device]]
bus = "field"
name = "io {n}"
eds = "eds/io.eds"
count = 2
serial_first = 3
)";
constexpr const char* press_script = R"(
local speed = 100
device.every(10, function()
  speed = speed + 1
  device.write("speed", speed)
  device.write("running", 1)
end)
)";
constexpr const char* belt_script = R"(
local told = false
device.on_write("press_speed", function(value)
  if not told then print("the press runs at", value > 100, device.read("press_running")) end
  told = true
end)
)";

}  // namespace

// What links need is part of a device's configuration: nothing but the machine file is written by hand.
TEST_F(Link, UpLaysTheLinks) {
  write("plant.toml", std::string(plant_head) + press + belt + modules);
  write("press.lua", press_script);
  write("belt.lua", belt_script);
  const Outcome run = berth({"up", file("linked.toml"), "--sim", file("plant.toml"), "--json"});
  ASSERT_EQ(run.status, 0) << run.err << run.out;
  EXPECT_NE(run.err.find("the press runs at true 1\n"), std::string::npos) << run.err;
  const json said = json::parse(run.out);
  std::size_t configured = 0;
  for (const auto& event : said.at("events")) {
    const bool written = event.at("kind") == "configured" &&
                         event.at("text").get<std::string>().find("of linked.toml written") != std::string::npos;
    if (written) ++configured;
  }
  EXPECT_EQ(configured, 4U) << run.out;
}

// A device's program without a variable that a link needs: the device is not started, and the report says what it
// refused.
TEST_F(Link, S5_4_AProgramWithoutTheVariable) {
  std::string without = belt;
  const std::string line = "  { name = \"press_speed\", type = \"UNSIGNED16\", object = \"A580h:01\" },\n";
  ASSERT_NE(without.find(line), std::string::npos);
  without.erase(without.find(line), line.size());
  write("plant.toml", std::string(plant_head) + press + without + modules);
  write("press.lua", press_script);
  write("belt.lua", "");
  const Outcome run = berth({"up", file("linked.toml"), "--sim", file("plant.toml"), "--timeout", "30 s"});
  EXPECT_EQ(run.status, 1) << run.out;
  EXPECT_NE(run.err.find("slot belt (node-ID 2)"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("its configuration failed: "), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("linked.toml"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("object does not exist"), std::string::npos) << run.err;
  EXPECT_EQ(run.err.find("slot press"), std::string::npos) << "the others run: " << run.err;
}

// A link to an object that is gone, and links in a circle: nothing is sent, and the report says which link it is.
TEST_F(Link, UpRefusesLinksThatCannotBe) {
  write("plant.toml", std::string(plant_head) + modules);
  const auto refused = [&](const std::string& links) {
    write("linked.toml", machine_ + links);
    const Outcome run = berth({"up", file("linked.toml"), "--sim", file("plant.toml"), "--record", file("sent.log")});
    EXPECT_EQ(run.status, 2) << run.out;
    EXPECT_FALSE(fs::exists(file("sent.log")) && fs::file_size(file("sent.log")) > 0);
    return run.err;
  };
  const auto gone = refused("\n[[link]]\nfrom = \"left io/6401h:01\"\nto = [\"press/level\"]\n");
  EXPECT_NE(gone.find("linked.toml:64:1: error: link[5]: left io/6401h:01"), std::string::npos) << gone;
  const auto circle = refused(
      "\n[[link]]\nfrom = \"press/a\"\nto = [\"belt/b\"]\ntype = \"UNSIGNED8\"\n"
      "[[link]]\nfrom = \"belt/b\"\nto = [\"press/a\"]\n");
  EXPECT_NE(circle.find("linked.toml:"), std::string::npos) << circle;
  EXPECT_NE(circle.find("error: link["), std::string::npos) << circle;
  write("linked.toml", machine_);
  EXPECT_EQ(berth({"link", file("linked.toml")}).status, 0) << "a repeat with the links put right heals it";
}

// The plan of the machine file is what `berth up` and `berth link` go on from.
TEST_F(Link, ThePlanOfTheMachineFile) {
  const auto key = machine_.find("name = \"linked\"\n");
  machine_.insert(key, "link_plan = \"kept/plan.toml\"\n");
  write("linked.toml", machine_);
  ASSERT_EQ(berth({"link", file("linked.toml"), "--output", file("kept")}).status, 0);
  // Another variable comes, whose name is before the others': what was there stays where it is.
  write("linked.toml",
        machine_ + "\n[[link]]\nfrom = \"press/before\"\nto = [\"belt/press_before\"]\ntype = \"UNSIGNED16\"\n");
  const Outcome links = berth({"link", file("linked.toml"), "--links"});
  EXPECT_NE(links.out.find("press/speed: UNSIGNED16 input, A100h:01"), std::string::npos) << links.out;
  EXPECT_NE(links.out.find("press/before: UNSIGNED16 input, A100h:02"), std::string::npos) << links.out;
  const Outcome anew = berth({"link", file("linked.toml"), "--links", "--anew"});
  EXPECT_NE(anew.out.find("press/before: UNSIGNED16 input, A100h:01"), std::string::npos) << anew.out;
  write("kept/plan.toml", "format = 2\n");
  EXPECT_EQ(berth({"link", file("linked.toml")}).status, 2);
}

namespace {

/// Two to twelve programmable controllers at 125 kbit/s, each with more keys of its slot.
std::string controllers(unsigned count, const std::string& keys, const std::string& eds = "controller") {
  std::string text = "[machine]\nname = \"bounds\"\n[bus.f]\nport = \"sim\"\nbitrate = 125000\n";
  for (unsigned i = 1; i <= count; ++i) {
    const auto number = std::to_string(i);
    text += "[[slot]]\nbus = \"f\"\nid = " + number + "\nname = \"d" + number + "\"\neds = \"eds/" +
            (i == 1 ? eds : "controller") + ".eds\"\n" + keys;
  }
  return text;
}
std::string linked(const std::string& from, const std::string& to, const std::string& type, const std::string& more) {
  return "[[link]]\nfrom = \"" + from + "\"\nto = [\"" + to + "\"]\ntype = \"" + type + "\"\n" + more;
}
constexpr const char* by_identifier = "queue = \"priority\"\n";

}  // namespace

// Twelve EMCYs may go before it: with half of the deadline as inhibit time it is late, with a shorter one it is not.
TEST_F(Link, AnInhibitTimeThatFitsIsFound) {
  const std::string link = linked("d1/v1", "d2/w1", "UNSIGNED16", "deadline = \"20 ms\"\n");
  write("tight.toml", controllers(12, by_identifier) + link);
  const Outcome run = berth({"link", file("tight.toml"), "--json"});
  ASSERT_EQ(run.status, 0) << run.out << run.err;
  const auto pdo = json::parse(run.out).at("pdos").at(0);
  EXPECT_LT(pdo.at("inhibit_ms").get<double>(), 10) << pdo;
  EXPECT_LE(pdo.at("worst_ms").get<double>(), 20) << pdo;
  // Not said: that is why, and which key says it.
  write("tight.toml", controllers(12, "") + link);
  const Outcome unknown = berth({"link", file("tight.toml")});
  EXPECT_EQ(unknown.status, 1) << unknown.out;
  EXPECT_NE(unknown.err.find("it is not known in which order d1 and 11 more send frames that wait"), std::string::npos)
      << unknown.err;
  EXPECT_NE(unknown.err.find("queue = \"priority\""), std::string::npos) << unknown.err;
}

// What the linker gives a deadline of 12 ms waits behind all others of its device, when that sends in order.
TEST_F(Link, TheBoundKnowsTheQueue) {
  std::string links;
  const unsigned deadlines[] = {12, 100, 250, 600, 1500, 4000};
  for (unsigned i = 0; i < 12; ++i) {
    const auto n = std::to_string(i);
    links +=
        linked("d1/v" + n, "d2/w" + n, "UNSIGNED32", "deadline = \"" + std::to_string(deadlines[i / 2]) + " ms\"\n");
  }
  write("fifo.toml", controllers(2, by_identifier) + links);
  const Outcome priority = berth({"link", file("fifo.toml")});
  EXPECT_EQ(priority.status, 0) << priority.out << priority.err;
  for (const char* const queue : {"queue = \"fifo\"\n", "queue = \"in-order\"\n", ""}) {
    write("fifo.toml", controllers(2, queue) + links);
    const Outcome run = berth({"link", file("fifo.toml")});
    EXPECT_EQ(run.status, 1) << queue << run.out << run.err;
    EXPECT_NE(run.err.find("bus f is too slow for this link: it can take"), std::string::npos) << run.err;
    const bool told = run.err.find("it is not known in which order") != std::string::npos;
    EXPECT_EQ(told, *queue == '\0') << run.err;
    const Outcome analyzed = berth({"analyze", file("fifo.toml")});
    EXPECT_EQ(analyzed.status, 1) << analyzed.out;
    EXPECT_NE(analyzed.out.find("12 MISSED"), std::string::npos) << analyzed.out;
    EXPECT_NE(analyzed.err.find("bus f is too slow for this link"), std::string::npos) << analyzed.err;
  }
}

// A second for one frame: its bound ends behind the second SYNC.
TEST_F(Link, ASynchronousLinkHasTime) {
  std::string machine = controllers(12, "") + "[bus.f.sync]\nperiod = \"10 ms\"\n";
  const std::string more = "transmission = \"sync\"\n";
  write("sync.toml", machine + linked("d1/v1", "d2/w1", "UNSIGNED16", more + "deadline = \"1 s\"\n"));
  const Outcome run = berth({"link", file("sync.toml")});
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  EXPECT_EQ(berth({"analyze", file("sync.toml")}).status, 0) << berth({"analyze", file("sync.toml")}).out;
  write("sync.toml", machine + linked("d1/v1", "d2/w1", "UNSIGNED16", more));
  EXPECT_EQ(berth({"link", file("sync.toml")}).status, 0);
}

// An input that changes all the time fills the bus: both commands say so.
TEST_F(Link, ATpdoWithoutALeastIntervalHasNoBound) {
  std::string eds = read(file("eds/controller.eds"));
  for (std::size_t at = 0; (at = eds.find("sub3]", at)) != std::string::npos;) {
    const auto begin = eds.rfind('[', at);
    at += 5;
    if (eds.compare(begin, 3, "[18") != 0) continue;
    const auto end = std::min(eds.find("\n[", begin), eds.size() - 1);
    eds.erase(begin, end + 1 - begin);
    const auto head = eds.rfind("SubNumber=5", begin);
    eds[head + 10] = '4';
    at = begin;
  }
  write("eds/noinh.eds", eds);
  const auto links = [](const std::string& more) {
    return linked("d1/v1", "d2/w1", "UNSIGNED32", "deadline = \"100 ms\"\n" + more) +
           linked("d3/v3", "d2/w3", "UNSIGNED32", "deadline = \"100 ms\"\n");
  };
  write("unsafe.toml", controllers(3, by_identifier, "noinh") + links(""));
  const Outcome run = berth({"link", file("unsafe.toml")});
  EXPECT_EQ(run.status, 1) << run.out;
  EXPECT_NE(run.err.find("d1/TPDO 1"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("its shortest interval is not known"), std::string::npos) << run.err;
  const Outcome endless = berth({"analyze", file("unsafe.toml")});
  EXPECT_EQ(endless.status, 1);
  EXPECT_NE(endless.out.find("no bound"), std::string::npos) << endless.out;
  // Said: one figure in both.
  write("unsafe.toml", controllers(3, by_identifier, "noinh") + links("inhibit = \"10 ms\"\n"));
  const Outcome kept = berth({"link", file("unsafe.toml"), "--json"});
  ASSERT_EQ(kept.status, 0) << kept.out << kept.err;
  const Outcome analyzed = berth({"analyze", file("unsafe.toml"), "--json"});
  ASSERT_EQ(analyzed.status, 0) << analyzed.out;
  const auto plan = json::parse(kept.out);
  const auto bus = json::parse(analyzed.out).at("buses").at(0);
  EXPECT_DOUBLE_EQ(plan.at("buses").at(0).at("load").get<double>(), bus.at("load").get<double>());
  for (const auto& pdo : plan.at("pdos")) {
    bool found = false;
    for (const auto& message : bus.at("messages")) {
      if (message.at("id") != pdo.at("can_id")) continue;
      EXPECT_DOUBLE_EQ(message.at("worst_ms").get<double>(), pdo.at("worst_ms").get<double>());
      EXPECT_DOUBLE_EQ(message.at("deadline_ms").get<double>(), 100) << "as it is written";
      found = true;
    }
    EXPECT_TRUE(found) << pdo;
  }
}

// Nobody asked for a time: the message has none in `analyze` either.
TEST_F(Link, ALinkWithoutADeadlineIsNeverLate) {
  std::string machine = controllers(2, by_identifier);
  machine.replace(machine.find("125000"), 6, "83333");
  write("calm.toml", machine + linked("d1/v1", "d2/w1", "UNSIGNED16", ""));
  EXPECT_EQ(berth({"link", file("calm.toml")}).status, 0);
  const Outcome run = berth({"analyze", file("calm.toml"), "--json"});
  EXPECT_EQ(run.status, 0) << run.out;
  for (const auto& message : json::parse(run.out).at("buses").at(0).at("messages")) {
    if (message.at("message") != "TPDO 1") continue;
    EXPECT_TRUE(message.at("deadline_ms").is_null()) << message;
    EXPECT_GT(message.at("worst_ms").get<double>(), message.at("period_ms").get<double>()) << "its inhibit time, too";
  }
}

// Four PDOs, 2 ms apart: refused, with what takes most.
TEST_F(Link, MoreThanTheWholeBusIsRefused) {
  std::string links;
  for (const auto& [from, to] :
       {std::pair("d1", "d2"), std::pair("d1", "d3"), std::pair("d2", "d3"), std::pair("d2", "d1")}) {
    const std::string name = std::string(from) + to;
    links += linked(std::string(from) + "/" + name, std::string(to) + "/" + name, "UNSIGNED32", "inhibit = \"2 ms\"\n");
  }
  write("overload.toml", controllers(3, by_identifier) + links);
  const Outcome run = berth({"link", file("overload.toml")});
  EXPECT_EQ(run.status, 1) << run.out;
  EXPECT_NE(run.err.find("bus.f: the bus is too slow: everything on it would take 1"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("% of it; most by TPDO "), std::string::npos) << run.err;
}

TEST_F(Link, WrongUse) {
  EXPECT_EQ(berth({"link", "/no/such.toml"}).status, 2);
  EXPECT_EQ(berth({"link", example("by-eds.toml")}).status, 2) << "it has no link";
  EXPECT_EQ(berth({"link", file("linked.toml"), "--plan", "/no/plan.toml"}).status, 2);
  write("plan.toml", "format = 2\n");
  const Outcome run = berth({"link", file("linked.toml"), "--plan", file("plan.toml")});
  EXPECT_EQ(run.status, 2);
  EXPECT_NE(run.err.find("plan.toml:1:10: error: format"), std::string::npos) << run.err;
  EXPECT_EQ(berth({"link", file("linked.toml"), "--output", "/proc/no/such"}).status, 3);
}

}  // namespace berth::test
