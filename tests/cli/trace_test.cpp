// `berth trace` from the outside: formats, names, filters, conversions, a file that grows, a live bus.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <algorithm>
#include <string>
#include <vector>

#include <chrono>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "machines.hpp"
#include "process.hpp"

namespace berth::test::trace_tests {
namespace {

using Json = nlohmann::json;
using namespace std::chrono_literals;

const char* const sdo_log =
    "(0000000001.000000) can0 705#00\n"
    "(0000000001.001000) can0 605#4018100100000000\n"
    "(0000000001.001500) can0 706#05\n"
    "(0000000001.002000) can0 585#431810011F000000\n"
    "(0000000001.003000) can0 606#2B171000F4010000\n"
    "(0000000001.004000) can0 586#8017100022000008\n"
    "(0000000001.005000) can1 085#3081110000000000\n";

std::vector<Json> lines_of(const std::string& text) {
  std::vector<Json> all;
  std::istringstream in(text);
  std::string line;
  while (std::getline(in, line)) all.push_back(Json::parse(line));
  return all;
}

// Nothing printed and no word looks like a file without frames.
TEST(TraceCommand, AFilterThatLetsNothingThroughIsTold) {
  const Folder folder;
  const auto log = folder.write("t.log", sdo_log);
  for (const Words& words : {Words{"trace", log, "--node", "99"}, Words{"trace", log, "--bus", "can7"},
                             Words{"trace", log, "--service", "pdo"}}) {
    const auto nothing = berth(words);
    EXPECT_TRUE(nothing.out.empty()) << nothing.out;
    EXPECT_NE(nothing.err.find("no row: none of 7 frames is what was asked for"), std::string::npos)
        << words.back() << nothing.err;
  }
  EXPECT_TRUE(berth({"trace", log, "--node", "5"}).err.empty());
  EXPECT_TRUE(berth({"trace", log, "--node", "99", "--json"}).err.empty());
}

// A terminal breaks a row anywhere; what goes into a pipe has it whole.
TEST(TraceCommand, ARowOfAFileIsOneLineOfATerminal) {
  const Folder folder;
  const auto log = folder.write("t.log", sdo_log);
  Background shown({"trace", log}, OnTerminal{.columns = 60, .rows = 24, .colours = false});
  const Outcome ended = shown.end();
  std::istringstream lines(ended.out);
  std::vector<std::string> rows;
  for (std::string line; std::getline(lines, line);) {
    if (line.ends_with('\r')) line.pop_back();
    EXPECT_LE(line.size(), 60U) << line;
    rows.push_back(line);
  }
  ASSERT_EQ(rows.size(), 5U) << ended.out;
  EXPECT_TRUE(rows[0].starts_with("    1.0000 ")) << "as the log counts: " << rows[0];
  EXPECT_NE(ended.out.find("= 31"), std::string::npos) << "the value stays: " << ended.out;
}

TEST(TraceCommand, ATransferIsOneRow) {
  const Folder folder;
  const auto log = folder.write("t.log", sdo_log);
  const auto shown = berth({"trace", log});
  EXPECT_EQ(shown.status, 0) << shown.err;
  EXPECT_NE(
      shown.out.find("SDO read node 5 1018h:01 Identity object.Vendor-ID = 31 (0x0000001F)  [2 frames, 1.000 ms]"),
      std::string::npos)
      << shown.out;
  EXPECT_NE(shown.out.find("SDO write node 6 1017h:00 Producer heartbeat time = 500 (0x01F4): abort by the server, "
                           "08000022h"),
            std::string::npos)
      << shown.out;
  EXPECT_EQ(std::ranges::count(shown.out, '\n'), 5);
  const auto frames = berth({"trace", log, "--frames"});
  EXPECT_EQ(std::ranges::count(frames.out, '\n'), 7);
  const auto rows = lines_of(berth({"trace", log, "--json"}).out);
  ASSERT_EQ(rows.size(), 5U);
  EXPECT_EQ(rows[2].at("object"), "1018h:01");
  EXPECT_EQ(rows[2].at("bytes"), "1F 00 00 00");
  EXPECT_EQ(rows[2].at("frames"), 2);
  EXPECT_DOUBLE_EQ(rows[2].at("began_s").get<double>(), 1.001);
  EXPECT_EQ(rows[3].at("abort"), "08000022");
  EXPECT_EQ(rows[4].at("bus"), "can1");
  EXPECT_EQ(rows[4].at("service"), "emcy");
  EXPECT_EQ(rows[4].at("code"), "8130");
  EXPECT_EQ(rows[4].at("frame"), "085#3081110000000000");
}

TEST(TraceCommand, Filters) {
  const Folder folder;
  const auto log = folder.write("t.log", sdo_log);
  const auto rows = [&](Words words) {
    words.insert(words.begin(), {"trace", log});
    const auto run = berth(words);
    EXPECT_EQ(run.status, 0) << run.err;
    return std::ranges::count(run.out, '\n');
  };
  EXPECT_EQ(rows({"--node", "6"}), 2);
  EXPECT_EQ(rows({"--node", "5", "--node", "6"}), 5);
  EXPECT_EQ(rows({"--service", "sdo"}), 2);
  EXPECT_EQ(rows({"--service", "heartbeat,emcy"}), 3);
  EXPECT_EQ(rows({"--text", "ABORT"}), 1);
  EXPECT_EQ(rows({"--object", "1018h"}), 1);
  EXPECT_EQ(rows({"--object", "1018sub1", "--object", "0x1017"}), 2);
  EXPECT_EQ(rows({"--object", "1018h:02"}), 0);
  EXPECT_EQ(rows({"--object", "identity object/vendor"}), 1);
  const auto bare = berth({"trace", log, "--object", "1018"});
  EXPECT_EQ(bare.status, 2);
  EXPECT_NE(bare.err.find("03FAh"), std::string::npos) << bare.err;
  EXPECT_EQ(rows({"--bus", "can1"}), 1);
  EXPECT_EQ(rows({"--after", "1.003"}), 2);
  EXPECT_EQ(rows({"--before", "+0.0015", "--service", "heartbeat"}), 2);
  const auto wrong = berth({"trace", log, "--service", "telepathy"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_NE(wrong.err.find("heartbeat"), std::string::npos) << wrong.err;
  EXPECT_EQ(berth({"trace", log, "--after", "noon"}).status, 2);
  // What is converted is filtered too, by every frame of the service.
  const auto out = folder.file("sdo.log");
  const auto run = berth({"trace", log, "--service", "sdo", "-o", out});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(std::ranges::count(contents(out), '\n'), 4);
  EXPECT_NE(run.out.find("4 frames of 7"), std::string::npos) << run.out;
}

std::vector<double> times_of(const std::string& json) {
  std::vector<double> times;
  for (const auto& row : lines_of(json)) times.push_back(row.at("at_s").get<double>());
  return times;
}

// Several buses, each with an own clock's small lateness; a request that nobody answers, one that another replaces.
TEST(TraceCommand, RowsStandInTheOrderOfTheirTimes) {
  const Folder folder;
  const auto log = folder.write("t.log",
                                "(0000000001.000000) can0 605#4018100100000000\n"  // nobody answers until the end
                                "(0000000001.400000) can1 706#05\n"                // stands before earlier ones
                                "(0000000001.100000) can0 707#05\n"
                                "(0000000001.200000) can0 603#4017100000000000\n"  // replaced by the next of 603
                                "(0000000001.150000) can2 708#05\n"
                                "(0000000001.500000) can0 603#4018100000000000\n"
                                "(0000000001.600000) can0 583#4F18100004000000\n"
                                "(0000000001.600000) can1 709#05\n"
                                "(0000000001.600000) can0 70A#05\n");
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{}, {"--frames"}, {"--node", "3,5,6,7,8,9,10"}}) {
    std::vector<std::string> words{"trace", log, "--json"};
    words.insert(words.end(), more.begin(), more.end());
    const auto shown = berth(words);
    EXPECT_EQ(shown.status, 0) << shown.err;
    const auto times = times_of(shown.out);
    EXPECT_EQ(times.size(), more == std::vector<std::string>{"--frames"} ? 9U : 8U) << shown.out;
    EXPECT_TRUE(std::ranges::is_sorted(times)) << shown.out;
  }
  const auto rows = lines_of(berth({"trace", log, "--json"}).out);
  ASSERT_EQ(rows.size(), 8U);
  EXPECT_EQ(rows[0].at("node"), 5) << "the transfer that never ended";
  EXPECT_EQ(rows[3].at("object"), "1017h:00") << "the one that was replaced";
  EXPECT_EQ(rows[6].at("bus"), "can1") << "of one time, the order of the file stays";
  EXPECT_EQ(rows[7].at("node"), 10);
  const auto table = berth({"trace", log, "--table"}).out;
  EXPECT_NE(table.find("Raw Message\n1\t0x605"), std::string::npos) << table;
}

// Longer than the rows that are held: the order is kept by pieces, and the rest of a log that begins anew is counted.
TEST(TraceCommand, ALongFileWhoseLinesAreOutOfOrder) {
  const Folder folder;
  std::string text;
  for (int i = 0; i < 20000; ++i) {
    const int at = i % 2 == 0 ? i + 1 : i - 1;  // each pair the wrong way round
    text += fmt::format("({:010}.{:03}000) can{} 70{}#05\n", 1 + at / 1000, at % 1000, i % 2, 1 + i % 9);
  }
  const auto shown = berth({"trace", folder.write("t.log", text), "--json"});
  EXPECT_EQ(shown.status, 0) << shown.err;
  const auto times = times_of(shown.out);
  EXPECT_EQ(times.size(), 20000U);
  EXPECT_TRUE(std::ranges::is_sorted(times));
  const auto twice = berth({"trace", folder.write("twice.log", text + text)});
  EXPECT_EQ(std::ranges::count(twice.out, '\n'), 40000);
  EXPECT_NE(twice.err.find("rows come out of order"), std::string::npos) << twice.err;
}

TEST(TraceCommand, ConvertsThroughEveryFormatAndBack) {
  const Folder folder;
  const auto log = folder.write("t.log",
                                "(1436509052.249713) can0 7E5#5100000000800000 R\n"
                                "(1436509052.250001) backbone 1F900135# T\n"
                                "(1436509052.250900) can0 123##1AABB R\n");
  std::string last = log;
  for (const char* name : {"a.pcapng", "b.asc", "c.trc", "d.pcapng", "e.log"}) {
    const auto next = folder.file(name);
    const auto run = berth({"trace", last, "-o", next});
    ASSERT_EQ(run.status, 0) << name << run.err;
    EXPECT_EQ(run.err, "") << name;
    last = next;
  }
  EXPECT_EQ(contents(last), contents(log));
  const auto lossy = berth({"trace", log, "--to", "trc1.1", "-o", folder.file("x.trc"), "--json"});
  ASSERT_EQ(lossy.status, 0) << lossy.err;
  const auto json = Json::parse(lossy.out);
  EXPECT_EQ(json.at("from"), "candump");
  EXPECT_EQ(json.at("frames"), 3);
  ASSERT_EQ(json.at("lost").size(), 3U);
  EXPECT_NE(json.at("lost")[0].get<std::string>().find("1 FD frames"), std::string::npos);
  EXPECT_EQ(berth({"trace", log, "-o", folder.file("x.xyz")}).status, 2);
  EXPECT_EQ(berth({"trace", log, "-o", folder.file("none/x.asc")}).status, 3);
  EXPECT_EQ(berth({"trace", log, "--to", "yaml"}).status, 2);
  EXPECT_EQ(berth({"trace", log, "--to", "candump", "--no-directions"}).out,
            "(1436509052.249713) can0 7E5#5100000000800000\n(1436509052.250001) backbone 1F900135#\n"
            "(1436509052.250900) can0 123##1AABB\n");
}

TEST(TraceCommand, WrongLinesAreNamedAndNothingElseIsLost) {
  const Folder folder;
  const auto log = folder.write("t.asc",
                                "date Fri Jul 10 06:17:32.249 2015\nbase hex  timestamps absolute\n"
                                "   0.1 1  7G1  Rx   d 1 00\n   0.2 1  705  Rx   d 1 00\n");
  const auto run = berth({"trace", log});
  EXPECT_EQ(run.status, 2);
  EXPECT_NE(run.err.find("t.asc:3:11: error"), std::string::npos) << run.err;
  EXPECT_NE(run.out.find("Boot up of node 5"), std::string::npos) << run.out;
  const auto json = lines_of(berth({"trace", log, "--json"}).out);
  ASSERT_EQ(json.size(), 2U);
  EXPECT_EQ(json[0].at("finding").at("line"), 3);
  std::string many;
  for (int i = 0; i < 1000; ++i) many += "(x\n";
  const auto bad = berth({"trace", folder.write("many.log", many + "(1.000000) can0 705#00\n")});
  EXPECT_EQ(bad.status, 2);
  EXPECT_NE(bad.err.find("900 more findings"), std::string::npos) << bad.err;
  EXPECT_NE(bad.out.find("Boot up"), std::string::npos);
  EXPECT_EQ(berth({"trace", folder.write("b.bin", std::string(5000, '\0'))}).status, 2);
}

// Never silence: what a file is, or that it is empty, with status 2.
TEST(TraceCommand, AFileThatNoReaderReadsIsNamed) {
  using namespace std::string_literals;
  const Folder folder;
  for (const auto& [bytes, says] :
       std::vector<std::pair<std::string, const char*>>{{"", "the file is empty"},
                                                        {"LOGG\x90\0\0\0"s, "a BLF file"},
                                                        {"\xFF\xFE(\0"s, "UTF-16"},
                                                        {"\x1F\x8B\x08\0"s, "the gzip file is cut short"},
                                                        {"PK\x03\x04"s, "a ZIP archive"},
                                                        {"hello\n", "this is neither candump"},
                                                        {"\x01\x02\0\x03"s, "this is neither candump"}}) {
    for (const Words& more :
         {Words{}, Words{"--stats"}, Words{"--to", "asc", "-o", folder.file("out.asc"), "--force"}}) {
      Words words{"trace", folder.write("odd.log", bytes)};
      words.insert(words.end(), more.begin(), more.end());
      const auto run = berth(words);
      EXPECT_EQ(run.status, 2) << says << run.out;
      EXPECT_NE(run.err.find(says), std::string::npos) << run.err;
    }
  }
}

TEST(TraceCommand, NamesOfTheMachineFileAndOfDescriptions) {
  const Folder folder;
  const auto eds = example("eds/pump.dcf");
  ASSERT_TRUE(exists(eds)) << eds;
  const auto log =
      folder.write("t.log", "(1.000000) can0 605#4018100100000000\n(1.001000) can0 585#431810011F000000\n");
  const auto run = berth({"trace", log, "--eds", "5=" + eds});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("1018h:01"), std::string::npos) << run.out;
  const auto unclear = berth({"trace", log, "--eds", eds});
  EXPECT_EQ(unclear.status, 2);
  EXPECT_NE(unclear.err.find("of which node"), std::string::npos) << unclear.err;
  EXPECT_EQ(berth({"trace", log, "--eds", "5=" + folder.file("none.eds")}).status, 2);
  const auto named = berth({"trace", log, "--machine", example("five-slaves.toml")});
  EXPECT_EQ(named.status, 0) << named.err;
  EXPECT_EQ(berth({"trace", log, "--machine", folder.file("none.toml")}).status, 2);
}

// `berth up` maps and moves the PDOs of a machine's links: the trace knows what it laid.
TEST(TraceCommand, ALinkedMachinesPdosAreThoseOfItsPlan) {
  const Folder folder;
  const std::string eds = folder.bring("eds/io.eds");
  const std::string slot = "\n[[slot]]\nbus = \"field\"\neds = \"eds/io.eds\"\n";
  const std::string machine = folder.write(
      "m.toml", "[machine]\nname = \"m\"\n[bus.field]\nport = \"sim\"\nbitrate = 125_000\n" + slot +
                    "id = 2\nname = \"left\"\n" + slot + "id = 3\nname = \"right\"\n" +
                    "[[link]]\nfrom = \"left/Inputs 1 to 8\"\nto = [\"right/Outputs 1 to 8\"]\ndeadline = \"20 ms\"\n");
  const std::string plant = folder.write("m.plant.toml",
                                         "[bus.field]\n[[device]]\nbus = \"field\"\nname = \"io {n}\"\n"
                                         "eds = \"eds/io.eds\"\ncount = 2\n");
  const std::string log = folder.file("run.log");
  const Outcome up = berth({"up", machine, "--sim", plant, "--until", "operational", "--record", log});
  ASSERT_EQ(up.status, 0) << up.err;
  const Outcome trace = berth({"trace", log, "--machine", machine, "--service", "pdo"});
  ASSERT_EQ(trace.status, 0) << trace.err;
  EXPECT_NE(trace.out.find("[left]: Read input 8 bit.Inputs 1 to 8 = 0"), std::string::npos) << trace.out;
  EXPECT_EQ(trace.out.find("too short"), std::string::npos) << trace.out;
  EXPECT_EQ(trace.out.find("Inputs 9 to 16"), std::string::npos) << trace.out;
  // A PDO carries objects, too: by name or number.
  for (const char* const object : {"Read input 8 bit/Inputs 1", "6000h:01"}) {
    const Outcome of_object = berth({"trace", log, "--machine", machine, "--service", "pdo", "--object", object});
    EXPECT_EQ(of_object.out, trace.out) << object << of_object.err;
  }
  EXPECT_EQ(berth({"trace", log, "--machine", machine, "--service", "pdo", "--object", "6000h:02"}).out, "");
}

TEST(TraceCommand, StatisticsHavePeriodsAndJitter) {
  const Folder folder;
  const auto log =
      folder.write("t.log", "(1.000000) a 181#\n(1.010000) a 181#\n(1.020000) a 181#\n(1.040000) a 181#\n");
  const auto run = berth({"trace", log, "--stats", "--json", "--bitrate", "125000"});
  ASSERT_EQ(run.status, 0) << run.err;
  const auto id = Json::parse(run.out).at("ids").at(0);
  EXPECT_EQ(id.at("id"), "0x181");
  EXPECT_DOUBLE_EQ(id.at("period_min_s").get<double>(), 0.01);
  EXPECT_DOUBLE_EQ(id.at("period_max_s").get<double>(), 0.02);
  EXPECT_NEAR(id.at("period_avg_s").get<double>(), 0.04 / 3, 1e-9);
  EXPECT_GT(id.at("load").get<double>(), 0.01);
}

TEST(TraceCommand, FollowsAFileThatGrows) {
  const Folder folder;
  const auto log = folder.write("t.log", "(1.000000) can0 705#00\n");
  const auto out = folder.file("seen.pcapng");
  Background follow({"trace", log, "--follow", "-o", out, "--timeout", "60"});
  const auto append = [&](const std::string& text) { std::ofstream(log, std::ios::app) << text << std::flush; };
  const auto size = [&] { return exists(out) ? contents(out).size() : 0; };
  const auto grown = [&](std::size_t from) {
    EXPECT_TRUE(eventually([&] { return size() > from; }));
    return size();
  };
  const auto first = grown(0);
  EXPECT_GT(first, 0U) << "what was read is recorded before the end";
  append("(1.001000) can0 70");  // half a line
  append("6#00\n");
  const auto second = grown(first);
  EXPECT_GT(second, first);
  follow.signal(SIGINT);
  const auto run = follow.end();
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("Boot up of node 5"), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("Boot up of node 6"), std::string::npos) << run.out;
  EXPECT_EQ(berth({"trace", out, "--to", "candump", "-o", "-"}).out,
            "(0000000001.000000) can0 705#00\n(0000000001.001000) can0 706#00\n");
}

