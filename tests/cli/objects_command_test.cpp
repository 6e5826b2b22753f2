// Machines, nodes, objects and values as a person names them on the command line.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "berth/eds/xdd.hpp"
#include "command_fixture.hpp"

namespace berth::test {
namespace {

// CiA 301's objects are known without a description: their names, types and units.
TEST_F(Command, SdoKnowsNodesAndObjectsByName) {
  const Json serial = reply({"sdo", "read", "drive", "Identity object/Serial number"}, 0, true);
  EXPECT_EQ(serial.at("node"), 9);
  EXPECT_EQ(serial.at("index"), "0x1018");
  EXPECT_EQ(serial.at("sub"), 4);
  EXPECT_EQ(serial.at("value"), 0x30);
  EXPECT_EQ(reply({"sdo", "read", "line/drive", "1018sub4"}, 0, true), serial);
  const Json written = reply({"sdo", "write", "Drive", "producer", "0.5 s"}, 0, true);
  EXPECT_EQ(written.at("bytes"), "F4 01");
  EXPECT_EQ(written.at("name"), "Producer heartbeat time");
  EXPECT_EQ(written.at("value"), 500);
  EXPECT_EQ(written.at("time"), "500 ms");
  EXPECT_EQ(reply({"nmt", "preop", "drive"}, 0, true).at("node"), 9);
}

TEST_F(Command, SdoOfSeveralObjects) {
  const Json read = reply({"sdo", "read", "drive", "1018h:04", "7777h", "1017h"}, 1, true);
  ASSERT_EQ(read.at("objects").size(), 3U);
  EXPECT_EQ(read.at("objects").at(0).at("value"), 0x30);
  EXPECT_EQ(read.at("objects").at(1).at("index"), "0x7777");
  EXPECT_EQ(read.at("objects").at(1).at("error").at("abort_code"), "0x06020000");
  EXPECT_EQ(read.at("objects").at(2).at("value"), 100) << "a refusal is an answer: the others are read still";
  const Json written = reply({"sdo", "write", "drive", "1017h=200", "1018h:01=1", "1016h:01=0"}, 1, true);
  ASSERT_EQ(written.at("objects").size(), 2U) << "nothing is written after a failure: " << written;
  EXPECT_EQ(written.at("objects").at(0).at("bytes"), "C8 00");
  EXPECT_EQ(written.at("objects").at(1).at("error").at("abort_code"), "0x06010002");
}

// A value that a device holds, what its script says, and words of a request.
TEST_F(Command, ALineFeedFromOutsideForgesNoLine) {
  const std::string eds = folder.write("teller.eds",
                                       "[ManufacturerObjects]\nSupportedObjects=1\n1=0x2000\n"
                                       "[2000]\nParameterName=Words\nObjectType=7\nDataType=9\nAccessType=rw\n");
  folder.write("teller.lua", "device.write(\"2000h\", \"x\\nforged\")\nprint(\"said\\nforged\")\n");
  const std::string of_c = "serial = 0x30\n";
  std::string devices = small_plant;
  devices.replace(devices.find(of_c), of_c.size(), of_c + "eds = \"teller.eds\"\nscript = \"teller.lua\"\n");
  folder.write("plant.toml", devices);
  const auto no_line_begins = [](const std::string& text) { return !contains("\n" + text, "\nforged"); };

  for (const Words& words :
       {Words{"sdo", "read", "9", "2000h", "-t", "vs"}, Words{"status"}, Words{"emcy", "9"},
        Words{"sdo", "read", "no\nforged", "1017h"}, Words{"sdo", "read", "9", "a\nforged", "1017h"}, Words{"history"},
        Words{"sdo", "dump", "9", "--eds", "drive\nforged=" + eds}}) {
    Words all = words;
    all.insert(all.end(), {"--machine", machine, "--sim", plant, "--up"});
    const Outcome outcome = berth(all);
    EXPECT_TRUE(no_line_begins(outcome.out)) << words[0] << "\n" << outcome.out;
    EXPECT_TRUE(no_line_begins(outcome.err)) << words[0] << "\n" << outcome.err;
  }
  const Outcome value = berth({"sdo", "read", "9", "2000h", "-t", "vs", "--machine", machine, "--sim", plant, "--up"});
  EXPECT_TRUE(contains(value.out, "x\\u000aforged")) << value.out << value.err;
  const Outcome up = berth({"up", machine, "--sim", plant, "--until", "operational"});
  EXPECT_TRUE(contains(up.err, "said\\u000aforged")) << up.out << up.err;
  const Outcome json = run({"sdo", "read", "9", "2000h", "-t", "vs"}, true);
  EXPECT_EQ(Json::parse(json.out).at("value"), "x\nforged") << "as it came";
}

// What `sdo read` prints of an object is taken back as it stands, from the line and from the JSON.
TEST_F(Command, WhatIsPrintedCanBePastedBack) {
  const Outcome line = berth({"sdo", "read", "9", "1018h:3", "--machine", machine, "--sim", plant, "--up"});
  EXPECT_EQ(line.status, 0) << line.err;
  std::istringstream words(line.out);
  std::string word;
  std::string object;
  while (words >> word) {
    if (word.find("h:") != std::string::npos) object = word;
  }
  EXPECT_EQ(object, "1018h:03");
  EXPECT_EQ(reply({"sdo", "read", "9", object}, 0, true).at("value"), 3);
  const Json json = reply({"sdo", "read", "9", "1018h:3"}, 0, true);
  EXPECT_EQ(reply({"sdo", "read", "9", json.at("index"), std::to_string(json.at("sub").get<int>())}, 0, true), json);
  EXPECT_EQ(reply({"sdo", "read", "9", json.at("name")}, 0, true), json);
  const std::string refused = reply({"sdo", "read", "9", "7777h:1"}, 1, true).at("error").at("object");
  EXPECT_EQ(reply({"sdo", "read", "9", refused}, 1, true).at("error").at("object"), refused);
}

TEST_F(Command, ABareIndexIsRefusedWithBothReadings) {
  for (const Words& words : std::vector<Words>{{"sdo", "read", "2", "1018"}, {"sdo", "write", "2", "1018", "1", "5"}}) {
    const Outcome bare = run(words);
    EXPECT_EQ(bare.status, 2) << bare.out;
    EXPECT_TRUE(contains(bare.out, "1018h") && contains(bare.out, "03FAh")) << bare.out;
  }
  const Outcome sub = run({"sdo", "read", "2", "1A00h", "10"});
  EXPECT_EQ(sub.status, 2);
  EXPECT_TRUE(contains(sub.out, "0Ah") && contains(sub.out, "10h")) << sub.out;
}

// Names, types and limits of the slot's own description.
TEST_F(Command, SdoByTheSlotsDescription) {
  const std::string eds = contents(example("eds/sensor.eds"));
  const std::string own =
      "[ManufacturerObjects]\nSupportedObjects=2\n1=0x2100\n2=0x2101\n\n[2100]\nParameterName=Ventil \"⚙\" auf/zu\n"
      "ObjectType=0x7\nDataType=0x0003\nAccessType=rw\nDefaultValue=-7\nPDOMapping=0\nLowLimit=-100\nHighLimit=100\n\n"
      "[2101]\nParameterName=Ventilzahl\nObjectType=0x7\nDataType=0x0005\nAccessType=rw\nDefaultValue=2\nPDOMapping="
      "0\n";
  const auto cut = eds.find("[ManufacturerObjects]");
  const auto end = cut == std::string::npos ? cut : eds.find("\n[", cut + 1);
  ASSERT_TRUE(cut == std::string::npos || end != std::string::npos);
  const std::string rest = cut == std::string::npos ? eds : eds.substr(0, cut) + eds.substr(end + 1);
  const std::string file = folder.write("valve.eds", rest + "\n" + own);
  const std::string one =
      folder.write("one.toml",
                   "[machine]\nname = \"one\"\n[bus.line]\nport = \"sim\"\nbitrate = 500_000\n[[slot]]\n"
                   "bus = \"line\"\nid = 5\nname = \"valve\"\neds = \"valve.eds\"\n");
  const std::string world = folder.write("one.plant.toml",
                                         "[bus.line]\n[[device]]\nbus = \"line\"\nname = \"v\"\n"
                                         "eds = \"valve.eds\"\nserial = 1\nresponse = \"1 ms\"\n");
  const auto ask = [&](Words words) {
    words.insert(words.end(), {"--machine", one, "--sim", world, "--up", "--json"});
    const Outcome outcome = berth(words);
    return std::pair(outcome.status, Json::parse(outcome.out, nullptr, false));
  };
  const auto [status, value] = ask({"sdo", "read", "valve", "Ventil \"⚙\" auf/zu"});
  EXPECT_EQ(status, 0) << value;
  EXPECT_EQ(value.at("value"), -7);
  EXPECT_EQ(value.at("type"), "INTEGER16");
  const auto [two, ambiguous] = ask({"sdo", "read", "valve", "ventil"});
  EXPECT_EQ(two, 2);
  const std::string candidates = ambiguous.at("error").at("message");
  EXPECT_TRUE(contains(candidates, "2100h") && contains(candidates, "2101h Ventilzahl")) << candidates;
  const auto [outside, limit] = ask({"sdo", "write", "valve", "2100h", "101"});
  EXPECT_EQ(outside, 2);
  EXPECT_TRUE(contains(limit.at("error").at("message"), "above 100")) << limit;
  EXPECT_EQ(ask({"sdo", "write", "valve", "2100h", "-100"}).first, 0);
}

// A value and its unit as two words: the message has the line that does it.
TEST_F(Command, AUnitOutsideOfTheQuotesIsTold) {
  const auto refused = [&](Words words) {
    words.insert(words.begin(), {"sdo", "write", "drive"});
    words.insert(words.end(), {"--machine", machine, "--sim", plant, "--up"});
    const Outcome outcome = berth(words);
    EXPECT_EQ(outcome.status, 2) << outcome.out;
    return outcome.err;
  };
  EXPECT_TRUE(contains(refused({"1017h", "3", "s"}), "put value and unit in quotes: \"3 s\""))
      << refused({"1017h", "3", "s"});
  EXPECT_TRUE(contains(refused({"1017h", "0", "500", "ms"}), "put value and unit in quotes: \"500 ms\""));
  EXPECT_FALSE(contains(refused({"1017h", "0", "xyz"}), "in quotes"));
}

// An XDD says units and names of values: read, written and refused by them.
TEST_F(Command, UnitsAndNamesOfValuesOfAnXdd) {
  Outcome made = berth({"eds", "convert", example("eds/sensor.eds"), folder.file("heater.xdd")});
  ASSERT_EQ(made.status, 0) << made.err;
  std::string xdd = contents(folder.file("heater.xdd"));
  const std::string process =
      "<co:ApplicationProcess><co:parameterList>"
      "<co:parameter uniqueID=\"P1\" access=\"readWrite\"><label lang=\"en\">t</label><INT/>"
      "<co:unit multiplier=\"0.1\"><label lang=\"en\">°C</label></co:unit></co:parameter>"
      "<co:parameter uniqueID=\"P2\" access=\"readWrite\"><label lang=\"en\">m</label><USINT/><co:allowedValues>"
      "<co:value value=\"0\"><label lang=\"en\">Off</label></co:value>"
      "<co:value value=\"2\"><label lang=\"en\">Heat &quot;⚙&quot;</label></co:value>"
      "</co:allowedValues></co:parameter></co:parameterList></co:ApplicationProcess>";
  const auto device = xdd.find("</ProfileBody>");
  ASSERT_NE(device, std::string::npos);
  xdd.insert(device, process);
  const auto list = xdd.find("</co:CANopenObjectList>");
  ASSERT_NE(list, std::string::npos);
  xdd.insert(list,
             "<CANopenObject index=\"5F00\" name=\"Set point\" objectType=\"7\" uniqueIDRef=\"P1\"/>"
             "<CANopenObject index=\"5F01\" name=\"Mode\" objectType=\"7\" uniqueIDRef=\"P2\"/>");
  folder.write("heater.xdd", xdd);
  const std::string one = folder.write("one.toml",
                                       "[machine]\nname = \"one\"\n[bus.line]\nport = \"sim\"\nbitrate = 500_000\n"
                                       "[[slot]]\nbus = \"line\"\nid = 5\nname = \"heater\"\neds = \"heater.xdd\"\n");
  const std::string world = folder.write("one.plant.toml",
                                         "[bus.line]\n[[device]]\nbus = \"line\"\nname = \"h\"\n"
                                         "eds = \"heater.xdd\"\nserial = 1\nresponse = \"1 ms\"\n");
  const auto ask = [&](Words words) {
    words.insert(words.end(), {"--machine", one, "--sim", world, "--up", "--json"});
    const Outcome outcome = berth(words);
    return std::pair(outcome.status, Json::parse(outcome.out, nullptr, false));
  };
  const auto [done, warm] = ask({"sdo", "write", "heater", "Set point", "23.5 °C"});
  EXPECT_EQ(done, 0) << warm;
  EXPECT_EQ(warm.at("bytes"), "EB 00") << warm;
  EXPECT_EQ(warm.at("quantity"), "23.5 °C") << warm;
  const auto [named, heat] = ask({"sdo", "write", "heater", "Mode", "heat"});
  EXPECT_EQ(named, 0) << heat;
  EXPECT_EQ(heat.at("meaning"), "Heat \"⚙\"") << heat;
  const auto [wrong, candidates] = ask({"sdo", "write", "heater", "Mode", "Cool"});
  EXPECT_EQ(wrong, 2);
  const std::string message = candidates.at("error").at("message");
  EXPECT_TRUE(contains(message, "\"Off\" (0)") && contains(message, "(2)")) << message;
  EXPECT_EQ(ask({"sdo", "write", "heater", "Mode", "1"}).first, 2) << "not among those allowed";
  EXPECT_EQ(ask({"sdo", "write", "heater", "Mode", "1", "--anyway"}).first, 0);
  EXPECT_EQ(ask({"sdo", "write", "heater", "Set point", "23 bar"}).first, 2);
  const Outcome set = berth({"sdo", "write", "heater", "Set point", "23.5 °C", "-m", one, "--sim", world, "--up"});
  EXPECT_TRUE(contains(set.out, "written: 235 = 23.5 °C")) << set.out << set.err;
  // Its EDS has 1A00sub1 = 60040020h.
  const auto [mapped, entry] = ask({"sdo", "read", "heater", "1A00h:01"});
  EXPECT_EQ(mapped, 0) << entry;
  EXPECT_EQ(entry.at("meaning"), "6004h:00, 32 bit") << entry;
  const Outcome read = berth({"sdo", "read", "heater", "Mode", "--machine", one, "--sim", world, "--up"});
  EXPECT_TRUE(contains(read.out, "0 (0x00) = Off")) << read.out;
  const Outcome shown = berth({"eds", "show", folder.file("heater.xdd"), "5F01h"});
  EXPECT_TRUE(contains(shown.out, "0 = Off")) << shown.out;
  const Outcome unit = berth({"eds", "show", folder.file("heater.xdd"), "5F00h", "--json"});
  EXPECT_EQ(Json::parse(unit.out).at("objects").at(0).at("subs").at(0).at("unit"), "0.1 °C") << unit.out;
}

// A whole device as a table, as JSON and as the DCF that brings another to the same.
TEST_F(Command, S5_22_SdoDumpReadsAllThatCanBeRead) {
  const Words world{"--machine", example("by-eds.toml"), "--sim", example("by-eds.plant.toml"), "--up"};
  const auto dump = [&](Words words) {
    words.insert(words.begin(), {"sdo", "dump"});
    words.insert(words.end(), world.begin(), world.end());
    return berth(words);
  };
  const Outcome json = dump({"drive 10", "--json"});
  ASSERT_EQ(json.status, 0) << json.out << json.err;
  const Json objects = Json::parse(json.out).at("objects");
  const auto find = [&](const std::string& index, int sub) {
    const auto it =
        std::ranges::find_if(objects, [&](const Json& o) { return o.at("index") == index && o.at("sub") == sub; });
    return it == objects.end() ? Json() : *it;
  };
  // The dictionary browser shows every object that the device's description has and that can be read, and no other.
  const auto eds = eds::read_any_file(example("eds/drive.eds"));
  ASSERT_TRUE(eds.usable());
  std::size_t described = 0;
  for (const auto& object : eds.file.description->objects()) {
    for (const auto& sub : eds.file.description->subs(object)) {
      const Json shown = find(fmt::format("0x{:04X}", object.index), sub.sub);
      if (!od::readable(sub.access)) {
        EXPECT_TRUE(shown.is_null()) << shown;
        continue;
      }
      ++described;
      const bool answered =
          shown.is_object() && (shown.contains("value") || shown.contains("bytes") || shown.contains("abort_code"));
      if (shown.contains("value")) {
        EXPECT_EQ(shown.at("type"), od::name(sub.type)) << shown;
      }
      EXPECT_TRUE(answered) << object.index << ":" << int{sub.sub} << " " << shown;
    }
  }
  EXPECT_GT(described, 30U);
  EXPECT_EQ(objects.size(), described);
  EXPECT_EQ(find("0x1018", 4).at("value"), 0x77);
  EXPECT_EQ(find("0x1018", 4).at("name"), "Identity object/Serial number");
  EXPECT_EQ(find("0x1017", 0).at("time"), "500 ms");
  const Outcome table = dump({"10"});
  EXPECT_TRUE(contains(table.out, "1018h:04  Identity object/Serial number")) << table.out;
  const std::string file = folder.file("drive.dcf");
  const Outcome dcf = dump({"drive 10", "--to", "dcf", "-o", file});
  EXPECT_EQ(dcf.status, 0) << dcf.err;
  EXPECT_TRUE(contains(contents(file), "[DeviceComissioning]")) << contents(file);
  const Outcome show = berth({"eds", "show", file, "1017h", "--json"});
  const Json shown = Json::parse(show.out, nullptr, false);
  ASSERT_TRUE(shown.is_object()) << show.out << show.err;
  EXPECT_EQ(shown.at("objects").at(0).at("subs").at(0).at("value"), "500") << shown;
}

TEST_F(Command, SdoDumpOfADeviceWithoutADescription) {
  const Json dump = reply({"sdo", "dump", "drive"}, 0, true);
  EXPECT_EQ(dump.at("described"), false);
  const Json& objects = dump.at("objects");
  EXPECT_TRUE(std::ranges::any_of(objects, [](const Json& o) {
    return o.at("index") == "0x1018" && o.at("sub") == 4 && o.value("value", 0) == 0x30;
  })) << dump;
  EXPECT_TRUE(std::ranges::none_of(objects, [](const Json& o) { return o.contains("abort_code"); }))
      << "what it does not have is not told";
}

TEST_F(Command, WatchTellsAValueAgainAndAgain) {
  const Outcome watched = run({"sdo", "read", "9", "1018h:04", "--watch", "100 ms", "--timeout", "1 s"}, true);
  EXPECT_EQ(watched.status, 0) << watched.out << watched.err;
  std::istringstream lines(watched.out);
  std::string line;
  int values = 0;
  while (std::getline(lines, line)) values += Json::parse(line).at("value") == 0x30 ? 1 : 0;
  EXPECT_GE(values, 5) << watched.out;
  EXPECT_LE(values, 11) << watched.out;
}

TEST_F(Command, FilesAreWrittenAndReadAsTheyAre) {
  const std::string file = folder.file("serial.bin");
  const Outcome read =
      berth({"sdo", "read", "9", "1018h:04", "--file", file, "--machine", machine, "--sim", plant, "--up"});
  EXPECT_EQ(read.status, 0) << read.err;
  EXPECT_EQ(contents(file), std::string("\x30\0\0\0", 4));
  const std::string period = folder.write("period.bin", std::string("\xF4\x01", 2));
  EXPECT_EQ(reply({"sdo", "write", "9", "1017h", "--file", period}, 0, true).at("bytes"), "F4 01");
  EXPECT_EQ(reply({"sdo", "write", "9", "1017h", "--file", folder.file("none")}, 2, true).contains("error"), true);
}

// CiA 301 §7.5.2.13, §7.5.2.14: "save" and "load", once.
TEST_F(Command, StoreAndRestore) {
  const auto sent = [&](Words words) {
    words.insert(words.end(), {"--dry-run", "--up", "--machine", machine, "--sim", plant});
    return berth(words).out;
  };
  EXPECT_TRUE(contains(sent({"store", "drive"}), " 609#2310100173617665")) << sent({"store", "drive"});
  EXPECT_TRUE(contains(sent({"restore", "drive", "communication"}), " 609#231110026C6F6164"));
  EXPECT_EQ(run({"store", "drive", "everything"}).status, 2);
  EXPECT_EQ(run({"store", "drive", "128"}).status, 2);
}

TEST_F(Command, SendGivesFramesAsTheyAreWritten) {
  const Json sent = reply({"send", "000#8009", "609#4017100000000000"}, 0, true);
  ASSERT_EQ(sent.at("frames").size(), 2U) << sent;
  EXPECT_EQ(sent.at("frames").at(1).at("frame"), "609#4017100000000000");
  for (const char* wrong : {"", "609", "609#4", "xyz#00", "609#00 11"})
    EXPECT_EQ(run({"send", wrong}).status, 2) << wrong;
  EXPECT_EQ(berth({"send", "000#8009", "--dry-run", "--machine", machine}).out, "000#8009\n");
}

TEST_F(Command, EmergenciesInWords) {
  const Json quiet = reply({"emcy", "drive"}, 0, true);
  EXPECT_EQ(quiet.at("register"), "0x00");
  EXPECT_EQ(quiet.at("text"), "no error");
  EXPECT_EQ(run({"emcy"}).status, 2);
  EXPECT_EQ(quiet.at("profile"), 0) << "its 1000h names no device profile";
  const Json heard = reply({"emcy", "--listen", "2 s"}, 0, true);
  EXPECT_EQ(heard.at("listened_s"), 2);
}

// The machine file stands by itself, or lies in the folder.
TEST_F(Command, TheMachineFileOfTheFolder) {
  const Outcome by_itself = berth({"sdo", "read", "9", "1018h:04", machine, "--sim", plant, "--up", "--json"});
  EXPECT_EQ(by_itself.status, 0) << by_itself.out << by_itself.err;
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder.file(""));
  const Outcome only = berth({"scan", "--sim", plant});
  const std::string second = folder.write("second.toml", small_machine);
  const Outcome two = berth({"scan", "--sim", plant});
  folder.write("berth.toml", small_machine);
  const Outcome named = berth({"scan", "--sim", plant});
  const Outcome json = run({"scan"});
  // Those that no port by itself is enough for, too.
  const Outcome analyzed = berth({"analyze"});
  const Outcome documented = berth({"document", "-o", "pages"});
  const Outcome linked = berth({"link"});
  std::filesystem::remove("berth.toml");
  const Outcome which = berth({"link"});
  std::filesystem::current_path(before);
  EXPECT_EQ(analyzed.status, 0) << analyzed.err;
  EXPECT_EQ(documented.status, 0) << documented.err;
  EXPECT_FALSE(contains(linked.err, "--port")) << linked.err;
  EXPECT_EQ(which.status, 2);
  EXPECT_TRUE(contains(which.err, "name it") && !contains(which.err, "--port")) << which.err;
  EXPECT_EQ(only.status, 0) << only.err;
  EXPECT_TRUE(contains(only.err, "machine.toml")) << "it is said which: " << only.err;
  EXPECT_EQ(two.status, 2) << "which of the two?";
  EXPECT_TRUE(contains(two.err, "this folder has machine.toml, second.toml")) << two.err;
  EXPECT_EQ(named.status, 0) << named.err;
  EXPECT_FALSE(contains(named.err, "machine file: ")) << "the usual name needs no word: " << named.err;
  EXPECT_TRUE(json.err.empty()) << json.err;
}

TEST_F(Command, PortsNeedNoMachine) {
  const Outcome ports = berth({"ports", "--json"});
  EXPECT_EQ(ports.status, 0) << ports.err;
  EXPECT_TRUE(Json::parse(ports.out).at("ports").is_array());
  const Outcome wrong = berth({"scan", "--port", "nonsense"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_TRUE(contains(wrong.err, "berth ports")) << wrong.err;
  EXPECT_TRUE(contains(berth({"scan", "--port", "slcan:/dev/ttyACM9"}).err, "--bitrate"));
  EXPECT_EQ(berth({"scan", "--port", "no-can0"}).status, 3) << "guessed to be an interface, which is not there";
}

}  // namespace
}  // namespace berth::test