TEST(TraceCommand, ListensToAPlantAndSendsNothing) {
  const Folder folder;
  const auto socket = folder.file("plant.sock");
  Background served({"plant", example("ailing.plant.toml"), "--listen", socket});
  ASSERT_TRUE(served.says("Ctrl-C ends it")) << "it listens";
  const auto log = folder.file("live.log");
  const auto run = berth({"trace", "--port", "plant:" + socket, "--bus", "line", "--timeout", "5 s", "-o", log});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("Heartbeat of node"), std::string::npos) << run.out << run.err;
  EXPECT_EQ(berth({"trace", log, "--service", "heartbeat"}).status, 0);
  EXPECT_NE(contents(log).find(" line 7"), std::string::npos) << contents(log);
  EXPECT_EQ(berth({"trace", "--port", "plant:" + folder.file("none.sock"), "--timeout", "1 s"}).status, 3);
  EXPECT_EQ(berth({"trace", "--port", "telepathy:can0"}).status, 2);
  EXPECT_EQ(berth({"trace"}).status, 2);
}

// Its bus is outside of it, and neither a record nor Studio takes its frames.
TEST(TraceCommand, JoinsAnUpWhoseBusIsOfAnotherProcess) {
  const Folder folder;
  const std::string socket = folder.file("p.sock"), control = folder.file("c.sock");
  const std::string machine = folder.write("m.toml", patient(small_machine));
  Background served({"plant", folder.write("p.toml", small_plant), "-m", machine, "--listen", socket});
  ASSERT_TRUE(served.says("Ctrl-C ends it"));
  Background up({"up", machine, "--port", "plant:" + socket, "--control", control, "--yes"});
  ASSERT_TRUE(up.says("drive: operational")) << up.said();
  const auto trace = berth({"trace", machine, "--control", control, "--timeout", "3 s"});
  EXPECT_EQ(trace.status, 0) << trace.err;
  EXPECT_NE(trace.out.find("Heartbeat of node 9"), std::string::npos) << trace.out << trace.err;
}

TEST(TraceTimes, CountFromTheFirstFrameWhenToldSo) {
  const Folder folder;
  const std::string log = folder.write("run.log", "(1436509052.250000) can0 705#05\n(1436509053.750000) can0 705#05\n");
  EXPECT_NE(berth({"trace", log}).out.find("(1436509053.750000) can0 705#05"), std::string::npos) << "a file as it is";
  const Outcome relative = berth({"trace", log, "--times", "relative"});
  EXPECT_TRUE(relative.out.starts_with("(0000000000.000000) can0 705#05")) << relative.out;
  EXPECT_NE(relative.out.find("(0000000001.500000) can0 705#05"), std::string::npos) << relative.out;
  EXPECT_EQ(berth({"trace", log, "--times", "odd"}).status, 2);
}

TEST(TraceColour, AnEmcyIsRedOnlyWhereColoursAreWanted) {
  const Folder folder;
  const std::string log = folder.write("run.log", "(1.000000) can0 705#05\n(1.100000) can0 085#1023010000000000\n");
  EXPECT_EQ(berth({"trace", log}).out.find('\x1b'), std::string::npos) << "no terminal";
  const std::string red = berth({"trace", log, "--color", "always"}).out;
  EXPECT_TRUE(red.starts_with("(0000000001.000000)")) << red;
  EXPECT_NE(red.find("\n\x1b[31m(0000000001.100000)"), std::string::npos) << red;
  EXPECT_TRUE(red.ends_with("\x1b[0m\n")) << red;
  EXPECT_EQ(berth({"trace", log, "--color", "sometimes"}).status, 2);
}

}  // namespace
}  // namespace berth::test::trace_tests
